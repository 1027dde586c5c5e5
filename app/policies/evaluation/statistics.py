"""Rates and means with 95 % intervals, as results carry them."""

from typing import Any

import numpy as np
import scipy  # loads scipy.stats where it is first used
from numpy.typing import ArrayLike, NDArray

from app.sim.pick.batch import OUTCOMES

Index = NDArray[np.int64]
Flags = NDArray[np.bool_]


def wilson(hits: int, n: int) -> dict[str, float]:
    """Return a rate and its 95 % Wilson interval.

    Args:
        hits: Number of episodes counted.
        n: Number of episodes, at least 1.

    Raises:
        ValueError: ``hits`` is not between 0 and ``n``, or ``n`` is 0.
    """
    if n < 1 or not 0 <= hits <= n:
        raise ValueError(f"a rate needs 0 <= hits <= n and n >= 1, got {hits} of {n}")
    interval = scipy.stats.binomtest(hits, n).proportion_ci(0.95, method="wilson")
    return {"mean": hits / n, "low": float(interval.low), "high": float(interval.high)}


def rate_of(held: Flags) -> dict[str, float]:
    """Return the share of episodes in which something held, shape (n,), as :func:`wilson`."""
    return wilson(int(held.sum()), len(held))


def outcome_intervals(outcome: Index) -> dict[str, Any]:
    """Return the number of episodes and the rate of each outcome; unfeasible only if met.

    Args:
        outcome: Index of each episode into OUTCOMES, shape (n,).
    """
    flags = {name: outcome == k for k, name in enumerate(OUTCOMES) if k > 0}
    rates = {name: rate_of(held) for name, held in flags.items()}
    if not flags["unfeasible"].any():
        del rates["unfeasible"]
    return {"n": len(outcome), **rates}


def mean_of(values: ArrayLike) -> dict[str, float] | None:
    """Return a mean and its 95 % interval by the normal approximation.

    Args:
        values: One number per episode, shape (n,).

    Returns:
        The mean, with an interval from two values on; None without values.
    """
    x = np.asarray(values, dtype=np.float64)
    if len(x) == 0:
        return None
    mean = float(x.mean())
    if len(x) == 1:
        return {"mean": mean}
    error = float(x.std(ddof=1)) / len(x) ** 0.5
    low, high = (
        scipy.stats.norm.interval(0.95, loc=mean, scale=error) if error else (mean, mean)
    )
    return {"mean": mean, "low": float(low), "high": float(high)}


def ratio_values(numerator: ArrayLike, denominator: ArrayLike) -> NDArray[np.float64]:
    """Return values per episode whose mean is the ratio of two sums, shape (n,).

    The deviation of each value from the mean is the contribution of its episode to the first
    order (delta method), so that the interval of the mean is that of the ratio, and differences
    between conditions on the same episodes are paired.

    Args:
        numerator: Summand of the numerator of each episode, shape (n,).
        denominator: Summand of the denominator of each, shape (n,); its mean is not 0.
    """
    x, y = (np.asarray(one, dtype=np.float64) for one in (numerator, denominator))
    ratio = x.sum() / y.sum()
    values: NDArray[np.float64] = ratio + (x - ratio * y) / y.mean()
    return values


def count_of(values: ArrayLike) -> dict[str, float] | None:
    """Return the mean number of events and its 95 % interval; None without values.

    The interval is that of a Poisson count (Garwood 1936). Where events occur in clusters, the
    variance of the values exceeds their mean: count and interval are then in units of their
    ratio (McCullagh and Nelder 1989). Without any event the upper end is 3.69 / n.

    Args:
        values: Number of events of each episode, shape (n,).
    """
    x = np.asarray(values, dtype=np.float64)
    n, events = len(x), float(x.sum())
    if n == 0:
        return None
    dispersion = float(x.var(ddof=1)) * n / events if n > 1 and events > 0.0 else 1.0
    unit = max(1.0, dispersion)
    low = scipy.stats.chi2.ppf(0.025, 2.0 * events / unit) if events > 0.0 else 0.0
    high = scipy.stats.chi2.ppf(0.975, 2.0 * events / unit + 2.0)
    ends = {name: float(0.5 * unit * end) / n for name, end in (("low", low), ("high", high))}
    return {"mean": events / n, **ends}


def count_difference(first: ArrayLike, other: ArrayLike) -> dict[str, float] | None:
    """Return the mean difference of paired numbers of events and its 95 % interval.

    The interval is Student's t over the differences, and at least 3.69 / n to either side, as
    that of :func:`count_of` without any event: equal numbers in n episodes do not show that
    there is no difference.

    Args:
        first: Number of events of each episode under the first condition, shape (n,).
        other: The same under the other one.

    Returns:
        The first mean less the other, with an interval from two episodes on; None without
        episodes.
    """
    x = np.asarray(first, dtype=np.float64) - np.asarray(other, dtype=np.float64)
    if len(x) < 2:
        return mean_of(x)
    no_event = 0.5 * float(scipy.stats.chi2.ppf(0.975, 2.0)) / len(x)
    mean, half = float(x.mean()), max(_half_width(x), no_event)
    return {"mean": mean, "low": mean - half, "high": mean + half}


def _half_width(x: NDArray[np.float64]) -> float:
    """Return half the width of Student's 95 % interval of the mean of two or more values."""
    error = float(x.std(ddof=1)) / len(x) ** 0.5
    return float(scipy.stats.t.ppf(0.975, len(x) - 1) * error)


def clustered(
    values: ArrayLike, low: float = 0.0, high: float = 1.0
) -> dict[str, float] | None:
    """Return the mean over clusters and its 95 % interval; None without clusters.

    The interval is Student's t over the clusters, cut at the ends of what is possible, so that
    dependent episodes of a cluster do not narrow it. It has no width where all clusters have
    the same value, and every possible one with a single cluster.

    Args:
        values: Value of each cluster, such as its share of episodes, shape (n,).
        low: Least possible mean.
        high: Greatest possible mean.
    """
    x = np.asarray(values, dtype=np.float64)
    if len(x) == 0:
        return None
    mean = float(x.mean())
    half = _half_width(x) if len(x) > 1 else float("inf")
    return {"mean": mean, "low": max(low, mean - half), "high": min(high, mean + half)}


def share_of(hits: ArrayLike, of: ArrayLike) -> dict[str, float] | None:
    """Return the rate of hits over all episodes and its 95 % interval; None without trials.

    The interval is Wilson's for the effective number of trials (Korn and Graubard 1998): their
    number divided by the ratio of the rate's variance between episodes (delta method) to that
    of independent trials, where it exceeds 1, because the trials of an episode depend on each
    other.

    Args:
        hits: Number of hits of each episode, shape (n,).
        of: Number of trials of each episode, shape (n,).
    """
    x, trials = np.asarray(hits, dtype=np.float64), np.asarray(of, dtype=np.float64)
    x, trials = x[trials > 0.0], trials[trials > 0.0]
    n, total = len(x), float(trials.sum())
    if n == 0:
        return None
    rate, effective = float(x.sum()) / total, total
    if n > 1 and 0.0 < rate < 1.0:
        between = float(((x - rate * trials) ** 2).sum()) * n / (n - 1)
        independent = total * rate * (1.0 - rate) * total / (total - 1.0)
        effective = total / max(1.0, between / independent)
    z2 = float(scipy.stats.norm.ppf(0.975)) ** 2
    centre = (rate + 0.5 * z2 / effective) / (1.0 + z2 / effective)
    square = z2 * (rate * (1.0 - rate) + 0.25 * z2 / effective) / effective
    half = square**0.5 / (1.0 + z2 / effective)
    return {"mean": rate, "low": max(0.0, centre - half), "high": min(1.0, centre + half)}


def mcnemar(first: ArrayLike, second: ArrayLike) -> dict[str, float]:
    """Compare two success rates on the same episodes by McNemar's exact test.

    Args:
        first: Whether each episode succeeded under the first condition, shape (n,).
        second: The same under the second one.

    Returns:
        Episodes that only the first won, those that only the second won, and the two-sided
        p-value of equal rates; 0 where a float cannot hold it.
    """
    a, b = np.asarray(first, dtype=bool), np.asarray(second, dtype=bool)
    gained, lost = int((a & ~b).sum()), int((~a & b).sum())
    p = scipy.stats.binomtest(gained, gained + lost).pvalue if gained + lost else 1.0
    return {"only_first": gained, "only_second": lost, "p": float(p)}


def paired(name: str, first: ArrayLike, second: ArrayLike) -> dict[str, str | float]:
    """Return a named comparison of two success rates on the same episodes.

    Args:
        first: Whether each episode succeeded under the first condition, shape (n,).
        second: The same under the second one.

    Returns:
        Name, first rate less the second, and the numbers of :func:`mcnemar`.
    """
    a, b = np.asarray(first, dtype=bool), np.asarray(second, dtype=bool)
    return {"name": name, "difference": float(a.mean() - b.mean()), **mcnemar(a, b)}
