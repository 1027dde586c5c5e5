"""Space reserved in the database, so that jobs can be ended or cancelled when it is full."""

from collections.abc import Callable
from typing import TypeVar

import sqlalchemy as sa

from app.storage_errors import StorageFull
from app.store.database.tables import reserve
from app.store.engine import Store

RESERVE_BYTES = 128 * 1024
"""Reserved space [bytes]."""

Result = TypeVar("Result")


def fill_reserve(store: Store) -> None:
    """Reserve the space, unless it is reserved.

    Raises:
        StorageFull: No room is left.
    """
    with store.writing() as connection:
        if connection.execute(sa.select(reserve.c.id)).first() is None:
            filler = bytes(RESERVE_BYTES)
            connection.execute(sa.insert(reserve).values(id=1, filler=filler))


def write_with_reserve(store: Store, write: Callable[[sa.Connection], Result]) -> Result:
    """Write in a transaction; in a full database again, with the reserved space freed.

    The supervisor reserves it again once there is room.

    Raises:
        StorageFull: The reserved space was not sufficient.
    """
    try:
        with store.writing() as connection:
            return write(connection)
    except StorageFull:
        with store.writing() as connection:
            connection.execute(sa.delete(reserve))
            return write(connection)
