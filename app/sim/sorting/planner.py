"""The exact planner of the sorting task: fewest moves, all best next moves, a plan of low risk.

A failed pick leaves the state as it is, so an expected pick costs ``1 / (1 - p)`` attempts, and
the fewest moves do not depend on failures: they are shortest paths over the progress of the
towers (:mod:`app.sim.sorting.kernels.shortest_paths`). Fewest moves are exact. Among plans
with the
fewest moves the planner keeps expected attempts low by rules
(:mod:`app.sim.sorting.kernels.planner`); a plan with more moves and fewer expected attempts is
not looked for.

Outside its model: localisation failures (another object is moved than the one meant), and
whatever people do. Both only change the state, and from any state it plans again.

Source: METHOD 1.2. Deviates: the thesis has no planner; its baseline is learned.
"""

from dataclasses import dataclass

import numpy as np

from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.sorting.kernels.planner import Objects, PlannerWork, Task, new_work, plan_state
from app.sim.sorting.state import Move, SortingShape, SortingState, missing


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What the planner knows of a state."""

    moves: int
    """Fewest moves to the goal."""
    attempts: float
    """Expected attempts of the plan it follows, ``sum 1 / (1 - p)`` over its picks."""
    first: tuple[int, ...]
    """Every action with which some plan of the fewest moves begins, ascending."""
    best: int | None
    """The one of them it takes, None where the goal is reached."""


def _solve(state: SortingState, shape: SortingShape) -> tuple[Plan, PlannerWork]:
    """Return what is known of a state, and the work space that holds the plan."""
    work = new_work(shape.n_cells, shape.n_colours, shape.n_sizes)
    heights = np.count_nonzero(state.towers, axis=1)
    task = Task(state.goal, np.count_nonzero(state.goal, axis=1), state.fail)
    moves, attempts = plan_state(Objects(state.clutter, state.towers, heights), task, work)
    if moves < 0:
        raise _cannot_be_met(state, shape)
    best = int(work.actions[0])
    plan = Plan(
        moves=moves,
        attempts=attempts,
        first=tuple(np.flatnonzero(work.first).tolist()),
        best=best if best >= 0 else None,
    )
    return plan, work


def _cannot_be_met(state: SortingState, shape: SortingShape) -> InvalidInput:
    """Return why there is no plan."""
    lack = missing(state, shape)
    if not lack.any():
        return InvalidInput("objects", state.n_objects, f"must be at most {shape.n_cells}")
    codes = np.flatnonzero(lack).tolist()
    return InvalidInput("goal", codes, "must be met by the objects: these codes are missing")


def solve(state: SortingState, shape: SortingShape) -> Plan:
    """Plan from a state.

    Args:
        state: A state that ``check_state`` accepts.
        shape: Its shape.

    Raises:
        InvalidInput: Objects that the goal asks for are missing, or there are too many.
    """
    return _solve(state, shape)[0]


def follow(state: SortingState, shape: SortingShape) -> list[Move]:
    """Return the whole plan from a state, as if no pick failed.

    Args:
        state: A state that ``check_state`` accepts.
        shape: Its shape.

    Raises:
        InvalidInput: Objects that the goal asks for are missing, or there are too many.
    """
    plan, work = _solve(state, shape)
    return [shape.move_of(action) for action in work.actions[: plan.moves].tolist()]


def attempts_of(moves: list[Move], fail: Vec) -> float:
    """Return the expected attempts of a plan.

    Args:
        moves: The plan.
        fail: Failure probabilities of the clutter cells, shape (K,); other picks do not fail.
    """
    risks = [fail[move.pick] if move.pick < len(fail) else 0.0 for move in moves]
    return float(sum(1.0 / (1.0 - risk) for risk in risks))
