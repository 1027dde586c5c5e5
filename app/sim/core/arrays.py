"""Array types of the simulator."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Vec = NDArray[np.float64]


def as_kernel_array(values: ArrayLike) -> Vec:
    """Return a float64 copy, contiguous and writable.

    Kernels are compiled again for read-only, strided or integer arrays, which takes half a
    minute.
    """
    return np.array(values, dtype=np.float64, order="C")


def as_kernel_index(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return a contiguous, writable copy of integers."""
    return np.array(values, dtype=np.int64, order="C")
