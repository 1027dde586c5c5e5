"""Wilson and clustered intervals, and McNemar's test, against published values."""

import pytest

from app.policies.evaluation.statistics import clustered, mcnemar, wilson


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
