"""Histogram of the lateness of a live world's ticks."""

from bisect import bisect_left
from itertools import accumulate

BOUNDS_S = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2)
"""Upper bounds of the buckets [s]."""


class Lateness:
    """Counts ticks by their lateness; written by one thread, read by any."""

    def __init__(self) -> None:
        self._counts = [0] * (len(BOUNDS_S) + 1)
        self.total_s = 0.0
        """Sum of the lateness of all ticks [s]."""

    def add(self, late_s: float) -> None:
        """Count a tick that began ``late_s`` after its due time [s]."""
        self._counts[bisect_left(BOUNDS_S, late_s)] += 1
        self.total_s += late_s

    def buckets(self) -> list[tuple[str, float]]:
        """Return the upper bound of each bucket as text and the ticks up to it."""
        bounds = (*map(str, BOUNDS_S), "+Inf")
        return list(zip(bounds, map(float, accumulate(self._counts)), strict=True))
