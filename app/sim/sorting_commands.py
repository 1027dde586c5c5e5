"""What may be done to the sorting task of a live cell, as data (see ``commands.py``).

Blocks, goal and sorter change while the robot works, without a reset: the next decision takes
them as they are. Colours and sizes are words, places are ids of stations.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from app.sim.ports import SortingValues


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
