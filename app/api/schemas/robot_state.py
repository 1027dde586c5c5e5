"""Joints of the robot in a request: base to wrist 3, or in any order by name."""

import re
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field, field_validator
from pydantic_core import PydanticCustomError

from app.api.schemas.numbers import Body, Vector6
from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.robot.ur10 import JOINT_NAMES

ROS_NAMES = tuple(f"{name}_joint" for name in JOINT_NAMES)
"""Names of the joints in ROS, base to wrist 3."""
_JOINT = re.compile(r"(robot\.(?:q|qd|qdd))\[([0-5])\]")


class RobotState(Body):
    """Measured state of the robot."""

    names: Annotated[list[str], Field(max_length=32)] | None = Field(
        default=None,
        description="names of the joints in the order of `q` and `qd`, as in "
        "sensor_msgs/JointState (which is alphabetical): each of "
        f"{', '.join(ROS_NAMES)} once; null: this order, base to wrist 3",
        examples=[sorted(ROS_NAMES)],
    )
    q: Vector6 = Field(description="joint positions [rad], base to wrist 3 or as `names` says")
    qd: Vector6 = Field(description="joint speeds [rad/s], in the same order")

    @field_validator("names")
    @classmethod
    def _are_the_joints_of_the_robot(cls, names: list[str] | None) -> list[str] | None:
        if names is None or sorted(names) == sorted(ROS_NAMES):
            return names
        faults = [f"has the unknown name {name!r}" for name in names if name not in ROS_NAMES]
        faults += [
            f"holds {one!r} {names.count(one)} times"
            for one in ROS_NAMES
            if names.count(one) > 1
        ]
        faults += [f"lacks {one!r}" for one in ROS_NAMES if one not in names]
        raise PydanticCustomError(
            "joint_names",
            "must hold every joint of the robot once: it {faults}",
            {"faults": ", ".join(faults)[:300], "choices": list(ROS_NAMES)},
        )

    def joints(self, values: list[float]) -> Vec:
        """Return values in the order of the request from base to wrist 3, shape (6,)."""
        return np.array(values)[self._order()]

    def _order(self) -> list[int]:
        """Return the indices of the joints, base to wrist 3, in the request."""
        names = self.names
        return list(range(6)) if names is None else [names.index(one) for one in ROS_NAMES]

    def faults_in_place(self) -> "_FaultsInPlace":
        """Return a context that replaces joint indices in errors by those of the request."""
        return _FaultsInPlace(self)


class ArmState(RobotState):
    """Measured state of the robot, with accelerations."""

    qdd: Vector6 | None = Field(
        None,
        description="joint accelerations [rad/s^2], in the same order; required by policies "
        "with jerk limits",
    )


@dataclass(frozen=True, slots=True)
class _FaultsInPlace:
    """Context of a decision; without a generator, which takes five times as long."""

    state: RobotState

    def __enter__(self) -> None:
        """Begin the decision."""

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        """Replace an error."""
        if isinstance(error, InvalidInput) and (found := _JOINT.fullmatch(error.field)):
            joint = int(found[2])
            field = f"{found[1]}[{self.state._order()[joint]}]"
            rule = f"{error.rule}: {ROS_NAMES[joint]}"
            raise InvalidInput(field, error.value, rule, error.choices) from None
