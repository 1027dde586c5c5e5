"""What a decision about the next sorting move says (METHOD 1).

``sorting_decision.decide`` makes it, of a policy's values (``ports.SortingValues``) or of the
exact planner's plan.
"""

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
"""Why it was the policy, or the planner; :data:`REASONS` says it in a sentence."""
REASONS: dict[Why, str] = {
    "policy": "The policy's values choose.",
    "solved": "The goal is reached: there is nothing to move.",
    "asked": "The exact planner was asked for.",
    "no-policy": "No policy decides here, so the exact planner does.",
    "other-shape": "The policy was trained for another number of cells, colours or sizes.",
    "untrained-goal": "The policy was not trained for a goal like this one.",
    "repeated": "A state came back that no failed pick and no person explains.",
    "attempts-exceeded": "It took 1.5 times the attempts that were expected.",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RankedMove:
    """One valid move and what it is worth."""

    action: int
    """Its number, as ``SortingShape.move_of`` takes it."""
    move: Move
    """From where to where."""
    value: float | None
    """Policy: Q, expected discounted reward. Planner: minus the attempts expected to the goal
    if this move comes first; None where the task is too large to say so for every move."""
    fewest: bool
    """Whether a plan of the fewest moves begins with it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OutsideGoal:
    """One object of a goal such as no policy was trained for."""

    tower: int
    """Tower it is asked for on."""
    level: int
    """Level there, 0 the lowest."""
    rule: str
    """What goals met in training keep to, as a sentence part."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingDecision:
    """The next move and all that explains it."""

    solved: bool
    """Whether the goal is reached: then there is no move, nor anything ranked."""
    action: int | None
    """The move chosen, by its number."""
    move: Move | None
    """The move chosen."""
    by: By
    """Decision maker."""
    why: Why
    """Why it was this one."""
    ranked: tuple[RankedMove, ...]
    """All valid moves: by value, the best first; the planner's own choice is always first."""
    fewest_moves: int
    """Moves to the goal at least, if no pick fails."""
    expected_attempts: float
    """Attempts to the goal to be expected of the exact planner, failed picks included."""
    outside: tuple[OutsideGoal, ...]
    """What of the goal lies outside what policies are trained for."""
    checkpoint: str | None
    """SHA-256 of the policy that was asked; None without one."""
    monitor: ProgressMonitor | None
    """Record to hand back with the next state of this task; None when none is needed."""
    elapsed_ms: float
    """Time the decision took [ms]."""
