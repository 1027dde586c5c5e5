import dataclasses

import numpy as np
import pytest

from app.sim.sorting.batch import apply, valid_moves
from app.sim.sorting.progress_monitor import (
    MAX_SEEN,
    ProgressMonitor,
    expect_state,
    observe_transition,
    state_key,
)
from app.sim.sorting.state import Move, SortingShape, SortingState, empty_state

SHAPE = SortingShape(n_slots=4, n_colours=2)
POLICY = "a" * 64


def start() -> SortingState:
    """One small red object in the risky cell 0; it shall go to the red tower."""
    state = empty_state(SHAPE)
    state.clutter[0] = state.goal[0, 0] = SHAPE.code(0, 0)
    state.fail[0] = 0.4
    return state


def seen(
    monitor: ProgressMonitor | None, state: SortingState, attempts: float = 10.0
) -> ProgressMonitor:
    return observe_transition(monitor, state_key(state), attempts, POLICY)


def after_move(monitor: ProgressMonitor, state: SortingState, move: Move) -> ProgressMonitor:
    fail = state.fail[move.pick] if move.pick < SHAPE.n_slots else 0.0
    return expect_state(
        monitor, state_key(apply(state, SHAPE, move)), can_fail=bool(fail > 0.0)
    )


def test_record_begins_with_the_state_and_one_and_a_half_times_the_attempts() -> None:
    monitor = seen(None, start(), attempts=4.0)
    assert monitor.seen == (state_key(start()),)
    assert (monitor.attempts, monitor.budget, monitor.planner_fallback) == (0, 6.0, None)


def test_failed_pick_explains_that_the_state_stayed() -> None:
    monitor = after_move(seen(None, start()), start(), Move(0, 4))
    for attempt in range(1, 5):
        monitor = after_move(seen(monitor, start()), start(), Move(0, 4))
        assert (monitor.planner_fallback, monitor.attempts) == (None, attempt)


def test_state_that_stayed_though_the_pick_cannot_fail_hands_over() -> None:
    state = apply(start(), SHAPE, Move(0, 5))
    monitor = after_move(seen(None, state), state, Move(5, 1))
    assert seen(monitor, state).planner_fallback == "repeated"


def test_state_that_comes_back_by_the_moves_alone_hands_over() -> None:
    first = start()
    second = apply(first, SHAPE, Move(0, 5))
    monitor = after_move(seen(None, first), first, Move(0, 5))
    monitor = after_move(seen(monitor, second), second, Move(5, 0))
    assert seen(monitor, first).planner_fallback == "repeated"


def test_record_is_reset_when_a_person_interferes() -> None:
    monitor = after_move(seen(None, start()), start(), Move(0, 4))
    moved = apply(apply(start(), SHAPE, Move(0, 5)), SHAPE, Move(5, 3))
    again = seen(monitor, moved, attempts=2.0)
    assert again == seen(None, moved, attempts=2.0)


@pytest.mark.parametrize("part", ["goal", "fail"])
def test_record_is_reset_when_goal_or_failure_map_change(part: str) -> None:
    monitor = after_move(seen(None, start()), start(), Move(0, 4))
    other = dataclasses.replace(start(), **{part: getattr(start(), part).copy()})
    getattr(other, part).flat[1] = 0.2 if part == "fail" else SHAPE.code(0, 0)
    assert seen(monitor, other).seen == (state_key(other),)


def test_record_is_reset_for_another_policy() -> None:
    monitor = after_move(seen(None, start()), start(), Move(0, 4))
    assert observe_transition(monitor, state_key(start()), 10.0, "b" * 64).attempts == 0


def test_planner_takes_over_after_one_and_a_half_times_the_expected_attempts() -> None:
    monitor = after_move(seen(None, start(), attempts=2.0), start(), Move(0, 4))
    whys = []
    for _ in range(4):
        monitor = after_move(seen(monitor, start(), attempts=2.0), start(), Move(0, 4))
        whys.append((monitor.planner_fallback, monitor.attempts))
    assert whys == [(None, 1), (None, 2), ("attempts-exceeded", 0), ("attempts-exceeded", 1)]


def test_planner_keeps_deciding_until_a_person_interferes() -> None:
    state = apply(start(), SHAPE, Move(0, 5))
    monitor = seen(after_move(seen(None, state), state, Move(5, 1)), state)
    moved = apply(state, SHAPE, Move(5, 4))
    monitor = seen(after_move(monitor, state, Move(5, 4)), moved)
    assert monitor.planner_fallback == "repeated"
    assert seen(after_move(monitor, moved, Move(4, 2)), start()).planner_fallback is None


def test_record_never_grows_beyond_its_bound() -> None:
    monitor = seen(None, start(), attempts=1e6)
    full = dataclasses.replace(monitor, seen=tuple(f"{k:016x}" for k in range(MAX_SEEN)))
    second = apply(start(), SHAPE, Move(0, 5))
    handed = seen(after_move(full, start(), Move(0, 5)), second)
    assert handed.planner_fallback == "attempts-exceeded"
    assert len(handed.seen) <= MAX_SEEN


def test_keys_of_states_that_differ_in_any_part_differ() -> None:
    base = start()
    keys = {state_key(base)}
    for part, value in (("clutter", 2), ("towers", 2), ("goal", 2), ("fail", 0.1)):
        other = dataclasses.replace(base, **{part: getattr(base, part).copy()})
        getattr(other, part).flat[2] = value
        keys.add(state_key(other))
    assert len(keys) == 5
    assert all(len(key) == 16 for key in keys)


def test_every_valid_move_gives_a_state_of_another_key() -> None:
    state = apply(start(), SHAPE, Move(0, 5))
    for action in np.flatnonzero(valid_moves(state, SHAPE)):
        move = SHAPE.move_of(int(action))
        assert state_key(apply(state, SHAPE, move)) != state_key(state)
