"""Size of the database on its disk; free pages of a SQLite file are given back.

A file that an earlier Tandem made keeps them for later rows, until a backup of it is restored.
"""

from contextlib import suppress

import sqlalchemy as sa

from app.store.engine import Store

MIN_FREE_BYTES = 16 * 1024 * 1024
"""Free pages of a SQLite file that stay, for the next rows [bytes]."""
MAX_BYTES_AT_ONCE = 8 * 1024 * 1024
"""Greatest decrease of a SQLite file at once, for which other writers wait [bytes]."""


def size_of(store: Store) -> int:
    """Return the size of the database, of a SQLite file with its write-ahead log [bytes].

    Raises:
        StorageUnavailable: The database does not answer.
    """
    if store.sqlite_path is None:
        size = sa.func.pg_database_size(sa.func.current_database())
        with store.reading() as connection:
            return int(connection.execute(sa.select(size)).scalar_one())
    total = 0
    for ending in ("", "-wal"):
        with suppress(FileNotFoundError):
            file = store.sqlite_path.with_name(store.sqlite_path.name + ending)
            total += file.stat().st_size
    return total


def shrink(store: Store) -> bool:
    """Give free pages of a SQLite file back to the disk; return whether there are more.

    Raises:
        StorageFull: No room is left for the moved pages.
    """
    if store.sqlite_path is None:
        return False
    with store.reading() as connection:
        can_shrink = _number(connection, "auto_vacuum") == 2  # incremental
        size = _number(connection, "page_size")
        n_pages = _number(connection, "freelist_count") - MIN_FREE_BYTES // size
    if not can_shrink or n_pages <= 0:
        return False
    most = MAX_BYTES_AT_ONCE // size
    with store.writing() as connection:
        for _ in range(min(n_pages, most)):  # the driver ends the statement after one page
            connection.exec_driver_sql("PRAGMA incremental_vacuum(1)")
    return n_pages > most


def _number(connection: sa.Connection, pragma: str) -> int:
    return int(connection.exec_driver_sql(f"PRAGMA {pragma}").scalar_one())
