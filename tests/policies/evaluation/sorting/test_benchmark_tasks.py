"""Tests of the six benchmark tasks: success, and interferences of the script."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.policies.evaluation.rows import EvaluationRequest
from app.policies.evaluation.sorting.benchmark_tasks import row_of, run_test, start_test, trials
from app.policies.evaluation.sorting.episodes import (
    ENDLESS,
    ScriptedInterferences,
    greedy,
    run_episodes,
)
from app.policies.evaluation.sorting.optimal_baseline import choose_by_planner
from app.sim.sorting.batch import SortingBatch, SortingSettings
from app.sim.sorting.benchmark_tasks import TESTS, sorting_test
from app.sim.sorting.state import SortingShape
from tests.policies.evaluation.sorting_players import exactly, in_circles, riskily, values_of

SHAPE = SortingShape(n_slots=10, n_colours=2)
FAIL = np.linspace(0.0, 0.4, 10)


@pytest.mark.parametrize("test", TESTS, ids=lambda test: test.name)
def test_the_exact_planner_passes_with_the_fewest_moves(test):
    alone, with_fallback = run_test(test, choose_by_planner, SHAPE, FAIL, 60, 4)
    for found in (alone, with_fallback):
        assert found.success.all()
        assert np.array_equal(found.moves, found.fewest)
        assert found.riskier.sum() == 0
    assert (alone.fewest >= test.n_goal).all()


@pytest.mark.parametrize("name", ["test-4", "test-5", "test-6"])
def test_the_person_does_everything_once_and_a_goal_is_not_the_end_before(name):
    test, n = sorting_test(name), 20
    batch = SortingBatch(SHAPE, FAIL, n, 4, SortingSettings(horizon_factor=ENDLESS))
    start_test(batch, test, FAIL, 4)
    before = [batch.state_of(e) for e in range(n)]
    found = run_episodes(batch, choose_by_planner, script=ScriptedInterferences(test, n, 4))
    for e in range(n):
        after = batch.state_of(e)
        assert after.solved
        assert after.n_objects == before[e].n_objects + test.n_added
        assert (after.goal != before[e].goal).any()
    assert (found.fewest > test.n_goal).all()


def test_the_person_comes_after_so_many_moves_or_at_the_goal():
    script = ScriptedInterferences(sorting_test("test-5"), 4, 1)
    which, moves = np.arange(4), np.array([0, 1, 0, 3])
    due = script.due(which, moves, np.array([False, False, True, False]))
    assert due.tolist() == [False, True, True, True]
    script._next[:] = 1
    due = script.due(which, moves, np.array([False, False, True, False]))
    assert due.tolist() == [False, False, True, False]
    script._next[:] = 2
    assert not script.due(which, moves, np.ones(4, dtype=bool)).any()


def test_riskier_duplicates_are_counted_in_the_third_test():
    choose = greedy(values_of(riskily, SHAPE))
    row = row_of("test-3", run_test(sorting_test("test-3"), choose, SHAPE, FAIL, 20, 4)[0])
    assert row["success"]["mean"] == row["fewest"]["mean"] == 1.0
    assert row["riskier_pick"]["mean"] > 0.9
    assert row["safest_identical"]["mean"] < 0.1


def test_a_move_too_many_in_any_part_is_not_the_fewest():
    wasted = {"done": False}

    def once_to_and_fro(batch, which):
        act = choose_by_planner(batch, which)
        if len(which) == 1 and batch.envs.moves[0] >= 4 and not wasted["done"]:
            k, c = SHAPE.n_slots, SHAPE.n_colours
            tower = int(batch.envs.heights[0].argmax())
            act[0] = 2 * k * c + tower * c + 1 - tower
            wasted["done"] = True
        return act

    found = run_test(sorting_test("test-6"), once_to_and_fro, SHAPE, FAIL, 1, 4)[0]
    assert wasted["done"] and found.success[0]
    assert found.moves[0] > found.fewest[0]


def test_rows_are_reported_in_order_and_the_fallback_ends_cycles():
    reported = []
    request = EvaluationRequest(episodes=4, seed=6, on_row=lambda *what: reported.append(what))
    found = trials(values_of(in_circles, SHAPE), SHAPE, FAIL, request)
    names = [test.name for test in TESTS]
    rows = {row["name"]: row for row in found["results"]}
    assert list(rows) == names + [f"{name}-planner-fallback" for name in names]
    assert [(done, total) for done, total, _ in reported] == [(k + 1, 12) for k in range(12)]
    assert [row for _, _, row in reported] == found["results"]
    for name in names:
        assert rows[name]["success"]["mean"] == 0.0
        assert rows[f"{name}-planner-fallback"]["success"]["mean"] == 1.0


def test_tests_that_are_too_large_are_left_out_and_named():
    small, request = SortingShape(n_slots=6, n_colours=1), EvaluationRequest(episodes=2, seed=6)
    found = trials(values_of(exactly, small), small, np.zeros(6), request)
    assert [row["name"] for row in found["results"][:2]] == ["test-1", "test-4"]
    assert found["settings"]["left_out"] == ["test-2", "test-3", "test-5", "test-6"]
    tiny = SortingShape(n_slots=3, n_colours=1)
    with pytest.raises(InvalidInput, match="must be enough"):
        trials(values_of(exactly, tiny), tiny, np.zeros(3), request)
