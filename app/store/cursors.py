"""Pages of lists; a cursor is opaque text with the number of the last item of a page."""

import base64
import binascii
from collections.abc import Sequence
from typing import Any

import sqlalchemy as sa

from app.errors import InvalidInput

MAX_INTEGER = 2**63 - 1
"""Greatest integer of the database."""
MAX_NUMBER = 2**31 - 1
"""Greatest running number, such as of a job or an attempt: an INTEGER of PostgreSQL."""
MAX_PAGE = 200
"""Longest page of a list."""


def encode_cursor(number: int) -> str:
    """Return the cursor of the page below ``number``."""
    return base64.urlsafe_b64encode(f"n{number}".encode()).decode().rstrip("=")


def decode_cursor(cursor: str | None, greatest: int = MAX_NUMBER) -> int | None:
    """Return the number of a cursor; None for the first page.

    Args:
        greatest: Greatest number that the list has.

    Raises:
        InvalidInput: The text was not made by :func:`encode_cursor`.
    """
    if cursor is None:
        return None
    try:
        text = base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)).decode()
        number = int(text.removeprefix("n"))
        if not 0 <= number <= greatest:
            raise ValueError(number)
    except (binascii.Error, ValueError) as error:
        rule = "must be a cursor that an earlier page returned"
        raise InvalidInput("cursor", cursor, rule) from error
    return number


def read_page(
    connection: sa.Connection,
    query: sa.Select[Any],
    number: sa.ColumnElement[int],
    cursor: str | None,
    limit: int,
    greatest: int = MAX_NUMBER,
) -> tuple[Sequence[sa.RowMapping], str | None]:
    """Return the rows of a page, highest number first, and the cursor of the next page.

    Raises:
        InvalidInput: The limit lies outside [1, MAX_PAGE], or the cursor is invalid.
    """
    if not 1 <= limit <= MAX_PAGE:
        raise InvalidInput("limit", limit, f"must lie in [1, {MAX_PAGE}]")
    below = decode_cursor(cursor, greatest)
    if below is not None:
        query = query.where(number < below)
    query = query.order_by(number.desc()).limit(limit + 1)
    rows = connection.execute(query).mappings().all()
    more = len(rows) > limit
    return rows[:limit], encode_cursor(rows[limit - 1][number]) if more else None
