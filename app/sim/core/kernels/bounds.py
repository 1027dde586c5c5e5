"""Bounds of several variables (compiled)."""

from collections.abc import Callable
from functools import cache

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.jit import direct, kernel


@kernel()
def _are_inside(values: Vec, low: Vec, high: Vec) -> bool:
    """See :func:`are_inside`."""
    n = low.shape[0]
    for first in range(0, values.shape[0], n):
        for k in range(n):
            if not low[k] <= values[first + k] <= high[k]:
                return False
    return True


@cache
def _compiled() -> Callable[..., bool]:
    return direct(_are_inside, (np.zeros(1), np.zeros(1), np.zeros(1)))


def are_inside(values: Vec, low: Vec, high: Vec) -> bool:
    """Return whether values lie within bounds; NaN does not.

    A tenth of the time of numpy's comparisons, for few values.

    Args:
        values: One or more sets of n variables, shape (m n,), contiguous.
        low: Lower bounds, shape (n,), contiguous.
        high: Upper bounds, shape (n,), contiguous.
    """
    return _compiled()(values, low, high)
