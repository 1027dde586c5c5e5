"""Work cells as data: what stands where, who walks there, and the limits that hold.

A cell is a JSON file that a user may write; ``cell_file.read_cell`` reads it and
``cell_checks.check_cell`` says everything that is wrong with it. What is here are the fields,
each with its unit and the values it may have. Frame: the robot's base, x right, y toward the
person, z up, table top at z = 0. SI units, radians.

Source: METHOD 2.1 and 2.3 (``shared-workspace``), 3.2 (``pick-and-place``), 1.1
(``sorting-*``); coordinates that the source does not print are ours.
"""

import hashlib
import json
import math
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from app.errors import NotFound
from app.sim.ports import Vec

Six = tuple[float, float, float, float, float, float]
Three = tuple[float, float, float]
Position = Three

LIMITS = {"stations": 128, "obstacles": 32, "people": 4}
"""Longest list of each name."""
MAX_TARGETS = 2000
"""Most grid points of a goal region."""
DEFAULT_PELVIS_HEIGHT = 0.95
"""Pelvis over the floor where a cell has no worker to say it [m]."""


@dataclass(frozen=True, slots=True)
class Within:
    """The values that a number, or each number of a tuple, may have."""

    low: float
    """Least value."""
    high: float
    """Greatest value."""
    unit: str
    """Unit, as written in text for people; empty for a plain number."""


@dataclass(frozen=True, slots=True)
class Each:
    """The values that the numbers of a tuple may have, one after the other."""

    parts: tuple[Within, ...]
    """Bounds of each number."""


UR10_QD_MAX = (2.16, 2.16, 3.15, 3.2, 3.2, 3.2)
"""Joint speeds of the UR10, from ur10_robot.urdf [rad/s]."""
TURN = 2.0 * math.pi + 1e-3
"""A full turn, with room for rounded numbers [rad]."""

Length = Annotated[float, Within(-10.0, 10.0, "m")]
Place = Annotated[Position, Within(-3.0, 3.0, "m")]
Angles = Annotated[Six, Within(-TURN, TURN, "rad")]
Size = Annotated[float, Within(0.001, 5.0, "m")]
Speed = Annotated[float, Within(0.0, 5.0, "m/s")]
Radius = Annotated[float, Within(0.05, 1.0, "m")]
Share = Annotated[float, Within(0.0, 1.0, "")]
Seconds = Annotated[float, Within(0.0, 5.0, "s")]
Uncertainty = Annotated[float, Within(0.0, 1.0, "m")]
Label = Annotated[str, Field(min_length=1, max_length=80)]
Id = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_-]{0,31}$")]


class _Data(BaseModel):
    # Strict: "0.5" and true are no numbers.
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)


class Table(_Data):
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


class Obstacle(_Data):
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


class Station(_Data):
    """A named place the robot's tool can be sent to."""

    id: Id = Field(description="name in requests")
    kind: Literal["cube", "dock", "clutter", "cluster"] = Field(
        description="what stands there: a cube or a dock to pick and place, a clutter cell to "
        "sort from, a cluster (a tower of blocks of one colour) to sort to"
    )
    label: Label = Field(description="name for people")
    position: Place = Field(
        description="point the tcp must reach; a cluster's lowest level [m]"
    )
    failure_probability: Annotated[float | None, Within(0.0, 0.999, "")] = Field(
        default=None, description="chance that a pick from this clutter cell fails, below 1 []"
    )
    colour: Literal["red", "green", "blue"] | None = Field(
        default=None, description="colour of the blocks of a cluster"
    )
    levels: Annotated[int | None, Within(1, 64, "")] = Field(
        default=None, description="levels of a cluster []"
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


class GoalRegion(_Data):
    """A box of goals, with a grid of training targets in it (METHOD 2.3)."""

    center: Place = Field(description="centre of the box [m]")
    size: Annotated[Three, Within(0.0, 5.0, "m")] = Field(
        description="length, width and height of the box [m]"
    )
    spacing: Annotated[float, Within(0.01, 2.0, "m")] = Field(
        description="distance of neighbouring grid points; divides every side [m]"
    )

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


class RobotMount(_Data):
    """The robot in this cell: home posture, limits and tool. Its base is the frame."""

    model: Literal["ur10"] = Field(default="ur10", description="robot model")
    home_q: Angles = Field(description="home posture, base to wrist 3 [rad]")
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


class _Walking(_Data):
    """Where a person may be; the walking area bounds the pelvis or the cylinder's axis."""

    x_min: Length = Field(description="walking area, left edge [m]")
    x_max: Length = Field(description="walking area, right edge [m]")
    y_min: Length = Field(description="walking area, edge at the table [m]")
    y_max: Length = Field(description="walking area, far edge [m]")


class Worker(_Walking):
    """An 18-DoF person who stands and works at the table (METHOD 3.4)."""

    kind: Literal["worker"] = Field(default="worker", description="an 18-DoF person at work")
    home: Annotated[
        Three,
        Each(
            (
                Within(-10.0, 10.0, "m"),
                Within(-10.0, 10.0, "m"),
                Within(-TURN, TURN, "rad"),
            )
        ),
    ] = Field(description="pelvis x, y [m] and yaw [rad] when at rest")
    pelvis_height: Annotated[float, Within(0.4, 1.4, "m")] = Field(
        description="pelvis above the floor [m]"
    )


class _Cylinder(_Walking):
    """A vertical cylinder that walks to random targets of its area (METHOD 2.1)."""

    radius_min: Radius = Field(default=0.2, description="least radius [m]")
    radius_max: Radius = Field(default=0.5, description="greatest radius [m]")
    height: Annotated[float, Within(0.5, 3.0, "m")] = Field(
        default=2.0, description="height above the floor [m]"
    )
    target_tolerance: Annotated[float, Within(0.001, 1.0, "m")] = Field(
        default=0.1, description="distance at which a target counts as reached [m]"
    )
    p_still: Share = Field(default=0.05, description="chance to stand still a whole episode []")
    p_stay: Share = Field(default=0.1, description="chance to stay at a target it reached []")


class Walker(_Cylinder):
    """A cylinder whose speed and radius change all the time, eq. (4.1), (4.2)."""

    kind: Literal["walker"] = Field(description="speed and radius change with time")
    speed_min: Speed = Field(default=0.3, description="slower counts as standing [m/s]")
    speed_max: Speed = Field(default=1.0, description="greatest speed [m/s]")
    speed_frequency_max: Annotated[float, Within(0.0, 10.0, "Hz")] = Field(
        default=1.0, description="greatest frequency of the speed function [Hz]"
    )
    radius_frequency_max: Annotated[float, Within(0.0, 10.0, "Hz")] = Field(
        default=0.5, description="greatest frequency of the radius function [Hz]"
    )


class ConstantWalker(_Cylinder):
    """A cylinder with one speed and one radius per episode, both drawn from their range."""

    kind: Literal["constant"] = Field(description="speed and radius constant per episode")
    speed_min: Speed = Field(default=0.3, description="least speed [m/s]")
    speed_max: Speed = Field(default=1.0, description="greatest speed [m/s]")


class FixedSpeedWalker(_Cylinder):
    """A cylinder with a given speed, below ``speed_min`` of the others too (METHOD 2.1)."""

    kind: Literal["fixed-speed"] = Field(description="given speed, radius changes with time")
    speed: Speed = Field(description="its speed [m/s]")
    radius_frequency_max: Annotated[float, Within(0.0, 10.0, "Hz")] = Field(
        default=0.5, description="greatest frequency of the radius function [Hz]"
    )


CylinderPerson = Walker | ConstantWalker | FixedSpeedWalker
Person = Annotated[Worker | CylinderPerson, Field(discriminator="kind")]


class SafetySettings(_Data):
    """What speed and separation monitoring assumes in this cell (METHOD 2.7)."""

    protective_distance: Uncertainty = Field(
        default=0.3, description="least distance to anyone, on top of the rule [m]"
    )
    human_speed: Speed = Field(default=1.6, description="assumed speed of a person, v_h [m/s]")
    reaction_time: Seconds = Field(default=0.1, description="reaction time, T_r [s]")
    tracker_delay: Seconds = Field(default=0.0, description="age of what the tracker says [s]")
    intrusion_distance: Uncertainty = Field(default=0.0, description="intrusion, C [m]")
    person_uncertainty: Uncertainty = Field(
        default=0.0, description="uncertainty of a person's position, Z_d [m]"
    )
    robot_uncertainty: Uncertainty = Field(
        default=0.0, description="uncertainty of the robot's position, Z_r [m]"
    )
    pfl: bool = Field(default=False, description="whether power and force limiting is on")


class Cell(_Data):
    """One work cell."""

    name: str = Field(pattern=r"^[a-z][a-z0-9-]{0,63}$", description="name in requests")
    title: Label = Field(description="name for people")
    table: Table
    robot: RobotMount
    stations: tuple[Station, ...] = Field(default=(), description="named places, at most 128")
    goal_region: GoalRegion | None = Field(default=None, description="box of goals, or null")
    obstacles: tuple[Obstacle, ...] = Field(default=(), description="fixed boxes, at most 32")
    people: tuple[Person, ...] = Field(default=(), description="who may be there, at most 4")
    safety: SafetySettings = SafetySettings()

    @property
    def floor_z(self) -> float:
        """Height of the floor in the cell's frame [m]."""
        return -self.table.height

    @property
    def workers(self) -> tuple[Worker, ...]:
        """The people with 18 joints, in order."""
        return tuple(person for person in self.people if isinstance(person, Worker))

    @property
    def cylinders(self) -> tuple[CylinderPerson, ...]:
        """The people who are cylinders, in order."""
        return tuple(person for person in self.people if not isinstance(person, Worker))

    @property
    def human(self) -> Worker:
        """The first worker.

        Raises:
            NotFound: Nobody works in this cell.
        """
        for person in self.workers:
            return person
        raise NotFound("worker in the cell", self.name)

    @property
    def pelvis_z(self) -> float:
        """Height of the first worker's pelvis in the cell's frame [m]."""
        heights = [person.pelvis_height for person in self.workers]
        return self.floor_z + (heights[0] if heights else DEFAULT_PELVIS_HEIGHT)

    @property
    def station_ids(self) -> tuple[str, ...]:
        """Names of all stations, in order."""
        return tuple(station.id for station in self.stations)

    @property
    def pick_stations(self) -> tuple[Station, ...]:
        """The stations of the pick scenario: cubes, then docks."""
        return self.stations_of("cube") + self.stations_of("dock")

    def stations_of(self, kind: str) -> tuple[Station, ...]:
        """Return the stations of one kind, in order."""
        return tuple(station for station in self.stations if station.kind == kind)

    def positions(self) -> Vec:
        """Return the stations' positions [m], shape (n_stations, 3)."""
        rows = [station.position for station in self.stations]
        return np.array(rows, dtype=np.float64).reshape(-1, 3)

    def station(self, name: str) -> Station:
        """Return one station by id.

        Raises:
            NotFound: The cell has no such station.
        """
        for station in self.stations:
            if station.id == name:
                return station
        raise NotFound("station", name, self.station_ids)

    def definition(self) -> dict[str, object]:
        """Return the cell as JSON data, without fields that are not set."""
        return self.model_dump(mode="json", exclude_none=True)

    @property
    def sha256(self) -> str:
        """Identity of its content, 64 hexadecimal digits: any change of a field changes it."""
        text = json.dumps(self.model_dump(mode="json"), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


def lacks_for_pick(cell: Cell) -> str | None:
    """Say what a cell lacks for the pick scenario (METHOD 3.2); None where nothing."""
    if not cell.stations_of("cube") or not cell.stations_of("dock"):
        return "needs at least one station of kind cube and one of kind dock"
    if len(cell.people) != 1 or not cell.workers:
        return "needs exactly one person, of kind worker"
    if cell.obstacles:
        return "must have no fixed obstacles: this scenario does not see them yet"
    return None


def cell_names() -> tuple[str, ...]:
    """Return the names of the shipped cells."""
    folder = resources.files("app.sim") / "cells_data"
    return tuple(
        sorted(
            entry.name.removesuffix(".json")
            for entry in folder.iterdir()
            if entry.name.endswith(".json")
        )
    )


@cache
def load_cell(name: str = "pick-and-place") -> Cell:
    """Return a shipped cell.

    Raises:
        NotFound: No cell of that name is shipped.
    """
    if name not in cell_names():
        raise NotFound("cell", name, cell_names())
    text = (resources.files("app.sim") / "cells_data" / f"{name}.json").read_text("utf-8")
    return Cell.model_validate_json(text)


def parse_definition(definition: object) -> Cell:
    """Return a cell from JSON data that was checked when it came in."""
    return Cell.model_validate_json(json.dumps(definition))
