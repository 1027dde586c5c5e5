"""What may be done to the sorting task of a live cell, as data (see ``commands.py``).

Blocks, goal and sorter change while the robot works, without a reset: the next decision takes
them as they are. Colours and sizes are words, places are ids of stations.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from app.errors import InvalidInput
from app.live.sorting.table import Block, SortingTable
from app.sim.cells.cell import Cell
from app.sim.sorting.benchmark_tasks import TESTS
from app.sim.sorting.layout import is_sorting
from app.sim.sorting.sorting_values import SortingValues
from app.sim.sorting.state import SIZE_NAMES


@dataclass(frozen=True, slots=True, kw_only=True)
class AddObject:
    """Put another block into a sorting cell, while the robot works."""

    tag: ClassVar[str] = "add-object"
    colour: str
    """One of the colours of the cell's towers."""
    size: str
    """``small``, ``medium`` or ``large``."""
    at: str | None = None
    """Id of a free clutter cell, or of a tower (on its top); None takes the first free cell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RemoveObject:
    """Take a block out; what lies on it comes down. A goal that nothing else meets shrinks."""

    tag: ClassVar[str] = "remove-object"
    id: str
    """Id of the block."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveObject:
    """Put a block elsewhere, as a person would."""

    tag: ClassVar[str] = "move-object"
    id: str
    """Id of the block."""
    to: str
    """Id of a free clutter cell, or of a tower (on its top)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetGoal:
    """Say what the towers shall be; towers that are not named shall be empty."""

    tag: ClassVar[str] = "set-goal"
    towers: Mapping[str, tuple[str, ...]]
    """Sizes from the bottom by tower; each tower takes its own colour."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ToggleGoal:
    """Put a block into the goal or take it out: its colour's tower, largest at the bottom."""

    tag: ClassVar[str] = "toggle-goal"
    id: str
    """Id of a block; or a kind such as ``red-large``: one more of it, none after the last."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StartTest:
    """Start one of the source's six sorting tests (METHOD 1.5), drawn from the world's seed."""

    tag: ClassVar[str] = "start-test"
    id: str
    """``test-1`` to ``test-6``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetSorter:
    """Let another sorter choose the moves.

    Over HTTP the command carries the checkpoint's id or alias; the service loads it and queues
    this object.
    """

    tag: ClassVar[str] = "set-sorter"
    sorter: SortingValues | None
    """What values the moves from now on; None: the exact planner alone."""


SortingCommand = (
    AddObject | RemoveObject | MoveObject | SetGoal | ToggleGoal | StartTest | SetSorter
)

SORTING_COMMANDS: tuple[type[SortingCommand], ...] = (
    AddObject,
    RemoveObject,
    MoveObject,
    SetGoal,
    ToggleGoal,
    StartTest,
    SetSorter,
)


def check_sorting(command: SortingCommand, cell: Cell) -> None:
    """Refuse a command whose words the cell does not know, whatever lies on its table.

    Raises:
        InvalidInput: Nothing can be sorted here, or a word is not known.
    """
    if not is_sorting(cell):
        raise InvalidInput("tag", command.tag, f"needs a sorting cell: {cell.name} is none")
    colours = tuple(one.colour or one.id for one in cell.stations_of("cluster"))
    towers = tuple(one.id for one in cell.stations_of("cluster"))
    sizes = SIZE_NAMES[3]
    places = (*(one.id for one in cell.stations_of("clutter")), *towers)
    match command:
        case AddObject():
            _require("colour", command.colour, colours, "is no colour of this cell")
            _require("size", command.size, sizes, "is no size")
            if command.at is not None:
                _require("at", command.at, places, "is no clutter cell or tower of this cell")
        case MoveObject():
            _require("to", command.to, places, "is no clutter cell or tower of this cell")
        case SetGoal():
            for tower, wanted in command.towers.items():
                _require("towers", tower, towers, "is no tower of this cell")
                for level, size in enumerate(wanted):
                    _require(f"towers.{tower}[{level}]", size, sizes, "is no size")
        case StartTest():
            names = tuple(one.name for one in TESTS)
            if command.id not in names:
                raise InvalidInput("id", command.id, "is no sorting test", names)
        case _:
            pass


def _require(field: str, word: str, words: tuple[str, ...], rule: str) -> None:
    if word not in words:
        raise InvalidInput(field, word, rule, words)


def carry_out(command: object, table: SortingTable) -> Block | None:
    """Change blocks or goal as a command says; return a block that the goal lost with it.

    Raises:
        InvalidInput: It does not fit what is on the table; nothing has changed.
    """
    match command:
        case AddObject():
            table.add(command.colour, command.size, command.at)
        case MoveObject():
            table.move(command.id, command.to)
        case SetGoal():
            table.set_goal(command.towers)
        case ToggleGoal():
            table.toggle_goal(command.id)
        case RemoveObject():
            before = table.goal.copy()
            gone = table.remove(command.id)
            return gone if (table.goal != before).any() else None
        case _:
            pass
    return None
