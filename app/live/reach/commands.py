"""Commands to a live reach cell; see ``app/live/commands.py``."""

from typing import Annotated, Literal

from pydantic import Field

from app.live.commands import (
    ClockCommand,
    CylinderCommand,
    LiveCommand,
    Name,
    SetPolicy,
    SetSafety,
)
from app.live.reach.snapshot import GoalMode
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec

MAX_WALKING_SPEED = 2.0
"""Maximum walking speed that a visitor can set [m/s]."""


class MoveGoal(LiveCommand):
    """Move the goal while the robot moves."""

    tag: Literal["move-goal"] = "move-goal"
    position: Annotated[tuple[float, float, float], Field(strict=False)]
    """target of the tool centre point, inside the cell's goal region [m]"""


class NewGoal(LiveCommand):
    """Draw another goal at random."""

    tag: Literal["new-goal"] = "new-goal"


class SetGoalMode(LiveCommand):
    """Set whether a reached goal is replaced (`jump`) or stays until dragged (`follow`)."""

    tag: Literal["set-goal-mode"] = "set-goal-mode"
    mode: GoalMode


class SetInferenceMode(LiveCommand):
    """Set how the policy is evaluated for goals and people outside its training set."""

    tag: Literal["set-inference-mode"] = "set-inference-mode"
    inference_mode: Name
    """one of the world's `reach.inference_modes`"""


class SetWalkingSpeed(LiveCommand):
    """Set one walking speed for all people."""

    tag: Literal["set-walking-speed"] = "set-walking-speed"
    speed: Annotated[float, Field(ge=0.0, le=MAX_WALKING_SPEED)] | None
    """walking speed [m/s]; null: variable, as in training"""


ReachOnly = MoveGoal | NewGoal | SetGoalMode | SetInferenceMode | SetWalkingSpeed
ReachCommand = CylinderCommand | ClockCommand | SetPolicy | SetSafety | ReachOnly


def is_reaching(cell: Cell) -> bool:
    """Return whether a cell has a goal region and no stations."""
    return cell.goal_region is not None and not cell.stations


def lacks_for_reaching(cell: Cell) -> str | None:
    """Return what a live reach cell still needs, as a sentence part; None if nothing."""
    if cell.goal_region is None:
        return "needs a goal_region"
    if cell.workers:
        return "needs people who are walking cylinders, not workers"
    return None


def goal_box(cell: Cell) -> tuple[Vec, Vec]:
    """Return the lower and upper corner of a cell's goal region [m], shape (3,) each."""
    assert cell.goal_region is not None
    return cell.goal_region.box()
