"""Sorting moves that the exact planner expects to take about as many attempts as its own.

Among them the planner has no preference, so that motion, risk and time may decide.

Source: docs/method.md 3.1.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from app.sim.sorting.decision import rank_by_planner
from app.sim.sorting.planner import Plan, solve
from app.sim.sorting.state import Move, SortingShape, SortingState

MARGIN = 0.25
"""Attempts by which a move may be worse than the planner's own: about two seconds of motion."""
MAX_MARGIN = 10.0
"""Largest margin [attempts]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NearOptimalMoves:
    """Plan of a state, and the moves near it."""

    plan: Plan
    """The planner's plan."""
    moves: tuple[Move, ...]
    """Moves within the margin, the planner's own first; empty at the goal."""
    attempts: tuple[float, ...]
    """Expected attempts to the goal with each of them first."""

    def only(self, kept: Sequence[int]) -> Self:
        """Return the moves of some indices."""
        return replace(
            self,
            moves=tuple(self.moves[i] for i in kept),
            attempts=tuple(self.attempts[i] for i in kept),
        )

    def of(self, pick: int) -> Self:
        """Return the moves that pick from one position."""
        return self.only([i for i, move in enumerate(self.moves) if move.pick == pick])


def near_optimal_moves(
    state: SortingState, shape: SortingShape, margin: float = MARGIN
) -> NearOptimalMoves:
    """Return moves of shortest plans whose expected attempts are within a margin of the plan's.

    In tasks too large for the attempts of every move it is the planner's own alone. States and
    errors are those of :func:`~app.sim.sorting.planner.solve`.

    Args:
        margin: Margin [attempts].
    """
    plan = solve(state, shape)
    if plan.best is None:
        return NearOptimalMoves(plan=plan, moves=(), attempts=())
    own, *others = rank_by_planner(state, shape, plan)
    near = [
        (one.move, -one.value)
        for one in others
        if one.fewest and one.value is not None and -one.value <= plan.attempts + margin
    ]
    return NearOptimalMoves(
        plan=plan,
        moves=(own.move, *(move for move, _ in near)),
        attempts=(plan.attempts, *(attempts for _, attempts in near)),
    )
