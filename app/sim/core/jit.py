"""Compilation of kernels: cached on disk, and without reference counting.

Kernels take tuples of dozens of arrays, and counting their references at every call (an atomic
instruction per array) took more than half of a step's time. Without reference counting a kernel
cannot allocate arrays: its caller allocates the work space, once per batch.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from numba import typeof
from numba.core import config

from app.sim.core.dispatcher import Kernel
from app.sim.core.kernel_cache import kernel_cache

P = ParamSpec("P")
R = TypeVar("R")

FAST = {"contract", "nsz", "arcp"}
"""Fast-math flags: fused multiply-add, signs of zero, reciprocals."""
FAR = 1e3
"""Distance where nothing is near [m]."""


def _keep_by_version() -> None:
    """Keep compiled kernels in a folder of this version where the program has set none.

    numba would keep them beside the sources and use them after an update, in part.
    """
    if not config.CACHE_DIR:
        user = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
        config.CACHE_DIR = str(kernel_cache(Path(user) / "tandem"))


_keep_by_version()


def kernel(**options: Any) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator for kernels that allocate no arrays; ``options`` are njit's."""

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        compiled: Callable[P, R] = Kernel(function, targetoptions={"_nrt": False, **options})
        return compiled

    return decorate


def direct(compiled: Callable[..., R], arguments: tuple[Any, ...]) -> Callable[..., R]:
    """Return a kernel compiled for arguments of these types, without type checks.

    An ordinary call determines the types of all arguments; for tuples of a hundred arrays that
    takes five times as long as the rest of the call. The returned function checks nothing: an
    array of another type or layout is read as if it were of this one.

    Args:
        arguments: Arguments of the types of later calls.
    """
    dispatcher: Any = compiled
    kind_of: Any = typeof
    entry: Callable[..., R] = dispatcher.compile(tuple(kind_of(value) for value in arguments))
    return entry
