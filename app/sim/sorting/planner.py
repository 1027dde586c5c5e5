"""Exact planner of the sorting task: fewest moves, with few expected attempts.

A failed pick does not change the state, so a pick costs ``1 / (1 - p)`` attempts on average and
the fewest moves, shortest paths over the progress of the towers
(:mod:`app.sim.sorting.kernels.shortest_paths`), do not depend on failures. Among plans with the
fewest moves, rules (:mod:`app.sim.sorting.kernels.planner`) select one with few expected
attempts. Plans with more moves and fewer attempts are not considered.

Localisation failures and people are not modelled; the planner replans from the changed state.

Source: docs/method.md 1.2. Deviates: the thesis has no planner; its baseline is learned.
"""

from dataclasses import dataclass

import numpy as np

from app.sim.sorting.kernels.planner import Objects, PlannerWork, Task, new_work, plan_state
from app.sim.sorting.state import Move, SortingShape, SortingState, check_state


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Plan of a state."""

    moves: int
    """Fewest moves to the goal."""
    attempts: float
    """Expected attempts of the plan it follows, ``sum 1 / (1 - p)`` over its picks."""
    first: tuple[int, ...]
    """First actions of all plans with the fewest moves, ascending."""
    best: int | None
    """First action of the selected plan; None at the goal."""


def planner_arguments(
    state: SortingState, shape: SortingShape
) -> tuple[Objects, Task, PlannerWork]:
    """Return a state as the planner's kernels take it, and their work space."""
    return (
        Objects(state.clutter.copy(), state.towers.copy(), state.heights),
        Task(state.goal, np.count_nonzero(state.goal, axis=1), state.fail),
        new_work(shape.n_slots, shape.n_colours, shape.n_sizes),
    )


def _solve(state: SortingState, shape: SortingShape) -> tuple[Plan, PlannerWork]:
    """Return the plan of a state, and the work space that holds it."""
    objects, task, work = planner_arguments(state, shape)
    moves, attempts = plan_state(objects, task, work)
    if moves < 0:
        check_state(state, shape)
    assert moves >= 0  # every valid state has a plan
    best = int(work.actions[0])
    plan = Plan(
        moves=moves,
        attempts=attempts,
        first=tuple(np.flatnonzero(work.first).tolist()),
        best=best if best >= 0 else None,
    )
    return plan, work


def solve(state: SortingState, shape: SortingShape) -> Plan:
    """Plan from a state that ``check_state`` accepts.

    Raises:
        InvalidInput: Objects that the goal asks for are missing, or there are too many.
    """
    return _solve(state, shape)[0]


def follow(state: SortingState, shape: SortingShape) -> list[Move]:
    """Return the moves of :func:`solve`'s plan, as if no pick failed."""
    plan, work = _solve(state, shape)
    return [shape.move_of(action) for action in work.actions[: plan.moves].tolist()]
