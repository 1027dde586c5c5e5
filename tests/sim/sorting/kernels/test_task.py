"""Every term of the sorting reward, by name and by hand; who pays which."""

import numpy as np
import pytest

from app.sim.sorting.batch import SortingBatch, SortingSettings
from app.sim.sorting.kernels import reward as terms
from app.sim.sorting.kernels.reward import SortingWeights
from app.sim.sorting.state import Move, SortingShape, SortingState, empty_state

SHAPE = SortingShape(n_slots=4, n_colours=2, n_sizes=3)
ODD = SortingWeights(
    move=0.01, empty=0.02, stuck=0.04, fail=0.08, back=0.16, distance=0.0, success=3.0
)
"""Sums of these tell which terms they are made of."""
NULL_CODE, SMALL_RED, LARGE_RED, LARGE_BLUE = 0, 1, 3, 6


def scene(fail: float = 0.0) -> SortingState:
    """A large red block in cell 0, a small one on the red tower, where it belongs."""
    state = empty_state(SHAPE)
    state.clutter[:2] = LARGE_RED, LARGE_BLUE
    state.towers[0, 0] = SMALL_RED
    state.goal[0, :2] = LARGE_RED, SMALL_RED
    state.fail[:] = fail
    return state


def paid(state: SortingState, move: Move, weights: SortingWeights = ODD) -> float:
    """What an attempt at a move pays."""
    settings = SortingSettings(weights=weights)
    batch = SortingBatch(SHAPE, state.fail, 1, 7, settings)
    batch.reset()
    batch.put(0, state)
    return float(batch.step(np.array([SHAPE.action_of(move)]), auto_reset=False).rew[0])


@pytest.mark.parametrize(
    ("term", "name"),
    [
        (terms.empty_cost, "empty"),
        (terms.stuck_cost, "stuck"),
        (terms.fail_cost, "fail"),
        (terms.back_cost, "back"),
        (terms.success_bonus, "success"),
    ],
)
def test_a_term_is_its_coefficient_where_it_applies(term, name: str) -> None:
    assert term(True, ODD) == getattr(ODD, name)
    assert term(False, ODD) == 0.0


def test_every_attempt_costs_a_move() -> None:
    assert terms.move_cost(ODD) == ODD.move
    assert paid(scene(), Move(0, 4)) == pytest.approx(-0.01)


@pytest.mark.parametrize(
    ("move", "name"),
    [
        (Move(3, 4), "empty"),  # nothing in cell 3
        (Move(5, 4), "empty"),  # nothing on the blue tower
        (Move(4, 4), "stuck"),  # the same tower
        (Move(4, 1), "stuck"),  # no room in cell 1
        (Move(4, 2), "back"),
    ],
)
def test_a_move_pays_for_what_it_is(move: Move, name: str) -> None:
    assert paid(scene(), move) == pytest.approx(-ODD.move - getattr(ODD, name))


def test_a_move_from_tower_to_tower_pays_for_nothing_else() -> None:
    assert paid(scene(), Move(4, 5)) == pytest.approx(-ODD.move)


def test_a_failed_pick_pays_for_the_failure_and_changes_nothing() -> None:
    state = scene(fail=0.99)
    batch = SortingBatch(SHAPE, state.fail, 64, 3, SortingSettings(weights=ODD))
    batch.reset()
    for e in range(64):
        batch.put(e, state)
    result = batch.step(np.full(64, SHAPE.action_of(Move(0, 4))), auto_reset=False)
    failed = batch.envs.failures == 1
    assert failed.sum() > 50
    np.testing.assert_allclose(result.rew[failed], -ODD.move - ODD.fail, rtol=1e-6)
    np.testing.assert_array_equal(
        batch.envs.clutter[failed], np.tile(state.clutter, (failed.sum(), 1))
    )
    np.testing.assert_array_equal(batch.envs.moves, ~failed)


def test_an_empty_pick_does_not_fail() -> None:
    assert paid(scene(fail=0.99), Move(3, 4)) == pytest.approx(-ODD.move - ODD.empty)


def test_the_goal_pays_its_bonus_once_reached() -> None:
    state = scene()
    state.towers[0, :2] = LARGE_RED, NULL_CODE
    state.clutter[0] = SMALL_RED
    assert paid(state, Move(0, 4)) == pytest.approx(ODD.success - ODD.move)


@pytest.mark.parametrize(
    ("there", "wanted", "distance"),
    [
        (LARGE_RED, LARGE_RED, 0.0),
        (SMALL_RED, LARGE_RED, 0.5),
        (LARGE_BLUE, LARGE_RED, 0.5),
        (SMALL_RED, LARGE_BLUE, 1.0),
        (NULL_CODE, LARGE_RED, 1.0),
        (LARGE_RED, NULL_CODE, 1.0),
    ],
)
def test_distance_counts_colour_and_size_by_halves(
    there: int, wanted: int, distance: float
) -> None:
    towers, goal = np.zeros((2, 2, 4), dtype=np.int8)
    towers[1, 2], goal[1, 2] = there, wanted
    cost = terms.distance_cost(towers, goal, 3, SortingWeights(distance=0.8))
    assert cost == pytest.approx(0.8 * distance / 4)


def test_distance_is_paid_for_the_state_after_the_attempt() -> None:
    weights = SortingWeights(*[0.0] * 7)._replace(distance=0.4)
    assert paid(scene(), Move(4, 2), weights) == pytest.approx(-0.4 * 2 / 4)
    assert paid(scene(), Move(4, 4), weights) == pytest.approx(-0.4 * 1.5 / 4)
