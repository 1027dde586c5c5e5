"""Data of a decision about the next sorting move (docs/method.md 1)."""

from dataclasses import dataclass
from typing import Literal

from app.sim.sorting.progress_monitor import ProgressMonitor
from app.sim.sorting.state import Move

By = Literal["policy", "planner"]
"""Decision maker."""
Why = Literal[
    "policy",
    "solved",
    "asked",
    "no-policy",
    "other-shape",
    "untrained-goal",
    "repeated",
    "attempts-exceeded",
]
"""Reason for the decision maker; :data:`REASONS` holds the sentences."""
REASONS: dict[Why, str] = {
    "policy": "The policy's values choose.",
    "solved": "The goal is reached: there is nothing to move.",
    "asked": "The exact planner was asked for.",
    "no-policy": "No policy decides here, so the exact planner does.",
    "other-shape": "The policy was trained for another number of slots, colours or sizes.",
    "untrained-goal": "The policy was not trained for a goal like this one.",
    "repeated": "A state came back that no failed pick and no person explains.",
    "attempts-exceeded": "It took 1.5 times the attempts that were expected.",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RankedMove:
    """One valid move and its value."""

    action: int
    """Number of the action."""
    move: Move
    """The move."""
    value: float | None
    """Policy: Q, expected discounted return. Planner: minus the expected attempts to the goal
    with this move first; None if the task is too large."""
    fewest: bool
    """Whether a plan of the fewest moves begins with it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OutsideGoal:
    """One object of a goal outside the training range."""

    tower: int
    """Tower of the object in the goal."""
    level: int
    """Level there, 0 the lowest."""
    rule: str
    """Rule of training goals, as part of a sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingDecision:
    """The next move and its explanation."""

    solved: bool
    """Whether the goal is reached; then there are no moves."""
    action: int | None
    """Number of the selected move."""
    move: Move | None
    """The selected move."""
    by: By
    """Decision maker."""
    why: Why
    """Reason for the decision maker."""
    ranked: tuple[RankedMove, ...]
    """Valid moves by descending value; the planner's own choice is always first."""
    fewest_moves: int
    """Least number of moves to the goal without failed picks."""
    expected_attempts: float
    """Expected attempts of the exact planner, with failed picks."""
    outside: tuple[OutsideGoal, ...]
    """Objects of the goal outside the training range."""
    checkpoint: str | None
    """SHA-256 of the queried policy; None without one."""
    monitor: ProgressMonitor | None
    """Record for the next decision in this task; None if not needed."""
    elapsed_ms: float
    """Time the decision took [ms]."""
