"""Decision about the next sorting move, by a policy or the exact planner (docs/method.md 1).

The policy selects the valid move of greatest Q. The planner decides without a policy, for
shapes and goals outside the policy's training, and if :mod:`app.sim.sorting.progress_monitor`
detects a loop or stall. The result names decision maker and reason, and ranks every valid move.
"""

import time

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.sorting.batch import apply, observe, valid_moves
from app.sim.sorting.decision_types import OutsideGoal, RankedMove, SortingDecision, Why
from app.sim.sorting.kernels.action_costs import attempts_by_move
from app.sim.sorting.kernels.shortest_paths import most_states
from app.sim.sorting.planner import Plan, planner_arguments, solve
from app.sim.sorting.progress_monitor import (
    ProgressMonitor,
    expect_state,
    observe_transition,
    state_key,
)
from app.sim.sorting.sorting_values import SortingValues
from app.sim.sorting.state import NULL, Codes, Move, SortingShape, SortingState, empty_state

MAX_PLANNED = 20_000
"""Largest number of states for which the planner values every move, in about 1 ms."""
MAX_AT_ONCE = 4_000
"""Largest number of states of a task with immediate decisions; ``sorting-e1`` has fewer."""


def decide(
    policy: SortingValues | None,
    state: SortingState,
    shape: SortingShape,
    monitor: ProgressMonitor | None = None,
    *,
    ask_planner: bool = False,
) -> SortingDecision:
    """Choose the next move.

    Args:
        policy: Policy; None: the planner decides.
        state: Present state, valid by ``state.check_state``.
        shape: Shape of the task.
        monitor: ``monitor`` of the previous decision in the same task; None for the first one.
        ask_planner: Whether the planner decides in any case.
    """
    begin = time.perf_counter()
    plan = solve(state, shape)
    outside = outside_goal(state.goal, shape)
    noted: ProgressMonitor | None = None
    ranked: tuple[RankedMove, ...] = ()
    trusted, why = _trusted(policy, shape, plan, outside, ask_planner)
    if trusted is not None:
        noted = observe_transition(monitor, state_key(state), plan.attempts, trusted.checkpoint)
        if noted.planner_fallback is not None:
            trusted, why = None, noted.planner_fallback
    if plan.best is not None:
        ranked = (
            rank_by_planner(state, shape, plan)
            if trusted is None
            else rank_by_policy(trusted, state, shape, plan)
        )
    if noted is not None:
        expected = state_key(apply(state, shape, ranked[0].move))
        risk = failure_of(state, ranked[0].move)
        noted = expect_state(noted, expected, can_fail=risk > 0.0)
    return SortingDecision(
        solved=plan.best is None,
        action=ranked[0].action if ranked else None,
        move=ranked[0].move if ranked else None,
        by="planner" if trusted is None else "policy",
        why=why,
        ranked=ranked,
        fewest_moves=plan.moves,
        expected_attempts=plan.attempts,
        outside=outside,
        checkpoint=None if policy is None else policy.checkpoint,
        monitor=noted,
        elapsed_ms=1e3 * (time.perf_counter() - begin),
    )


def outside_goal(goal: Codes, shape: SortingShape) -> tuple[OutsideGoal, ...]:
    """Return the objects of a goal, shape (C, K), that no goal of the training contains."""
    found = []
    for tower, level in np.argwhere(goal != NULL).tolist():
        code = int(goal[tower, level])
        below = int(goal[tower, level - 1]) if level else NULL
        if shape.colour_of(code) != tower:
            rule = "must be of the tower's own colour"
        elif below != NULL and shape.size_of(code) > shape.size_of(below):
            rule = "must not be larger than the object below it"
        else:
            continue
        found.append(OutsideGoal(tower=tower, level=level, rule=rule))
    return tuple(found)


def failure_of(state: SortingState, move: Move) -> float:
    """Return the probability that the pick of a move fails; picks from towers never do."""
    return float(state.fail[move.pick]) if move.pick < len(state.fail) else 0.0


def rank_by_policy(
    policy: SortingValues, state: SortingState, shape: SortingShape, plan: Plan
) -> tuple[RankedMove, ...]:
    """Return the valid moves by the policy's Q, the greatest first."""
    q = policy.values(observe(state)[None])[0]
    values = {action: float(q[action]) for action in valid_actions(state, shape)}
    order = sorted(values, key=lambda action: (-values[action], action))
    return _ranked(order, values, shape, plan)


def rank_by_planner(
    state: SortingState, shape: SortingShape, plan: Plan
) -> tuple[RankedMove, ...]:
    """Return the valid moves by the attempts expected if they come first, the plan's own first.

    After any other move the planner's rules are followed, without rollouts. Where even that
    would take too long there are no values: moves that begin a plan with the fewest moves
    precede the others.
    """
    valid = valid_actions(state, shape)
    attempts = attempts_by_action(state, shape, valid)
    if attempts is None:
        fewest = frozenset(plan.first)
        order = sorted(valid, key=lambda one: (one != plan.best, one not in fewest, one))
        return _ranked(order, {}, shape, plan)
    values = {one: -float(value) for one, value in zip(valid, attempts, strict=True)}
    assert plan.best is not None
    values[plan.best] = -plan.attempts
    order = sorted(valid, key=lambda one: (one != plan.best, -values[one], one))
    return _ranked(order, values, shape, plan)


def attempts_by_action(
    state: SortingState, shape: SortingShape, actions: list[int]
) -> Vec | None:
    """Return the attempts that the planner expects to the goal, by the move that comes first.

    Args:
        state: A state that ``check_state`` accepts.
        actions: Numbers of n valid moves.

    Returns:
        Expected attempts, shape (n,); None where finding them would take too long.
    """
    moves = [(move.pick, move.place) for move in map(shape.move_of, actions)]
    pairs, attempts = np.array(moves, dtype=np.int64).reshape(-1, 2), np.zeros(len(actions))
    objects, task, work = planner_arguments(state, shape)
    written = attempts_by_move(objects, task, pairs, MAX_PLANNED, work, attempts)
    return attempts if written else None


def is_slow_decision(shape: SortingShape) -> bool:
    """Return whether a decision may need more than ``MAX_AT_ONCE`` states of the planner."""
    return most_states(shape.n_slots, shape.n_colours) > MAX_AT_ONCE


def valid_actions(state: SortingState, shape: SortingShape) -> list[int]:
    """Return the numbers of the moves that change the state."""
    found: list[int] = np.flatnonzero(valid_moves(state, shape)).tolist()
    return found


def warm_up(policy: SortingValues | None = None) -> None:
    """Compile the kernels of decisions by one decision of a policy."""
    shape = SortingShape(n_slots=2, n_colours=1) if policy is None else policy.shape
    state = empty_state(shape)
    state.clutter[0] = state.goal[0, 0] = shape.code(0, 0)
    decide(policy, state, shape)


def _trusted(
    policy: SortingValues | None,
    shape: SortingShape,
    plan: Plan,
    outside: tuple[OutsideGoal, ...],
    ask_planner: bool,
) -> tuple[SortingValues | None, Why]:
    """Return the policy if it may decide, else None, and why."""
    if plan.best is None:
        return None, "solved"
    if ask_planner:
        return None, "asked"
    if policy is None:
        return None, "no-policy"
    if policy.shape != shape:
        return None, "other-shape"
    if outside:
        return None, "untrained-goal"
    return policy, "policy"


def _ranked(
    order: list[int], values: dict[int, float], shape: SortingShape, plan: Plan
) -> tuple[RankedMove, ...]:
    fewest = frozenset(plan.first)
    return tuple(
        RankedMove(
            action=action,
            move=shape.move_of(action),
            value=values.get(action),
            fewest=action in fewest,
        )
        for action in order
    )
