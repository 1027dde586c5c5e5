"""People of a work cell: a worker with 18 joints, or one of three kinds of pedestrians.

Source: docs/method.md 2.1 (cylinders, with the constants of the authors' code as defaults) and
3.4 (worker). Initial positions of cylinders are part of the scenario, not of the cell.
"""

from typing import Annotated, Literal

from pydantic import Field

from app.sim.cells.parts import (
    TURN,
    CellData,
    Each,
    Length,
    Radius,
    Share,
    Speed,
    Three,
    Within,
)
from app.sim.human.anthropometry import BodySize, percentile_body

Percentile = Annotated[float, Within(1.0, 99.0, "percentile")]


class _Walking(CellData):
    """Walking area: bounds of the pelvis or the cylinder's axis."""

    x_min: Length = Field(description="walking area, left edge [m]")
    x_max: Length = Field(description="walking area, right edge [m]")
    y_min: Length = Field(description="walking area, edge at the table [m]")
    y_max: Length = Field(description="walking area, far edge [m]")


class Worker(_Walking):
    """An 18-DoF person at work at the table (docs/method.md 3.4)."""

    kind: Literal["worker"] = Field(default="worker", description="an 18-DoF person at work")
    home: Annotated[
        Three,
        Each((Within(-10.0, 10.0, "m"), Within(-10.0, 10.0, "m"), Within(-TURN, TURN, "rad"))),
    ] = Field(description="pelvis x, y [m] and yaw [rad] when at rest")
    pelvis_height: Annotated[float, Within(0.4, 1.4, "m")] = Field(
        description="pelvis above the floor, of a person of median stature [m]"
    )
    stature: Percentile = Field(default=50.0, description="stature among adults [percentile]")
    arms: Percentile = Field(
        default=50.0, description="length of the arms at that stature [percentile]"
    )
    shoulders: Percentile = Field(
        default=50.0, description="width of the shoulders at that stature [percentile]"
    )

    @property
    def size(self) -> BodySize:
        """Body size."""
        return percentile_body(self.stature, self.arms, self.shoulders, self.pelvis_height)


class _CylinderOnFloor(_Walking):
    """A vertical cylinder that walks to random targets of its area (docs/method.md 2.1)."""

    radius_min: Radius = Field(default=0.2, description="least radius [m]")
    radius_max: Radius = Field(default=0.5, description="greatest radius [m]")
    height: Annotated[float, Within(0.5, 3.0, "m")] = Field(
        default=2.0, description="height above the floor [m]"
    )
    target_tolerance: Annotated[float, Within(0.001, 1.0, "m")] = Field(
        default=0.1, description="distance at which a target counts as reached [m]"
    )
    p_still: Share = Field(default=0.05, description="chance to stand still a whole episode")
    p_stay: Share = Field(default=0.1, description="chance to stay at a target it reached")


class Walker(_CylinderOnFloor):
    """A cylinder of continuously varying speed and radius, eq. (4.1), (4.2)."""

    kind: Literal["walker"] = Field(description="speed and radius change with time")
    speed_min: Speed = Field(default=0.3, description="slower counts as standing [m/s]")
    speed_max: Speed = Field(default=1.0, description="greatest speed [m/s]")
    speed_frequency_max: Annotated[float, Within(0.0, 10.0, "Hz")] = Field(
        default=1.0, description="greatest frequency of the speed function [Hz]"
    )
    radius_frequency_max: Annotated[float, Within(0.0, 10.0, "Hz")] = Field(
        default=0.5, description="greatest frequency of the radius function [Hz]"
    )


class ConstantWalker(_CylinderOnFloor):
    """A cylinder with one speed and one radius per episode, both drawn from their range."""

    kind: Literal["constant"] = Field(description="speed and radius constant per episode")
    speed_min: Speed = Field(default=0.3, description="least speed [m/s]")
    speed_max: Speed = Field(default=1.0, description="greatest speed [m/s]")


class FixedSpeedWalker(_CylinderOnFloor):
    """A cylinder of fixed speed, possibly below that of others (docs/method.md 2.1)."""

    kind: Literal["fixed-speed"] = Field(description="given speed, radius changes with time")
    speed: Speed = Field(description="its speed [m/s]")
    radius_frequency_max: Annotated[float, Within(0.0, 10.0, "Hz")] = Field(
        default=0.5, description="greatest frequency of the radius function [Hz]"
    )


CylinderPerson = Walker | ConstantWalker | FixedSpeedWalker
Person = Annotated[Worker | CylinderPerson, Field(discriminator="kind")]
