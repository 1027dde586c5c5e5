"""Intervals of rates, counts and clusters, and McNemar's test, against published values."""

import numpy as np
import pytest

from app.policies.evaluation.statistics import (
    clustered,
    count_difference,
    count_of,
    mcnemar,
    mean_of,
    ratio_values,
    share_of,
    wilson,
)


def test_the_interval_matches_a_published_example():
    """Newcombe (1998), table I: 81 of 263 gives 0.2553 to 0.3662."""
    rate = wilson(81, 263)
    assert rate["low"] == pytest.approx(0.2553, abs=1e-4)
    assert rate["high"] == pytest.approx(0.3662, abs=1e-4)


def test_extreme_rates_stay_between_zero_and_one():
    assert wilson(0, 20)["low"] == 0.0
    assert wilson(20, 20)["high"] == 1.0
    assert wilson(20, 20)["low"] == pytest.approx(0.8389, abs=1e-4)


@pytest.mark.parametrize(("hits", "n"), [(0, 0), (-1, 5), (6, 5)])
def test_impossible_counts_are_refused(hits, n):
    with pytest.raises(ValueError, match="0 <= hits <= n"):
        wilson(hits, n)


def test_mcnemar_counts_the_pairs_that_differ():
    """Two-sided binomial test of 9 against 1: p = 22 / 1024."""
    first, second = [True] * 9 + [False] + [True] * 5, [False] * 9 + [True] + [True] * 5
    found = mcnemar(first, second)
    assert (found["only_first"], found["only_second"]) == (9, 1)
    assert found["p"] == pytest.approx(22 / 1024)
    assert mcnemar(first, first) == {"only_first": 0, "only_second": 0, "p": 1.0}


def test_the_interval_over_clusters_is_that_of_students_t():
    """t(0.975, 4) = 2.776; the standard error of these five shares is sqrt(0.025 / 5)."""
    found = clustered([0.3, 0.4, 0.5, 0.6, 0.7])
    assert found["mean"] == pytest.approx(0.5)
    assert found["high"] - 0.5 == pytest.approx(2.776 * (0.025 / 5) ** 0.5, abs=1e-4)
    assert clustered([0.0, 1.0]) == {"mean": 0.5, "low": 0.0, "high": 1.0}
    assert clustered([]) is None


def test_a_single_cluster_shows_nothing_about_others():
    assert clustered([0.4]) == {"mean": 0.4, "low": 0.0, "high": 1.0}
    assert clustered([0.4], low=-1.0)["low"] == -1.0


def test_the_interval_of_a_ratio_is_that_of_the_delta_method():
    """No width where each episode has the ratio; else the ratio estimator of Cochran (1977)."""
    x, y = np.array([2.0, 1.0, 4.0, 3.0]), np.array([4.0, 2.0, 8.0, 6.0])
    assert mean_of(ratio_values(x, y)) == {"mean": 0.5, "low": 0.5, "high": 0.5}
    x[0] += 1.0
    found, ratio = mean_of(ratio_values(x, y)), 11.0 / 20.0
    error = ((x - ratio * y) ** 2).sum() ** 0.5 / (3 * 4) ** 0.5 / 5.0
    assert found == pytest.approx(
        {"mean": ratio, "low": ratio - 1.959964 * error, "high": ratio + 1.959964 * error}
    )


def test_the_interval_of_a_count_is_garwoods():
    """Garwood (1936), 95 %: 0 to 3.689 for no event, 1.623 to 11.668 for five."""
    assert count_of([0] * 300) == pytest.approx(
        {"mean": 0.0, "low": 0.0, "high": 3.689 / 300}, 1e-3
    )
    found = count_of([1] * 5 + [0] * 45)
    assert found == pytest.approx({"mean": 0.1, "low": 1.623 / 50, "high": 11.668 / 50}, 1e-3)
    assert count_of([0]) == pytest.approx({"mean": 0.0, "low": 0.0, "high": 3.689}, 1e-3)
    assert count_of([]) is None


def test_events_in_clusters_have_a_wider_interval_and_no_negative_end():
    """Five events in one of 50 episodes: variance / mean is 5, so that they count as one."""
    found = count_of([5] + [0] * 49)
    assert found == pytest.approx({"mean": 0.1, "low": 0.0253 / 10, "high": 5.572 / 10}, 1e-2)


def test_a_difference_of_counts_has_students_interval():
    first, other = [3, 5, 4, 6, 2] * 8, [1, 1, 1, 1, 1] * 8
    half = 2.0227 * (80.0 / 39.0 / 40.0) ** 0.5
    expected = {"mean": 3.0, "low": 3.0 - half, "high": 3.0 + half}
    assert count_difference(first, other) == pytest.approx(expected, 1e-4)


def test_equal_counts_do_not_show_that_there_is_no_difference():
    found = count_difference([0] * 50, [0] * 50)
    assert found == pytest.approx({"mean": 0.0, "low": -3.689 / 50, "high": 3.689 / 50}, 1e-3)
    assert count_difference([2], [1]) == {"mean": 1.0}


def test_a_share_of_independent_trials_has_wilsons_interval():
    hits = [1] * 81 + [0] * 182
    assert share_of(hits, [1] * 263) == pytest.approx(wilson(81, 263))
    assert share_of([0, 0], [7, 13]) == pytest.approx(wilson(0, 20))


def test_trials_that_agree_within_episodes_count_once():
    """20 episodes, in which all ten trials hit or none: as many trials as episodes, nearly."""
    found = share_of([10] * 8 + [0] * 12, [10] * 20)
    apart = wilson(8, 20)
    assert found["mean"] == pytest.approx(0.4)
    assert found["low"] == pytest.approx(apart["low"], abs=0.01)
    assert found["high"] == pytest.approx(apart["high"], abs=0.01)
    assert share_of([0, 1], [0, 2]) == pytest.approx(wilson(1, 2))
    assert share_of([0], [0]) is None
