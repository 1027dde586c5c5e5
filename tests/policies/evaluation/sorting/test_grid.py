"""The grid of pairs: what a row counts, on hand-made episodes and on real ones."""

import numpy as np
import pytest

from app.policies.evaluation.rows import EvaluationRequest
from app.policies.evaluation.sorting.episodes import SortingEpisodes, run_episodes
from app.policies.evaluation.sorting.grid import CHUNK, grid, grid_batches, pairs_of, row_of
from app.policies.evaluation.sorting.optimal_baseline import choose_by_planner
from app.policies.evaluation.statistics import mean_of
from app.sim.sorting.state import NULL, SortingShape
from tests.policies.evaluation.sorting_players import exactly, in_circles, values_of
from tools.docs.sorting.curves import curve_point

SHAPE = SortingShape(n_slots=4, n_colours=2)
FAIL = np.array([0.0, 0.1, 0.2, 0.4])
PAIRS = np.array([[1, 1], [2, 1]])


def episodes(**given) -> SortingEpisodes:
    """Return four episodes, two of each pair; all went as the planner goes."""
    numbers = {
        "rewards": np.array([0.5, 0.7, 0.1, 0.3]),
        "moves": np.array([2, 2, 4, 4]),
        "fewest": np.array([2, 2, 4, 4]),
        "attempts": np.array([3, 2, 5, 5]),
        "expected": np.array([2.5, 2.5, 5.0, 5.0]),
        "picks": np.array([3, 2, 5, 5]),
        "failed": np.array([1, 0, 1, 1]),
        "choices": np.array([0, 0, 2, 2]),
        "riskier": np.array([0, 0, 0, 0]),
    }
    flags = {name: np.zeros(4, dtype=bool) for name in ("planner_fallback", "repeated")}
    return SortingEpisodes(**{"success": np.ones(4, dtype=bool), **numbers, **flags, **given})


def test_a_row_of_perfect_episodes():
    row = row_of("clean", episodes(), PAIRS, 0.99)
    assert (row["n"], row["success"]["mean"], row["timeout"]["mean"]) == (4, 1.0, 0.0)
    assert row["moves_over_minimum"] == {"mean": 1.0, "low": 1.0, "high": 1.0}
    assert (row["exactly_minimal"]["mean"], row["riskier_pick"]["mean"]) == (1.0, 0.0)
    assert row["attempts_over_expected"]["mean"] == pytest.approx((1.2 + 0.8 + 1 + 1) / 4)
    assert row["failed_pick"]["mean"] == 3 / 15
    assert row["mean_return"] == pytest.approx(0.4)
    assert [cell["return"] for cell in row["pairs"]] == pytest.approx([0.6, 0.2])


def test_moves_over_the_minimum_are_counted_over_successes_only():
    won = np.array([True, True, True, False])
    found = episodes(success=won, moves=np.array([2, 3, 4, 40]))
    row = row_of("clean", found, PAIRS, 0.99)
    assert row["moves_over_minimum"]["mean"] == pytest.approx((1 + 1.5 + 1) / 3)
    assert row["exactly_minimal"]["mean"] == 2 / 4
    assert row["timeout"]["mean"] == 1 / 4


def test_the_worst_pair_is_named_with_its_interval():
    won = np.array([True, True, True, False])
    worst = row_of("clean", episodes(success=won), PAIRS, 0.99)["worst_pair"]
    assert (worst["n_objects"], worst["n_goal"], worst["mean"]) == (2, 1, 0.5)
    assert worst["low"] < 0.5 < worst["high"] < 0.99


def test_a_pair_is_below_when_its_upper_bound_is():
    won = np.array([True, True, False, False])
    row = row_of("clean", episodes(success=won), PAIRS, 0.99)
    assert [cell["below"] for cell in row["pairs"]] == [False, True]
    assert row["pairs_below"] == 1
    assert row_of("clean", episodes(success=won), PAIRS, 0.5)["pairs_below"] == 0


def test_riskier_picks_are_a_share_of_all_picks():
    row = row_of("clean", episodes(riskier=np.array([0, 0, 2, 1])), PAIRS, 0.99)
    assert row["riskier_pick"]["mean"] == pytest.approx(3 / 15)


def test_without_success_there_is_no_ratio_and_without_picks_no_share():
    lost = np.zeros(4, dtype=bool)
    row = row_of("clean", episodes(success=lost), PAIRS, 0.99)
    assert row["moves_over_minimum"] is None and row["attempts_over_expected"] is None
    none = np.zeros(4, dtype=int)
    assert row_of("clean", episodes(picks=none), PAIRS, 0.99)["riskier_pick"] is None


def test_a_mean_has_the_normal_interval():
    found = mean_of([1.0, 2.0, 3.0, 4.0])
    half = 1.959963984540054 * np.sqrt(5.0 / 3.0 / 4.0)
    assert found == pytest.approx({"mean": 2.5, "low": 2.5 - half, "high": 2.5 + half})
    assert mean_of([1.5]) == {"mean": 1.5}
    assert mean_of([]) is None


@pytest.mark.parametrize("disturbed", [0.0, 1.0])
def test_every_pair_has_its_episodes_of_its_numbers(disturbed):
    assert len(pairs_of(SHAPE)) == 10
    (batch,) = grid_batches(SHAPE, FAIL, 5, 3, disturbed)
    envs = batch.envs
    n_objects = (envs.clutter != NULL).sum(axis=1) + (envs.towers != NULL).sum(axis=(1, 2))
    n_goal = (envs.goal != NULL).sum(axis=(1, 2))
    assert np.array_equal(np.stack([n_objects, n_goal], 1), np.repeat(pairs_of(SHAPE), 5, 0))
    assert (envs.towers != NULL).any() == (disturbed > 0.0)


def test_episodes_are_the_same_however_they_are_cut_into_batches(monkeypatch):
    whole = run_episodes(next(grid_batches(SHAPE, FAIL, 6, 3, 0.0)), choose_by_planner)
    monkeypatch.setattr("app.policies.evaluation.sorting.grid.CHUNK", 25)
    parts = [
        run_episodes(one, choose_by_planner) for one in grid_batches(SHAPE, FAIL, 6, 3, 0.0)
    ]
    assert CHUNK > 60 and [len(one.moves) for one in parts] == [25, 25, 10]
    assert np.array_equal(whole.attempts, np.concatenate([one.attempts for one in parts]))


def test_rows_are_reported_in_order_and_the_planner_needs_no_fallback():
    reported = []
    request = EvaluationRequest(episodes=3, seed=5, on_row=lambda *what: reported.append(what))
    found = grid(values_of(exactly, SHAPE), SHAPE, FAIL, request)
    names = [
        f"{a}{b}" for a in ("clean", "disturbed") for b in ("", "-planner-fallback", "-planner")
    ]
    assert [row["name"] for row in found["results"]] == names
    assert [(done, total) for done, total, _ in reported] == [(k + 1, 6) for k in range(6)]
    assert [row for _, _, row in reported] == found["results"]
    for row in found["results"]:
        assert (row["n"], row["success"]["mean"], row["exactly_minimal"]["mean"]) == (30, 1, 1)
        assert row["repeated"]["mean"] == row["riskier_pick"]["mean"] == 0.0
    assert found["episodes"] == 3
    assert found["settings"]["horizon_attempts"] == 16


def test_with_fallback_a_cycling_policy_reaches_every_goal():
    request = EvaluationRequest(episodes=3, seed=5)
    found = grid(values_of(in_circles, SHAPE), SHAPE, FAIL, request)["results"]
    rows = {row["name"]: row for row in found}
    for start in ("clean", "disturbed"):
        alone, with_fallback = rows[start], rows[f"{start}-planner-fallback"]
        assert alone["success"]["mean"] < 0.5
        assert with_fallback["success"]["mean"] == 1.0
        assert (
            with_fallback["planner_fallback"]["mean"] == alone["planner_fallback"]["mean"] > 0.5
        )
        assert with_fallback["moves_over_minimum"]["mean"] > 1.1


def test_the_curve_counts_every_pair_alike():
    point = curve_point(values_of(exactly, SHAPE), SHAPE, FAIL, 4, 9)
    lost = curve_point(values_of(in_circles, SHAPE), SHAPE, FAIL, 4, 9)
    assert point["success"] == 1.0 and lost["success"] < 0.5
    assert point["mean_return"] > 0.0 > lost["mean_return"]
    assert 0.0 < point["return_sd"] < lost["return_sd"]
