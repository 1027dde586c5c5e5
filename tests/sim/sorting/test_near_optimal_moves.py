"""Moves that the exact planner expects to take about as many attempts as its own."""

import numpy as np
import pytest

from app.sim.sorting.batch import SortingBatch, SortingSettings, apply
from app.sim.sorting.decision import failure_of
from app.sim.sorting.near_optimal_moves import near_optimal_moves
from app.sim.sorting.planner import solve
from app.sim.sorting.state import Move, SortingShape, SortingState, empty_state

SHAPE = SortingShape(n_slots=5, n_colours=2)
RED, BLUE = 5, 6
SMALL, LARGE = SHAPE.code(0, 0), SHAPE.code(0, 2)


def duplicates(risk: float) -> SortingState:
    """Two large red objects of which one is wanted; picks of the second fail more often."""
    state = empty_state(SHAPE)
    state.clutter[:2] = LARGE, LARGE
    state.goal[0, 0] = LARGE
    state.fail[1] = risk
    return state


def test_move_is_near_optimal_up_to_the_margin() -> None:
    attempts = 1.0 / (1.0 - 0.2) - 1.0
    below = near_optimal_moves(duplicates(0.2), SHAPE, attempts - 1e-6)
    above = near_optimal_moves(duplicates(0.2), SHAPE, attempts + 1e-6)
    assert below.moves == (Move(0, RED),)
    assert above.moves == (Move(0, RED), Move(1, RED))
    assert above.attempts == pytest.approx((1.0, 1.25))


@pytest.mark.parametrize("seed", range(3))
def test_planner_s_own_move_is_first_and_all_others_keep_to_the_margin(seed: int) -> None:
    settings = SortingSettings(disturbed_share=0.5, random_map_share=1.0)
    batch = SortingBatch(SHAPE, np.zeros(5), 20, seed, settings)
    batch.reset()
    for e in range(batch.n_envs):
        state = batch.state_of(e)
        near, plan = near_optimal_moves(state, SHAPE, 0.3), solve(state, SHAPE)
        assert SHAPE.action_of(near.moves[0]) == plan.best
        assert near.attempts[0] == plan.attempts
        assert len(set(near.moves)) == len(near.moves)
        for move, attempts in zip(near.moves, near.attempts, strict=True):
            after = solve(apply(state, SHAPE, move), SHAPE)
            assert after.moves == plan.moves - 1
            assert attempts <= plan.attempts + 0.3
            assert attempts >= after.attempts + 1.0 / (1.0 - failure_of(state, move)) - 1e-9


def test_detour_is_not_near_optimal_at_any_margin() -> None:
    near = near_optimal_moves(duplicates(0.0), SHAPE, 10.0)
    assert near.moves == (Move(0, RED), Move(1, RED))


def test_there_is_no_move_at_the_goal() -> None:
    assert near_optimal_moves(empty_state(SHAPE), SHAPE).moves == ()


def test_moves_of_one_object_are_those_that_pick_it() -> None:
    state = empty_state(SHAPE)
    state.towers[1, 0] = SMALL
    near = near_optimal_moves(state, SHAPE)
    assert near.moves and near.of(BLUE).moves == near.moves
    assert near.of(0).moves == near.of(0).attempts == ()


def test_large_task_offers_the_planner_s_own_move_alone() -> None:
    shape = SortingShape(n_slots=40, n_colours=3)
    settings = SortingSettings(n_objects=40, n_goal=40)
    batch = SortingBatch(shape, np.zeros(40), 1, 0, settings)
    batch.reset()
    near = near_optimal_moves(batch.state_of(0), shape)
    assert len(near.moves) == 1
