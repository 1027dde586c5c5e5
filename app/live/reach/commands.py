"""What may be done to a live reach cell, as data (see ``commands.py``)."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from app.errors import InvalidInput, interval
from app.live.reach.snapshot import GOAL_MODES, GoalMode
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec

if TYPE_CHECKING:
    from app.live.reach.interfaces import ReachPilot

WALK_SPEEDS = (0.0, 2.0)
"""Least and greatest speed that a visitor may give the people [m/s]."""
AXES = ("x", "y", "z")


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveGoal:
    """Put the goal elsewhere, while the robot moves."""

    tag: ClassVar[str] = "move-goal"
    position: tuple[float, float, float]
    """Where the tcp shall be, inside the cell's goal region [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NewGoal:
    """Draw another goal."""

    tag: ClassVar[str] = "new-goal"


@dataclass(frozen=True, slots=True, kw_only=True)
class SetGoalMode:
    """Say where the goal is next once it is reached."""

    tag: ClassVar[str] = "set-goal-mode"
    mode: GoalMode
    """``jump`` to another one, or stay and ``follow`` whoever drags it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetSafety:
    """Let the robot obey the safety layer, or see what happens without."""

    tag: ClassVar[str] = "set-safety"
    on: bool
    """Whether it does."""
    measured: bool | None = None
    """Whether the layer goes by the velocities that people are seen with; None as before."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetWay:
    """Say how the policy is asked for goals and people it was not trained on."""

    tag: ClassVar[str] = "set-way"
    way: str
    """One of the policy's ways."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetWalk:
    """Give all people one walking speed."""

    tag: ClassVar[str] = "set-walk"
    speed: float | None
    """Speed [m/s], in WALK_SPEEDS; None as METHOD 2.1 says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPilot:
    """Let another reach policy move the robot.

    Over HTTP this is ``set-policy`` with a checkpoint's id or alias; the service loads it.
    """

    tag: ClassVar[str] = "set-policy"
    pilot: "ReachPilot | None"
    """What moves from now on; None goes straight to the goal's posture."""


ReachCommand = MoveGoal | NewGoal | SetGoalMode | SetSafety | SetWay | SetWalk | SetPilot

REACH_COMMANDS: tuple[type[ReachCommand], ...] = (
    MoveGoal,
    NewGoal,
    SetGoalMode,
    SetSafety,
    SetWay,
    SetWalk,
    SetPilot,
)


def is_reaching(cell: Cell) -> bool:
    """Whether a cell has goals to reach, and nothing to pick or sort."""
    return cell.goal_region is not None and not cell.stations


def lacks_for_reaching(cell: Cell) -> str | None:
    """Say what a reach cell lacks to be shown live; None where nothing."""
    if cell.goal_region is None:
        return "needs a goal_region"
    if cell.workers:
        return "needs people who are walking cylinders, not workers"
    return None


def check_reaching(command: ReachCommand, cell: Cell) -> None:
    """Refuse a command that no reach cell, or not this one, could carry out.

    Raises:
        InvalidInput: Nothing is reached for here, or a value out of its range.
    """
    if not is_reaching(cell):
        rule = f"needs a cell with goals to reach: {cell.name} is none"
        raise InvalidInput("tag", command.tag, rule)
    match command:
        case MoveGoal():
            _check_goal(command.position, cell)
        case SetGoalMode() if command.mode not in GOAL_MODES:
            raise InvalidInput("mode", command.mode, "is no mode of the goal", GOAL_MODES)
        case SetWalk() if command.speed is not None:
            low, high = WALK_SPEEDS
            if not low <= command.speed <= high:
                raise InvalidInput(
                    "speed", command.speed, f"must lie in {interval(low, high)} m/s"
                )
        case _:
            pass


def _check_goal(position: tuple[float, float, float], cell: Cell) -> None:
    assert cell.goal_region is not None
    low, high = goal_box(cell)
    for axis, value, least, most in zip(AXES, position, low, high, strict=True):
        field = f"position.{axis}"
        if not math.isfinite(value):
            raise InvalidInput(field, value, "must be finite")
        if not least - 1e-9 <= value <= most + 1e-9:
            miss = max(least - value, value - most)
            rule = f"must lie in the goal region [{least:g}, {most:g}] m: {miss:.3g} m outside"
            raise InvalidInput(field, value, rule)


def goal_box(cell: Cell) -> tuple[Vec, Vec]:
    """Return the corners of a cell's goal region [m], shape (3,) each."""
    assert cell.goal_region is not None
    middle, half = np.array(cell.goal_region.center), 0.5 * np.array(cell.goal_region.size)
    return middle - half, middle + half
