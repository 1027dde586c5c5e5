"""The people of a live world, as the service shows them."""

from typing import Any, Self

from pydantic import Field

from app.api.schemas.numbers import Answer
from app.live.snapshot import BodyView, CylinderView, MotionView, PersonView
from app.sim.human import model as human
from app.sim.human.anthropometry import NAMES


class BodyPublic(Answer):
    """How large a person is, or is becoming."""

    stature: float = Field(description="percentile asked for last")
    arms: float = Field(description="percentile asked for last, at that stature")
    shoulders: float = Field(description="percentile asked for last, at that stature")
    recorded: bool = Field(description="a recorded person's lengths hold, not the percentiles")
    stature_m: float = Field(description="height, standing upright [m]")
    trunk_m: float = Field(description="pelvis to the base of the neck [m]")
    arm_m: float = Field(description="shoulder to palm, mean of both [m]")
    shoulders_m: float = Field(description="from shoulder to shoulder [m]")

    @classmethod
    def from_domain(cls, view: BodyView) -> Self:
        """Make it from the world's view."""
        return cls(**{name: getattr(view, name) for name in cls.model_fields})


class MotionLive(Answer):
    """A recorded motion that is being played."""

    name: str
    run: int = Field(description="which of its clean runs, from 0")
    n_runs: int
    t_s: float = Field(description="how far it has come [s]")
    duration_s: float = Field(description="length of the run [s]")
    outside_share: float = Field(description="share of its path outside the walking area")
    clipped_share: float = Field(
        description="share of frames with an angle beyond a joint limit, told as the limit"
    )
    clipped_m: float = Field(
        description="how far a wrist told so is from the true one at most [m]"
    )

    @classmethod
    def from_domain(cls, view: MotionView) -> Self:
        """Make it from the world's view."""
        return cls(**{name: getattr(view, name) for name in cls.model_fields})


class CylinderLive(Answer):
    """A person of whom no more than an upright cylinder is known."""

    x: float = Field(description="axis [m]")
    y: float = Field(description="axis [m]")
    vx: float = Field(description="velocity in the period to come [m/s]")
    vy: float = Field(description="velocity in the period to come [m/s]")
    radius: float = Field(description="radius [m]")
    height: float = Field(description="height above the floor [m]")

    @classmethod
    def from_domain(cls, view: CylinderView) -> Self:
        """Make it from the world's view."""
        return cls(**{name: getattr(view, name) for name in cls.model_fields})


class PersonLight(Answer):
    """One person, without joint positions."""

    id: int = Field(description="number of the person; the first is 0")
    mode: str = Field(description="who moves the person: manual, auto, still or recorded")
    body: BodyPublic
    motion: MotionLive | None = Field(description="what is played in mode recorded")
    joining: bool = Field(description="on the way to where work, motion or rest begin")
    outside_area: bool = Field(description="the pelvis is outside the walking area")
    clearance_m: float = Field(description="distance of the robot [m]")
    nearest: bool = Field(description="nobody is nearer to the robot; whom the policy sees")
    cylinder: CylinderLive | None = Field(
        description="what counts for contact in a reach cell, where the posture is a picture"
    )

    @classmethod
    def from_domain(cls, view: PersonView) -> Self:
        """Make it from the world's view."""
        return cls(**_light(view))


class PersonLive(PersonLight):
    """One person with posture, speed and size."""

    q: list[float] = Field(
        description="joint positions [m, rad]: " + ", ".join(human.JOINT_NAMES)
    )
    qd: list[float] = Field(description="joint speeds [m/s, rad/s]")
    size: list[float] = Field(description="lengths at this moment [m]: " + ", ".join(NAMES))

    @classmethod
    def from_domain(cls, view: PersonView) -> Self:
        """Make it from the world's view."""
        return cls(
            **_light(view), q=view.q.tolist(), qd=view.qd.tolist(), size=view.size.tolist()
        )


def _light(view: PersonView) -> dict[str, Any]:
    same = ("id", "mode", "joining", "outside_area", "clearance_m", "nearest")
    return {name: getattr(view, name) for name in same} | {
        "body": BodyPublic.from_domain(view.body),
        "motion": view.motion and MotionLive.from_domain(view.motion),
        "cylinder": view.cylinder and CylinderLive.from_domain(view.cylinder),
    }
