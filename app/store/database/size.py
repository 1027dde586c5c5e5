"""Size of the database on its disk."""

from contextlib import suppress

import sqlalchemy as sa

from app.store.engine import Store


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
