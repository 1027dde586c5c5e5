"""Checks of a command against the work cell and the state of its world.

The checks run when a command is queued, for an immediate error, and again when it is applied.
"""

from collections.abc import Sequence
from types import UnionType
from typing import Annotated, Literal, get_args

from pydantic import Field

from app.errors import InvalidInput
from app.live.commands import (
    AddPerson,
    MovePerson,
    PersonCommand,
    PickCommand,
    RemovePerson,
    SetCandidates,
    SetSafety,
    StartCase,
    ToggleCandidate,
)
from app.live.reach.commands import (
    MoveGoal,
    ReachCommand,
    SetInferenceMode,
    goal_box,
    is_reaching,
)
from app.live.snapshot import WorldSnapshot
from app.live.sorting.commands import (
    AddBlock,
    MoveBlock,
    SetGoal,
    SortingCommand,
    StartTest,
    TableCommand,
    change_table,
)
from app.live.sorting.task_snapshot import table_of
from app.sim.cells.cell import Cell
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.pick.cases import cases_of
from app.sim.sorting.batch import shape_of
from app.sim.sorting.benchmark_tasks import TESTS, SortingTest
from app.sim.sorting.layout import is_sorting, lacks_for_sorting
from app.sim.sorting.state import SIZE_NAMES

Scenario = Literal["pick", "reach", "sorting"]
Command = PickCommand | ReachCommand | SortingCommand
CommandMessage = Annotated[Command, Field(discriminator="tag")]
"""Any command, discriminated by its tag: body of ``POST /v1/worlds/{id}/commands``."""
COMMANDS: dict[Scenario, UnionType] = {
    "pick": PickCommand,
    "reach": ReachCommand,
    "sorting": SortingCommand,
}
"""Commands of each live world."""


def scenario_of(cell: Cell) -> Scenario:
    """Return the scenario that a live world of a cell simulates."""
    if is_reaching(cell):
        return "reach"
    return "sorting" if is_sorting(cell) else "pick"


def check(command: Command, cell: Cell, people: Sequence[int]) -> None:
    """Compare a command with a work cell and the ids of the people in it.

    Raises:
        InvalidInput: No command of this scenario, an unknown name or person, a point outside
            the goal region, or too many people.
    """
    scenario = scenario_of(cell)
    if not isinstance(command, COMMANDS[scenario]):
        tags = [one.model_fields["tag"].default for one in get_args(COMMANDS[scenario])]
        rule = f"is not a command of a {scenario} cell like {cell.name}"
        raise InvalidInput("tag", command.tag, rule, tags)
    _check_people(command, cell, people)
    match command:
        case SetCandidates():
            for index, name in enumerate(command.ids):
                _require(
                    f"ids[{index}]", name, cell.station_ids, "is not a station of this cell"
                )
        case ToggleCandidate():
            _require("id", command.id, cell.station_ids, "is not a station of this cell")
        case StartCase():
            cases = [case.id for case in cases_of(cell)]
            _require("id", command.id, cases, "is not a case study of this cell")
        case SetSafety() if command.use_measured_velocity is not None and scenario != "reach":
            rule = f"needs people who are cylinders: those of {cell.name} are workers"
            raise InvalidInput("use_measured_velocity", command.use_measured_velocity, rule)
        case MoveGoal():
            _check_goal(command.position, cell)
        case StartTest():
            tests = [one.name for one in tests_of(cell)]
            _require("id", command.id, tests, "is not a sorting test that fits this cell")
        case AddBlock() | MoveBlock() | SetGoal():
            _check_table_words(command, cell)


def check_state(command: Command, cell: Cell, snapshot: WorldSnapshot) -> None:
    """Compare a command with blocks, goal and policy of a snapshot.

    Raises:
        InvalidInput: No such block, an occupied place, too many blocks, a goal that the blocks
            cannot meet, or an inference mode that the policy does not have.
    """
    if snapshot.reach is not None and isinstance(command, SetInferenceMode):
        check_inference_mode(command.inference_mode, snapshot.reach.inference_modes)
    if snapshot.sorting is not None and isinstance(command, TableCommand):
        change_table(command, table_of(cell, snapshot.sorting))


def check_inference_mode(name: str, known: Sequence[str]) -> None:
    """Check that a policy has an inference mode.

    Raises:
        InvalidInput: It does not, or there is no policy.
    """
    rule = (
        "is not an inference mode of this policy" if known else "needs a policy: there is none"
    )
    _require("inference_mode", name, known, rule)


def tests_of(cell: Cell) -> tuple[SortingTest, ...]:
    """Return the sorting tests that fit a cell."""
    if not is_sorting(cell) or lacks_for_sorting(cell) is not None:
        return ()
    shape = shape_of(cell)
    return tuple(one for one in TESTS if one.fits(shape))


def _check_people(command: Command, cell: Cell, people: Sequence[int]) -> None:
    if isinstance(command, AddPerson) and len(people) >= MAX_PEOPLE:
        raise InvalidInput("people", len(people) + 1, f"must be at most {MAX_PEOPLE}")
    if isinstance(command, PersonCommand | RemovePerson) and command.person not in people:
        known = [str(one) for one in people]
        rule = "is no person in this cell" if people else "is no person: the cell is empty"
        raise InvalidInput("person", command.person, rule, known)
    if isinstance(command, MovePerson) and is_reaching(cell):
        for name in ("right", "left"):
            if (value := getattr(command, name)) is not None:
                rule = f"needs a person with hands: people of {cell.name} are cylinders"
                raise InvalidInput(name, value, rule)


def _check_goal(position: tuple[float, float, float], cell: Cell) -> None:
    low, high = goal_box(cell)
    for axis, value, least, most in zip("xyz", position, low, high, strict=True):
        if not least - 1e-9 <= value <= most + 1e-9:
            miss = max(least - value, value - most)
            rule = f"must lie in the goal region [{least:g}, {most:g}] m: {miss:.3g} m outside"
            raise InvalidInput(f"position.{axis}", value, rule)


def _check_table_words(command: AddBlock | MoveBlock | SetGoal, cell: Cell) -> None:
    clusters = cell.stations_of("cluster")
    towers = [one.id for one in clusters]
    places = [*(one.id for one in cell.stations_of("clutter")), *towers]
    sizes, no_place = SIZE_NAMES[3], "is not a clutter slot or tower of this cell"
    match command:
        case AddBlock():
            colours = [one.colour or one.id for one in clusters]
            _require("colour", command.colour, colours, "is not a colour of this cell")
            _require("size", command.size, sizes, "is not a size")
            if command.at is not None:
                _require("at", command.at, places, no_place)
        case MoveBlock():
            _require("to", command.to, places, no_place)
        case SetGoal():
            for tower, wanted in command.towers.items():
                _require("towers", tower, towers, "is not a tower of this cell")
                for level, size in enumerate(wanted):
                    _require(f"towers.{tower}[{level}]", size, sizes, "is not a size")


def _require(field: str, word: str, known: Sequence[str], rule: str) -> None:
    if word not in known:
        raise InvalidInput(field, word, rule, known)


def people_after(command: Command, people: tuple[int, ...]) -> tuple[int, ...]:
    """Return the ids of the people in a cell after a valid command, in order."""
    match command:
        case AddPerson():
            free = next(id for id in range(MAX_PEOPLE) if id not in people)
            return tuple(sorted((*people, free)))
        case RemovePerson():
            return tuple(id for id in people if id != command.person)
        case StartCase():
            return (0,)
        case _:
            return people
