"""Waiting for what another thread or process does."""

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def wait_until(
    read: Callable[[], T], holds: Callable[[T], object] = bool, *, within_s: float = 60.0
) -> T:
    """Return what a function returns, once it holds.

    Args:
        read: Called every 50 ms.
        holds: Whether the result of ``read`` is what is waited for.
        within_s: Time limit, far above what it takes; only a hang reaches it [s].
    """
    give_up = time.monotonic() + within_s
    while not holds(found := read()):
        assert time.monotonic() < give_up, f"not reached within {within_s:g} s: {found}"
        time.sleep(0.05)
    return found
