"""How the kernels are compiled: cached on disk, and without counting references.

A kernel is handed tuples of dozens of arrays, and counting their references at every call (an
atomic instruction per array) took more than half of a step's time. Without the counting a
kernel can make no arrays: what it works on is made by its caller, once per batch.
"""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

from numba import njit

P = ParamSpec("P")
R = TypeVar("R")


def kernel(**options: Any) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return numba's decorator for a kernel that makes no arrays; ``options`` are njit's."""
    compile_with: Any = njit  # its types do not know _nrt
    decorate: Callable[[Callable[P, R]], Callable[P, R]] = compile_with(
        cache=True, _nrt=False, **options
    )
    return decorate
