"""How the kernels are compiled: cached on disk, and without counting references.

A kernel is handed tuples of dozens of arrays, and counting their references at every call (an
atomic instruction per array) took more than half of a step's time. Without the counting a
kernel can make no arrays: what it works on is made by its caller, once per batch.
"""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

from numba import njit, typeof

P = ParamSpec("P")
R = TypeVar("R")


def kernel(**options: Any) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return numba's decorator for a kernel that makes no arrays; ``options`` are njit's."""
    compile_with: Any = njit  # its types do not know _nrt
    decorate: Callable[[Callable[P, R]], Callable[P, R]] = compile_with(
        cache=True, _nrt=False, **options
    )
    return decorate


def direct(compiled: Callable[..., R], arguments: tuple[Any, ...]) -> Callable[..., R]:
    """Return a kernel compiled for arguments of these types, without looking at types again.

    At every ordinary call numba works out the types of all arguments anew; for tuples of a
    hundred arrays that takes five times as long as the rest of the call. What is returned
    checks nothing: an array of another type or layout is read as if it were of this one.

    Args:
        compiled: Kernel.
        arguments: What it will be called with.
    """
    dispatcher: Any = compiled
    kind_of: Any = typeof
    entry: Callable[..., R] = dispatcher.compile(tuple(kind_of(value) for value in arguments))
    return entry
