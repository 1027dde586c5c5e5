"""Sorting episodes: what is counted, when they end, and what a hand-over changes."""

from dataclasses import replace

import numpy as np
import pytest

from app.policies.evaluation.sorting.episodes import (
    ENDLESS,
    SortingEpisodes,
    greedy,
    joined,
    run_episodes,
)
from app.policies.evaluation.sorting.optimal_baseline import choose_by_planner
from app.sim.sorting.batch import SortingBatch, SortingSettings
from app.sim.sorting.state import SortingShape, empty_state
from tests.policies.evaluation.sorting_players import exactly, in_circles, riskily, values_of

SHAPE = SortingShape(n_slots=6, n_colours=2)
FAIL = np.linspace(0.0, 0.4, 6)


def batch_of(n: int, fail=FAIL, **settings) -> SortingBatch:
    batch = SortingBatch(SHAPE, fail, n, 5, SortingSettings(horizon_factor=ENDLESS, **settings))
    batch.reset()
    return batch


def played(choice, n=200, fallback=False, **settings) -> SortingEpisodes:
    batch = batch_of(n, **settings)
    return run_episodes(batch, greedy(values_of(choice, SHAPE)), fallback=fallback)


@pytest.mark.parametrize("disturbed", [0.0, 1.0])
def test_the_exact_planner_reaches_every_goal_with_the_fewest_moves(disturbed):
    found = played(exactly, disturbed_share=disturbed)
    assert found.success.all()
    assert (found.moves == found.fewest).all()
    assert found.riskier.sum() == 0
    assert found.attempts.mean() == pytest.approx(found.expected.mean(), rel=0.05)


def test_values_of_the_planner_and_the_planner_itself_play_the_same():
    one, other = played(exactly), run_episodes(batch_of(200), choose_by_planner)
    assert np.array_equal(one.attempts, other.attempts)
    assert np.allclose(one.rewards, other.rewards)


def test_failed_picks_are_attempts_and_no_moves():
    found = played(exactly)
    assert found.failed.sum() > 0
    assert np.array_equal(found.attempts, found.moves + found.failed)
    assert (found.failed <= found.picks).all()


def with_duplicates(n: int) -> SortingBatch:
    """Return tasks of one object in the goal and two to choose from, one riskier."""
    state = empty_state(SHAPE)
    state.clutter[[0, 5]] = state.goal[0, 0] = 1
    state.fail[:] = FAIL
    batch = batch_of(n)
    for e in range(n):
        batch.put(e, state)
    return batch


@pytest.mark.parametrize(("choice", "share"), [(exactly, 0.0), (riskily, 1.0)])
def test_riskier_picks_are_those_with_a_safer_duplicate(choice, share):
    found = run_episodes(with_duplicates(40), greedy(values_of(choice, SHAPE)))
    assert found.riskier.sum() / found.picks.sum() == share
    assert np.array_equal(found.choices, found.picks)
    assert found.success.all()


def test_a_pick_without_a_duplicate_is_no_choice():
    batch, state = batch_of(1), empty_state(SHAPE)
    state.clutter[5] = state.goal[0, 0] = 1
    batch.put(0, replace(state, fail=FAIL))
    found = run_episodes(batch, choose_by_planner)
    assert (found.choices[0], found.riskier[0]) == (0, 0)
    assert found.picks[0] >= 1


def test_a_policy_in_circles_runs_out_of_attempts():
    found = played(in_circles, n=30, n_objects=4)
    lost = ~found.success
    assert lost.mean() > 0.9
    assert (found.attempts[lost] == 4 * SHAPE.n_slots).all()
    assert found.planner_fallback[lost].all() and found.repeated[lost].any()


def test_the_planner_fallback_ends_cycles():
    found = played(in_circles, n=30, fallback=True, n_objects=4)
    assert found.success.all()
    assert found.planner_fallback.sum() > 20 and found.repeated.any()
    assert (found.moves[found.repeated] > found.fewest[found.repeated]).all()


def test_only_the_rows_asked_for_are_run():
    only = np.arange(20) % 4 == 0
    all_of_them = run_episodes(batch_of(20), choose_by_planner)
    some = run_episodes(batch_of(20), choose_by_planner, only=only)
    assert not some.success[~only].any() and some.attempts[~only].sum() == 0
    assert np.array_equal(some.attempts[only], all_of_them.attempts[only])


def test_episodes_are_joined_and_replaced_by_row():
    one, other = played(exactly, n=6), played(in_circles, n=6, n_objects=4)
    where = np.arange(6) < 2
    mixed = one.replaced(other, where)
    assert mixed.attempts.tolist() == [*other.attempts[:2], *one.attempts[2:]]
    both = joined([one, other])
    assert np.array_equal(both.part(slice(6, 12)).moves, other.moves)
