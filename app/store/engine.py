"""The connection to the database: SQLite by default, PostgreSQL by URL.

SQLite runs with WAL, ``synchronous=FULL`` (a commit that was acknowledged survives a power
cut), a busy timeout and foreign keys. Writers take the write lock at once (BEGIN IMMEDIATE):
a transaction that reads first and writes later would otherwise fail under concurrency.
"""

import json
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy import event
from sqlalchemy.engine import make_url
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import ArgumentError, DatabaseError, NoSuchModuleError, OperationalError
from sqlalchemy.pool import ConnectionPoolEntry

from app.errors import (
    InvalidInput,
    ServiceError,
    StorageDamaged,
    StorageFull,
    StorageUnavailable,
)

logger = logging.getLogger(__name__)

BUSY_TIMEOUT_S = 10.0
"""Time for which a writer waits for another one [s]; a blob of 100 MB takes below one second.

The query ``?timeout=SECONDS`` of the URL sets another one. Requests end with a 503 after it;
workers and the supervisor repeat their writes for as long as it takes."""

WAL_SIZE_LIMIT = 64 * 1024 * 1024
"""Size to which the write-ahead log is cut after a large blob [bytes]."""

_PRAGMAS = (
    "PRAGMA journal_mode = WAL",
    "PRAGMA synchronous = FULL",
    "PRAGMA foreign_keys = ON",
    f"PRAGMA journal_size_limit = {WAL_SIZE_LIMIT}",
)


_FULL = ("disk is full", "no space left", "disk full", "quota exceeded")
_DAMAGED = ("malformed", "not a database")


class Store:
    """One database, shared by the threads of a process. Every process opens its own.

    Args:
        database_url: SQLAlchemy URL, such as ``sqlite:////var/lib/tandem/tandem.db``.

    Raises:
        InvalidInput: The URL names no database that works here.
    """

    def __init__(self, database_url: str) -> None:
        self._url = _checked_url(database_url)
        try:
            self.engine = sa.create_engine(
                self._url,
                json_serializer=_to_json,
                json_deserializer=_from_json,
                connect_args=self._connect_args(),
            )
        except (NoSuchModuleError, ModuleNotFoundError) as error:
            rule = f"needs a database driver that is not installed ({error})"
            raise InvalidInput("database_url", self.shown_url, rule) from error
        if self._url.get_backend_name() == "sqlite":
            event.listen(self.engine, "connect", _prepare_connection)
            event.listen(self.engine, "begin", _begin)

    @property
    def url(self) -> str:
        """The URL with its password, for child processes; SQLite paths are absolute."""
        return self._url.render_as_string(hide_password=False)

    @property
    def shown_url(self) -> str:
        """The URL without its password, for messages and logs."""
        return self._url.render_as_string(hide_password=True)

    @property
    def sqlite_path(self) -> Path | None:
        """The database file; None for other databases."""
        is_sqlite = self._url.get_backend_name() == "sqlite"
        return Path(self._url.database or "") if is_sqlite else None

    def _connect_args(self) -> dict[str, Any]:
        waits = self.sqlite_path is None or "timeout" in self._url.query
        return {} if waits else {"timeout": BUSY_TIMEOUT_S}

    @contextmanager
    def reading(self) -> Iterator[sa.Connection]:
        """Open a transaction that sees one consistent state and writes nothing.

        Raises:
            StorageUnavailable: The database does not answer.
        """
        with self._transaction(writes=False) as connection:
            yield connection

    @contextmanager
    def writing(self) -> Iterator[sa.Connection]:
        """Open a transaction that holds the write lock; commits on a normal exit.

        Raises:
            StorageFull: No room is left; nothing was written.
            StorageUnavailable: The database does not answer; nothing was written.
        """
        with self._transaction(writes=True) as connection:
            yield connection

    def check_writable(self) -> None:
        """Write something that changes nothing.

        Raises:
            StorageFull: No room is left.
            StorageUnavailable: The database takes no writes.
        """
        same = sa.text("UPDATE alembic_version SET version_num = version_num")
        with self.writing() as connection:
            connection.execute(same)

    @contextmanager
    def _transaction(self, *, writes: bool) -> Iterator[sa.Connection]:
        try:
            with self.engine.connect() as plain:
                connection = plain.execution_options(tandem_writes=writes)
                with connection.begin():
                    yield connection
        except DatabaseError as error:
            explained = self._explained(error)
            if explained is None:
                raise
            raise explained from error

    def _explained(self, error: DatabaseError) -> ServiceError | None:
        """Return the storage error of a driver's error; None for another kind of error."""
        reason = str(error.orig)
        if any(text in reason.lower() for text in _FULL):
            return StorageFull(self.shown_url)
        if any(text in reason for text in _DAMAGED):
            return StorageDamaged(self.shown_url, reason)
        if isinstance(error, OperationalError):
            return StorageUnavailable(self.shown_url, reason)
        return None

    def close(self) -> None:
        """Close every pooled connection."""
        self.engine.dispose()


def _checked_url(database_url: str) -> sa.URL:
    try:
        url = make_url(database_url)
    except ArgumentError as error:
        rule = "must be a database URL, such as sqlite:////data/tandem.db"
        raise InvalidInput("database_url", database_url, rule) from error
    if url.get_backend_name() not in ("sqlite", "postgresql"):
        rule = "must name a database that Tandem knows"
        shown = url.render_as_string(hide_password=True)
        raise InvalidInput("database_url", shown, rule, ("sqlite", "postgresql"))
    if url.get_backend_name() == "sqlite":
        if not url.database or url.database == ":memory:" or url.database.startswith("file:"):
            rule = "must name a file, because workers open it from their own processes"
            raise InvalidInput("database_url", database_url, rule)
        path = Path(url.database).absolute()
        if not path.parent.is_dir():
            rule = f"must lie in a folder that exists; there is no {path.parent}"
            raise InvalidInput("database_url", database_url, rule)
        url = url.set(database=str(path))
    return url


def _to_json(value: Any) -> str:
    return json.dumps(value, allow_nan=False, ensure_ascii=False)


def _from_json(text: str) -> Any:
    """Return stored JSON; nothing where it cannot be read, so that other rows still are."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        logger.error("JSON in the database is damaged: %.60r", text)
        return {}


def _prepare_connection(connection: DBAPIConnection, _entry: ConnectionPoolEntry) -> None:
    # The driver's own implicit BEGIN comes too late and is never IMMEDIATE: switch it off.
    connection.isolation_level = None
    # One damaged character must not keep a whole list from being read.
    connection.text_factory = partial(str, encoding="utf-8", errors="replace")
    cursor = connection.cursor()
    for pragma in _PRAGMAS:
        cursor.execute(pragma)
    cursor.close()


def _begin(connection: sa.Connection) -> None:
    writes = connection.get_execution_options().get("tandem_writes", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")
