"""Callback that reports each row of a result as soon as it is measured."""

from collections.abc import Callable, Mapping
from typing import Any

Row = Mapping[str, Any]
"""One row of a result."""
OnRow = Callable[[int, int, Row], None]
"""Called with the number of finished rows, the total number of rows, and the newest row."""


def ignore_row(_done: int, _total: int, _row: Row) -> None:
    """Do nothing: the default callback."""
