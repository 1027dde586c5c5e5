"""Parts of a work cell: table, obstacles, stations, goals, robot, safety.

Each field states its unit in its description and its range in its annotation (:class:`Within`,
:class:`Each`), which ``cell_validation/units.py`` checks.
"""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue

from app.sim.core.arrays import Vec

Six = tuple[float, float, float, float, float, float]
Three = tuple[float, float, float]
Position = Three


@dataclass(frozen=True, slots=True)
class Within:
    """The values that a number, or each number of a tuple, may have."""

    low: float
    """Least value."""
    high: float
    """Greatest value."""
    unit: str
    """Unit, as written in text for people; empty for a plain number."""

    def __get_pydantic_json_schema__(
        self, core: Any, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Write the bounds into the JSON schema."""
        found = handler(core)
        for part in (found, *found.get("prefixItems", ()), *found.get("anyOf", ())):
            if part.get("type") in ("number", "integer"):
                part.update(minimum=self.low, maximum=self.high)
        return found


@dataclass(frozen=True, slots=True)
class Each:
    """The values that the numbers of a tuple may have, one after the other."""

    parts: tuple[Within, ...]
    """Bounds of each number."""


UR10_QD_MAX = (2.16, 2.16, 3.15, 3.2, 3.2, 3.2)
"""Joint speeds of the UR10, from ur10_robot.urdf [rad/s]."""
MAX_FAILURE = 0.99
"""Largest failure probability of a pick; at 1 plans would not end."""
TURN = 6.2842
"""A full turn, with room for rounded numbers [rad]."""

Length = Annotated[float, Within(-10.0, 10.0, "m")]
Place = Annotated[Position, Within(-3.0, 3.0, "m")]
Angles = Annotated[Six, Within(-TURN, TURN, "rad")]
Speed = Annotated[float, Within(0.0, 5.0, "m/s")]
Radius = Annotated[float, Within(0.05, 1.0, "m")]
Share = Annotated[float, Within(0.0, 1.0, "")]
Seconds = Annotated[float, Within(0.0, 5.0, "s")]
Uncertainty = Annotated[float, Within(0.0, 1.0, "m")]
CELL_NAME = r"^[a-z][a-z0-9-]{0,63}$"
"""Pattern of the names of cells."""
Label = Annotated[str, Field(min_length=1, max_length=80)]
Id = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]{0,31}$")]


class CellData(BaseModel):
    """Root of every part of a cell: frozen, finite, without unknown fields."""

    # Strict: "0.5" and true are no numbers.
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)


class TableGeometry(CellData):
    """A rectangular table top; its upper face is the plane z = 0."""

    x_min: Length = Field(description="left edge [m]")
    x_max: Length = Field(description="right edge [m]")
    y_min: Length = Field(description="edge behind the robot [m]")
    y_max: Length = Field(description="edge on the person's side [m]")
    thickness: Annotated[float, Within(0.005, 0.5, "m")] = Field(
        description="thickness of the top [m]"
    )
    height: Annotated[float, Within(0.2, 2.0, "m")] = Field(
        description="height of the top, and of the robot's base, above the floor [m]"
    )


class Obstacle(CellData):
    """A fixed box that the robot must not touch."""

    id: Id = Field(description="name in messages")
    label: Label = Field(description="name for people")
    center: Annotated[Position, Within(-5.0, 5.0, "m")] = Field(description="centre [m]")
    half_size: Annotated[Three, Within(0.001, 5.0, "m")] = Field(
        description="half of length, width and height [m]"
    )
    yaw: Annotated[float, Within(-TURN, TURN, "rad")] = Field(
        default=0.0, description="turn about the vertical [rad]"
    )


class Station(CellData):
    """A named place to which the robot's tool can move."""

    id: Id = Field(description="name in requests")
    kind: Literal["cube", "dock", "clutter", "cluster"] = Field(
        description="what stands there: a cube or a dock to pick and place, a clutter slot to "
        "sort from, a cluster (a tower of blocks of one colour) to sort to"
    )
    label: Label = Field(description="name for people")
    position: Place = Field(
        description="point the tcp must reach; a cluster's lowest level [m]"
    )
    failure_probability: Annotated[float | None, Within(0.0, MAX_FAILURE, "")] = Field(
        default=None, description="chance that a pick from this clutter slot fails"
    )
    colour: Literal["red", "green", "blue"] | None = Field(
        default=None, description="colour of the blocks of a cluster"
    )
    levels: Annotated[int | None, Within(1, 64, "")] = Field(
        default=None, description="levels of a cluster"
    )
    level_height: Annotated[float | None, Within(0.002, 0.3, "m")] = Field(
        default=None, description="height of one level of a cluster [m]"
    )

    def points(self) -> Vec:
        """Return every point the tcp must reach here [m]: one, or one per level, (n, 3)."""
        levels = self.levels or 1
        heights = np.arange(levels) * (self.level_height or 0.0)
        lifts: Vec = heights[:, None] * np.array([0.0, 0.0, 1.0])
        return np.array(self.position) + lifts


class GoalRegion(CellData):
    """A box of goals, with a grid of training targets in it (docs/method.md 2.3)."""

    center: Place = Field(description="centre of the box [m]")
    size: Annotated[Three, Within(0.0, 5.0, "m")] = Field(
        description="length, width and height of the box [m]"
    )
    spacing: Annotated[float, Within(0.01, 2.0, "m")] = Field(
        description="distance of neighbouring grid points; divides every side [m]"
    )

    def box(self) -> tuple[Vec, Vec]:
        """Return the lower and the upper corner of the box [m], shape (3,) each."""
        middle, half = np.array(self.center), 0.5 * np.array(self.size)
        return middle - half, middle + half

    def counts(self) -> tuple[int, int, int]:
        """Return the number of grid points along x, y and z."""
        x, y, z = (round(side / self.spacing) + 1 for side in self.size)
        return x, y, z

    def targets(self) -> Vec:
        """Return the grid points [m], shape (n, 3); z runs fastest, then y."""
        axes = [
            middle + side * (np.linspace(-0.5, 0.5, n) if n > 1 else np.zeros(1))
            for middle, side, n in zip(self.center, self.size, self.counts(), strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


class RobotMount(CellData):
    """The robot in this cell: home configuration, limits and tool. Its base is the frame."""

    model: Literal["ur10"] = Field(default="ur10", description="robot model")
    home_q: Angles = Field(description="home configuration, base to wrist 3 [rad]")
    q_min: Angles = Field(description="lower joint limits [rad]")
    q_max: Angles = Field(description="upper joint limits [rad]")
    qd_max: Annotated[
        Six, Each(tuple(Within(0.01, limit, "rad/s") for limit in UR10_QD_MAX))
    ] = Field(description="joint speed limits, at most the UR10's own [rad/s]")
    qdd_max: Annotated[Six, Within(0.1, 50.0, "rad/s^2")] = Field(
        description="joint acceleration limits [rad/s^2]"
    )
    jerk_max: Annotated[Six, Within(1.0, 5000.0, "rad/s^3")] = Field(
        default=(50.0, 50.0, 50.0, 50.0, 50.0, 50.0), description="joint jerk limits [rad/s^3]"
    )
    tool_length: Annotated[float, Within(0.01, 0.6, "m")] = Field(
        description="from flange to tcp [m]"
    )
    tool_radius: Annotated[float, Within(0.005, 0.2, "m")] = Field(
        description="radius of the tool's capsule [m]"
    )
    dt: Annotated[float, Within(0.002, 0.2, "s")] = Field(description="control period [s]")


class CellSafety(CellData):
    """Assumptions of speed and separation monitoring in this cell (docs/method.md 2.7)."""

    protective_distance: Uncertainty = Field(
        default=0.3, description="least distance to people, added to the rule [m]"
    )
    human_speed: Speed = Field(default=1.6, description="assumed speed of a person, v_h [m/s]")
    reaction_time: Seconds = Field(
        default=0.1, description="reaction time [s]; T_r adds control period, delay and age"
    )
    tracker_delay: Seconds = Field(default=0.0, description="age of the tracker's data [s]")
    intrusion_distance: Uncertainty = Field(default=0.0, description="intrusion, C [m]")
    person_uncertainty: Uncertainty = Field(
        default=0.0, description="uncertainty of a person's position, Z_d [m]"
    )
    robot_uncertainty: Uncertainty = Field(
        default=0.0, description="uncertainty of the robot's position, Z_r [m]"
    )
    pfl: bool = Field(default=False, description="whether power and force limiting is on")
