"""Rates and means with 95 % intervals, as results carry them."""

from typing import Any

import numpy as np
import scipy  # loads scipy.stats where it is first used
from numpy.typing import ArrayLike, NDArray

from app.sim.pick.batch import OUTCOMES


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


def outcome_intervals(outcome: NDArray[np.int64]) -> dict[str, Any]:
    """Return the number of episodes and the rate of each outcome; unfeasible only if met.

    Args:
        outcome: Index of each episode into OUTCOMES, shape (n,).
    """
    n = len(outcome)
    counts = {name: int((outcome == k).sum()) for k, name in enumerate(OUTCOMES) if k > 0}
    if counts["unfeasible"] == 0:
        del counts["unfeasible"]
    return {"n": n} | {name: wilson(count, n) for name, count in counts.items()}


def mean_of(values: ArrayLike) -> dict[str, float] | None:
    """Return a mean and its 95 % interval by the normal approximation; None without values.

    Args:
        values: One number per episode, shape (n,).
    """
    x = np.asarray(values, dtype=np.float64)
    if len(x) == 0:
        return None
    mean, error = float(x.mean()), float(x.std(ddof=1)) / len(x) ** 0.5 if len(x) > 1 else 0.0
    low, high = (
        scipy.stats.norm.interval(0.95, loc=mean, scale=error) if error else (mean, mean)
    )
    return {"mean": mean, "low": float(low), "high": float(high)}


def clustered(shares: ArrayLike) -> dict[str, float] | None:
    """Return the mean of clusters' shares and its 95 % interval; None without clusters.

    The interval is Student's t over the clusters, cut at 0 and 1, so that dependent episodes of
    a cluster do not narrow it. It has no width where all clusters have the same share.

    Args:
        shares: Share of episodes counted in each cluster, shape (n,).
    """
    x = np.asarray(shares, dtype=np.float64)
    if len(x) == 0:
        return None
    mean, half = float(x.mean()), 0.0
    if len(x) > 1:
        error = float(x.std(ddof=1)) / len(x) ** 0.5
        half = float(scipy.stats.t.ppf(0.975, len(x) - 1)) * error
    return {"mean": mean, "low": max(0.0, mean - half), "high": min(1.0, mean + half)}


def mcnemar(first: ArrayLike, second: ArrayLike) -> dict[str, float]:
    """Compare two success rates on the same episodes by McNemar's exact test.

    Args:
        first: Whether each episode succeeded under the first condition, shape (n,).
        second: The same under the second one.

    Returns:
        Episodes that only the first won, those that only the second won, and the two-sided
        p-value of equal rates.
    """
    a, b = np.asarray(first, dtype=bool), np.asarray(second, dtype=bool)
    gained, lost = int((a & ~b).sum()), int((~a & b).sum())
    p = scipy.stats.binomtest(gained, gained + lost).pvalue if gained + lost else 1.0
    return {"only_first": gained, "only_second": lost, "p": float(p)}
