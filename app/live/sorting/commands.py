"""Commands to a live sorting cell; see ``app/live/commands.py``.

Blocks, goal and sorting policy change while the robot works, without a reset. Colours and sizes
are words, places are station ids.
"""

from typing import Annotated, Literal

from pydantic import Field

from app.live.commands import (
    ClockCommand,
    LiveCommand,
    LoadingCommand,
    Name,
    PeopleCommand,
    SetPolicy,
    SetSafety,
)
from app.live.sorting.snapshot import Order
from app.live.sorting.table import Block, SortingTable


class AddBlock(LiveCommand):
    """Add a block."""

    tag: Literal["add-block"] = "add-block"
    colour: Name
    """one of the colours of the cell's towers"""
    size: Name
    """small, medium or large"""
    at: Name | None = None
    """free clutter slot, or tower (on its top); null: the first free clutter slot"""


class RemoveBlock(LiveCommand):
    """Remove a block; a goal block without a remaining match is removed as well."""

    tag: Literal["remove-block"] = "remove-block"
    id: Name
    """id of the block"""


class MoveBlock(LiveCommand):
    """Move a block, as a person would."""

    tag: Literal["move-block"] = "move-block"
    id: Name
    """id of the block"""
    to: Name
    """free clutter slot, or tower (on its top)"""


class SetGoal(LiveCommand):
    """Set the goal of all towers; towers that are not named are empty in the goal."""

    tag: Literal["set-goal"] = "set-goal"
    towers: Annotated[
        dict[Name, Annotated[tuple[Name, ...], Field(max_length=64, strict=False)]],
        Field(max_length=5),
    ]
    """sizes from the bottom, by tower"""


class ToggleGoal(LiveCommand):
    """Add a block to the goal tower of its colour (largest at the bottom), or remove it."""

    tag: Literal["toggle-goal"] = "toggle-goal"
    id: Name
    """id of a block; or a kind such as `red-large`: one more of it, none after the last"""


class StartTest(LiveCommand):
    """Start one of the six sorting tests (docs/method.md 1.5)."""

    tag: Literal["start-test"] = "start-test"
    id: Name
    """test-1 to test-6"""


class SetSortingPolicy(LoadingCommand):
    """Replace the policy that values the moves; the loaded object is ``SortingValues``."""

    tag: Literal["set-sorting-policy"] = "set-sorting-policy"
    checkpoint: Name | None
    """SHA-256 or alias; null: the exact planner decides alone"""


class SetOrder(LiveCommand):
    """Choose among moves with about the same expected attempts."""

    tag: Literal["set-order"] = "set-order"
    order: Order
    """critic: by the values of the pick policy; planner: the first of the sorting policy or
    planner; nearest: the block nearest to the tool"""


PlanningCommand = SetSortingPolicy | SetOrder
TableCommand = AddBlock | RemoveBlock | MoveBlock | SetGoal | ToggleGoal
SortingCommand = (
    PeopleCommand
    | ClockCommand
    | SetPolicy
    | SetSafety
    | TableCommand
    | StartTest
    | PlanningCommand
)


def change_table(command: TableCommand, table: SortingTable) -> Block | None:
    """Change blocks or goal; return a removed block that the goal loses with it.

    Raises:
        InvalidInput: The command does not fit the table; nothing has changed.
    """
    match command:
        case AddBlock():
            table.add(command.colour, command.size, command.at)
        case MoveBlock():
            table.move(command.id, command.to)
        case SetGoal():
            table.set_goal(command.towers)
        case ToggleGoal():
            table.toggle_goal(command.id)
        case RemoveBlock():
            before = table.goal.copy()
            gone = table.remove(command.id)
            return gone if (table.goal != before).any() else None
    return None
