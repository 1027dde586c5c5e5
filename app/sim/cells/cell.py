"""Work cells as data: objects, people and limits.

A cell is a JSON file that users may write; ``app.sim.cell_validation`` reads and validates it.
Frame: the robot's base, x right, y toward the person, z up, table top at z = 0. SI units,
radians.

Source: docs/method.md 2.1 and 2.3 (``shared-workspace``), 3.2 (``pick-and-place``), 1.1
(``sorting-*``); coordinates that the thesis does not print are ours.
"""

import hashlib
import json
from collections.abc import Mapping
from functools import cache, cached_property
from importlib import resources
from typing import Any, Self

from pydantic import Field, ValidationError

from app.errors import CheckpointMismatch, InvalidInput, NotFound
from app.sim.cells.parts import (
    CELL_NAME,
    CellData,
    CellSafety,
    GoalRegion,
    Label,
    Obstacle,
    RobotMount,
    Station,
    TableGeometry,
)
from app.sim.cells.people import CylinderPerson, Person, Worker
from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import MEDIAN

LIMITS = {"stations": 128, "obstacles": 32, "people": 4}
"""Longest list of each name."""
MAX_TARGETS = 2000
"""Most grid points of a goal region."""
_SHIPPED = resources.files("app.sim.cells") / "data"


class Cell(CellData):
    """One work cell."""

    name: str = Field(pattern=CELL_NAME, description="name in requests")
    title: Label = Field(description="name for people")
    table: TableGeometry
    robot: RobotMount
    stations: tuple[Station, ...] = Field(default=(), description="named places, at most 128")
    goal_region: GoalRegion | None = Field(default=None, description="box of goals, or null")
    obstacles: tuple[Obstacle, ...] = Field(default=(), description="fixed boxes, at most 32")
    people: tuple[Person, ...] = Field(default=(), description="who may be there, at most 4")
    safety: CellSafety = CellSafety()

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
            NotFound: The cell has no worker.
        """
        if not self.workers:
            raise NotFound("worker in the cell", self.name)
        return self.workers[0]

    @property
    def body(self) -> Vec:
        """Size of the first worker as kernels take it [m], shape (12,); median where none."""
        size = self.workers[0].size if self.workers else MEDIAN
        return size.vector(self.floor_z)

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

    def station(self, name: str) -> Station:
        """Return one station by id.

        Raises:
            NotFound: The cell has no such station.
        """
        for station in self.stations:
            if station.id == name:
                return station
        raise NotFound("station", name, self.station_ids)

    def definition(self) -> dict[str, Any]:
        """Return the cell as JSON data, without fields that are not set."""
        return self.model_dump(mode="json", exclude_none=True)

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the content, 64 hexadecimal digits."""
        text = json.dumps(self.model_dump(mode="json"), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()

    def model_copy(
        self, *, update: Mapping[str, Any] | None = None, deep: bool = False
    ) -> Self:
        """Return a copy, as pydantic does; a changed copy has its own SHA-256."""
        copied = super().model_copy(update=update, deep=deep)
        copied.__dict__.pop("sha256", None)  # copied with the fields
        return copied


def require_cell(cell: Cell, name: str, sha256: str) -> None:
    """Raise unless a policy trained in the cell of a name and content acts in this cell.

    Raises:
        CheckpointMismatch: It was trained in another cell, or before the cell was changed.
    """
    if name != cell.name:
        raise CheckpointMismatch("cell", cell.name, name)
    if sha256 != cell.sha256:
        now, then = f"{name} as it is now ({cell.sha256[:8]})", f"{name} ({sha256[:8]})"
        raise CheckpointMismatch("cell", now, then)


def lacks_stations(cell: Cell) -> str | None:
    """Return the missing stations for picks and for the work of people; None if complete."""
    if not cell.stations_of("cube") or not cell.stations_of("dock"):
        return "needs at least one station of kind cube and one of kind dock"
    return None


def lacks_for_pick_episodes(cell: Cell) -> str | None:
    """Return the missing parts for episodes of the pick scenario; None if complete."""
    if cell.robot.home_q[5] != 0.0:
        return "needs home_q[5] = 0 rad: picks hold the sixth joint there"
    return lacks_stations(cell)


def lacks_for_pick(cell: Cell) -> str | None:
    """Return the missing parts for training, decisions and display; None if complete.

    A cell describes one worker; presets and arguments of environments set the number and kinds
    of people, 0 to 4. Fixed obstacles are not observed: a policy learns their positions.
    """
    lack = lacks_for_pick_episodes(cell)
    if lack is None and (len(cell.people) != 1 or not cell.workers):
        return "needs exactly one person, of kind worker"
    return lack


def lacks_for_reach(cell: Cell) -> str | None:
    """Return the missing parts for training of a reach policy; None if complete.

    The preset defines the pedestrians: in a cell without one, they walk in the area of its
    first person.
    """
    return "needs a goal_region" if cell.goal_region is None else None


@cache
def cell_names() -> tuple[str, ...]:
    """Return the names of the shipped cells."""
    names = [entry.name for entry in _SHIPPED.iterdir()]
    return tuple(sorted(one.removesuffix(".json") for one in names if one.endswith(".json")))


@cache
def load_cell(name: str = "pick-and-place") -> Cell:
    """Return a shipped cell.

    Raises:
        NotFound: No cell of that name is shipped.
    """
    if name not in cell_names():
        raise NotFound("cell", name, cell_names())
    return Cell.model_validate_json((_SHIPPED / f"{name}.json").read_text("utf-8"))


def parse_definition(definition: object) -> Cell:
    """Return a cell from JSON data that was checked when it came in.

    Raises:
        InvalidInput: It does not fit this version of the schema.
    """
    try:
        return Cell.model_validate_json(json.dumps(definition))
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        rule = "was stored by another version of Tandem and does not fit this one: add it again"
        raise InvalidInput(f"cell.{place}", first["msg"], rule) from error
