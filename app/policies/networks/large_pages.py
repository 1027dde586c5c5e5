"""Arrays in large memory pages.

The weights that a decision reads lie in some 400 ordinary pages, which a processor has to look
up again after other work; one large page has room for all of them.
"""

from typing import Any, TypeVar, cast

import numpy as np

T = TypeVar("T")

PAGE = 1 << 21
"""Size of a large page [bytes]."""
LEAST = 1 << 22
"""Size from which on numpy asks the system for large pages [bytes]."""
LINE = 64
"""Size of a line of the caches, at which arrays begin [bytes]."""


def in_large_pages(value: T) -> T:
    """Return a nested tuple with its arrays copied into large pages, if the system has them."""
    block = np.empty(max(_size_of(value), LEAST) + PAGE, dtype=np.uint8)
    at = -block.ctypes.data % PAGE

    def copied(part: Any) -> Any:
        nonlocal at
        if isinstance(part, tuple):
            parts = [copied(one) for one in part]
            return type(part)(*parts) if hasattr(part, "_fields") else tuple(parts)
        if not isinstance(part, np.ndarray):
            return part
        there = block[at : at + part.nbytes].view(part.dtype).reshape(part.shape)
        there[:] = part
        at += _size_of(part)
        return there

    return cast(T, copied(value))


def _size_of(part: Any) -> int:
    """Return the number of bytes in whole lines that the arrays of a nested tuple take."""
    if isinstance(part, tuple):
        return sum(map(_size_of, part))
    return -(-part.nbytes // LINE) * LINE if isinstance(part, np.ndarray) else 0
