"""Rates with intervals, as every result carries them.

Source: Wilson, *Probable inference, the law of succession, and statistical inference* (1927).
"""

import math

import numpy as np
from numpy.typing import ArrayLike

Z95 = 1.959963984540054
"""Quantile of the standard normal distribution for a two-sided 95 % interval."""


def wilson(hits: int, n: int) -> dict[str, float]:
    """Return a rate and its 95 % Wilson interval.

    Args:
        hits: Number of episodes in which it happened.
        n: Number of episodes, at least one.

    Raises:
        ValueError: ``hits`` is not between 0 and ``n``, or ``n`` is 0.
    """
    if n < 1 or not 0 <= hits <= n:
        raise ValueError(f"a rate needs 0 <= hits <= n and n >= 1, got {hits} of {n}")
    rate = hits / n
    spread = Z95 * math.sqrt(rate * (1.0 - rate) / n + (Z95 / (2.0 * n)) ** 2)
    centre, scale = rate + Z95**2 / (2.0 * n), 1.0 + Z95**2 / n
    return {
        "mean": rate,
        "low": 0.0 if hits == 0 else max(0.0, (centre - spread) / scale),
        "high": 1.0 if hits == n else min(1.0, (centre + spread) / scale),
    }


def mean_of(values: ArrayLike) -> dict[str, float] | None:
    """Return a mean and its 95 % interval, by the normal approximation; None without values.

    Args:
        values: One number per episode, shape (n,).
    """
    x = np.asarray(values, dtype=np.float64)
    if len(x) == 0:
        return None
    mean = float(x.mean())
    spread = Z95 * float(x.std(ddof=1)) / math.sqrt(len(x)) if len(x) > 1 else 0.0
    return {"mean": mean, "low": mean - spread, "high": mean + spread}
