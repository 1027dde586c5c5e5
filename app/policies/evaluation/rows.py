"""What a protocol tells while it runs: each row of its result as soon as it is known."""

from collections.abc import Callable, Mapping
from typing import Any

Row = Mapping[str, Any]
"""One row of a result."""
OnRow = Callable[[int, int, Row], None]
"""Called with the number of rows done, the number of rows in all, and the newest row."""


def ignore_row(_done: int, _total: int, _row: Row) -> None:
    """Tell nobody."""
