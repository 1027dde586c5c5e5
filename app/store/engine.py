"""The connection to the database: SQLite by default, PostgreSQL by URL.

SQLite runs with WAL, ``synchronous=FULL`` (a commit that was acknowledged survives a power
cut), a busy timeout and foreign keys. A writer takes the database's write lock at its start
(``BEGIN IMMEDIATE``; an advisory lock on PostgreSQL), so that a transaction that reads first
and writes later behaves alike on both.
"""

import copy
import json
import logging
import math
import os
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import sqlalchemy as sa
from sqlalchemy import event
from sqlalchemy.engine import make_url
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import (
    ArgumentError,
    DatabaseError,
    DataError,
    NoSuchModuleError,
    OperationalError,
    ProgrammingError,
)
from sqlalchemy.pool import ConnectionPoolEntry

from app.errors import InvalidInput, ServiceError
from app.storage_errors import StorageDamaged, StorageFull, StorageUnavailable

logger = logging.getLogger(__name__)

BUSY_TIMEOUT_S = 10.0
"""Time for which a writer waits for another one [s]; a blob of 100 MB takes below one second.

The query ``?timeout=SECONDS`` of the URL sets another one. Requests end with a 503 after it;
workers and the supervisor repeat their writes for as long as it takes."""
MAX_TIMEOUT_S = 3600.0
"""Greatest such time [s]."""

MAX_PATH_BYTES = 504
"""Longest path of a file that SQLite opens: 512 with the ending of its journal [bytes]."""

WAL_SIZE_LIMIT = 64 * 1024 * 1024
"""Size to which the write-ahead log is cut after a large blob [bytes]."""

_PAUSED_S = 30
"""Longest silence of a client in a transaction of PostgreSQL, such as a paused server [s]."""
_WRITE_LOCK = 0x74616E64656D
"""Number of PostgreSQL's advisory lock: ``tandem`` in ASCII."""
_POSTGRESQL_ARGUMENTS = {
    "connect_timeout": 10,
    "keepalives_idle": 30,
    "tcp_user_timeout": 1000 * int(BUSY_TIMEOUT_S),
    "application_name": "tandem",
    "options": f"-c lock_timeout={BUSY_TIMEOUT_S:.0f}s "
    f"-c idle_in_transaction_session_timeout={_PAUSED_S}s",
}
"""Arguments of libpq; those in the URL take precedence."""

_PRAGMAS = (
    "PRAGMA journal_mode = WAL",
    "PRAGMA synchronous = FULL",
    "PRAGMA foreign_keys = ON",
    f"PRAGMA journal_size_limit = {WAL_SIZE_LIMIT}",
)


_SECRETS = ("password", "sslpassword")
"""Parameters of a URL that no message contains."""
_FULL = ("disk is full", "no space left", "disk full", "quota exceeded")
_NO_INDEX = "SQLITE_IOERR_SHMSIZE"
"""Name of SQLite's error where no room is left for the index of the write-ahead log, which the
first connection makes; its text is that of a disk error."""
_NO_RIGHTS = "42501"
_LOST = ("25P03", "25006")
"""SQLSTATE of a transaction that was ended in a pause, and of a write to a replica."""
_DAMAGED = ("disk image is malformed", "malformed database schema", "not a database")


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
            self.engine = _create_engine(self._url)
        except (NoSuchModuleError, ModuleNotFoundError) as error:
            rule = (
                f"needs a driver that is not installed ({error}): install the extra 'postgres'"
            )
            raise InvalidInput("database_url", self.shown_url, rule) from error
        self._fence: Callable[[sa.Connection], object] | None = None
        self._observer: sqlite3.Connection | None = None

    def fenced(self, fence: Callable[[sa.Connection], object]) -> "Store":
        """Return this database with a condition on writing.

        Args:
            fence: Called at the start of each writing transaction; raises to refuse it.
        """
        view = copy.copy(self)
        view._fence = fence
        return view

    @property
    def url(self) -> str:
        """The URL with its password, for child processes; SQLite paths are absolute."""
        return self._url.render_as_string(hide_password=False)

    @property
    def shown_url(self) -> str:
        """The URL without its password, for messages and logs."""
        return _shown(self._url)

    @property
    def sqlite_path(self) -> Path | None:
        """The database file; None for other databases."""
        is_sqlite = self._url.get_backend_name() == "sqlite"
        return Path(self._url.database or "") if is_sqlite else None

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
            if self._fence is not None:
                self._fence(connection)
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

    def commit_number(self) -> int | None:
        """Return a number that differs after a commit of any process, without waiting.

        None: unknown, as on PostgreSQL.
        """
        if self.sqlite_path is None:
            return None
        try:
            if self._observer is None:
                address = f"{self.sqlite_path.as_uri()}?mode=rw"
                self._observer = sqlite3.connect(
                    address, timeout=0.0, uri=True, check_same_thread=False
                )
            # It counts commits of other connections, and this one makes none.
            number: int = self._observer.execute("PRAGMA data_version").fetchone()[0]
        except sqlite3.Error:
            return None
        return number

    def now(self, connection: sa.Connection) -> datetime:
        """Return the time of the database's machine, which all servers share."""
        if self.sqlite_path is not None:
            return datetime.now(UTC)
        time: datetime = connection.execute(sa.select(sa.func.clock_timestamp())).scalar_one()
        return time.astimezone(UTC)

    @contextmanager
    def _transaction(self, *, writes: bool) -> Iterator[sa.Connection]:
        try:
            with self.engine.connect() as plain:
                connection = plain.execution_options(tandem_writes=writes)
                with connection.begin():
                    yield connection
        except sa.exc.TimeoutError as error:
            reason = "all connections of this process wait for it"
            raise StorageUnavailable(self.shown_url, reason) from error
        except DatabaseError as error:
            explained = self._explained(error)
            if explained is None:
                raise
            raise explained from error
        except UnicodeEncodeError as error:  # of a command line; requests are checked before
            raise InvalidInput("text", error.object, "must be text in UTF-8") from error

    def _explained(self, error: DatabaseError) -> ServiceError | None:
        """Return the storage error of a driver's error; None for another kind of error."""
        reason = str(error.orig).strip()
        name = getattr(error.orig, "sqlite_errorname", None)
        if name == _NO_INDEX or any(text in reason.lower() for text in _FULL):
            return StorageFull(self.shown_url)
        if any(text in reason for text in _DAMAGED):
            return StorageDamaged(self.shown_url, reason)
        if isinstance(error, DataError) and "NUL" in reason:
            rule = "must not contain the character NUL, which PostgreSQL cannot store"
            return InvalidInput("text", "\\0", rule)
        sqlstate = getattr(error.orig, "sqlstate", None)
        if sqlstate == _NO_RIGHTS:
            rule = f"must name the owner of the database ({reason})"
            return InvalidInput("database_url", self.shown_url, rule)
        if isinstance(error, ProgrammingError) and error.statement is None:
            rule = f"must have parameters that its driver takes ({reason})"
            return InvalidInput("database_url", self.shown_url, rule)
        lost = error.connection_invalidated or sqlstate in _LOST
        if lost or isinstance(error, OperationalError):
            return StorageUnavailable(self.shown_url, reason)
        return None

    def close(self) -> None:
        """Close every connection."""
        if self._observer is not None:
            self._observer.close()
            self._observer = None
        self.engine.dispose()


def _shown(url: sa.URL) -> str:
    return url.difference_update_query(_SECRETS).render_as_string(hide_password=True)


def _checked_url(database_url: str) -> sa.URL:
    try:
        url = make_url(database_url)
    except (ArgumentError, ValueError):  # their texts have parts of the URL
        rule = (
            "must be a database URL, such as sqlite:////data/tandem.db or "
            "postgresql://tandem:PASSWORD@host/db, with %40 for @ and %2F for / in the password"
        )
        shown = "***" if set(database_url) & set("@=") else database_url
        raise InvalidInput("database_url", shown, rule) from None
    if url.get_backend_name() not in ("sqlite", "postgresql"):
        rule = "must name a database that Tandem knows"
        raise InvalidInput("database_url", _shown(url), rule, ("sqlite", "postgresql"))
    if url.get_backend_name() == "sqlite":
        if not url.database or url.database == ":memory:" or url.database.startswith("file:"):
            rule = "must name a file, because workers open it from their own processes"
            raise InvalidInput("database_url", database_url, rule)
        path = Path(url.database).absolute()
        if not path.parent.is_dir():
            rule = f"must lie in a folder that exists; there is no {path.parent}"
            raise InvalidInput("database_url", database_url, rule)
        if (length := len(os.fsencode(path))) > MAX_PATH_BYTES:
            rule = f"must name a file by at most {MAX_PATH_BYTES} bytes, not {length}"
            raise InvalidInput("database_url", database_url, rule)
        unknown = sorted(set(url.query) - {"timeout"})
        if unknown:
            rule = "is not a parameter of a SQLite file"
            raise InvalidInput("database_url", unknown[0], rule, ("timeout",))
        url = url.set(database=str(path))
    return url


def _longest_wait(url: sa.URL) -> float:
    """Return the time for which a writer of a SQLite file waits, in (0, MAX_TIMEOUT_S] [s]."""
    given = str(url.query.get("timeout", BUSY_TIMEOUT_S))
    try:
        longest = float(given)
    except ValueError:
        longest = math.nan
    if not 0.0 < longest <= MAX_TIMEOUT_S:
        rule = f"must lie in (0, {MAX_TIMEOUT_S:g}] s"
        raise InvalidInput("database_url: timeout", given, rule)
    return longest


def _create_engine(url: sa.URL) -> sa.Engine:
    as_json = {"json_serializer": _to_json, "json_deserializer": _from_json}
    if url.get_backend_name() == "sqlite":
        longest = _longest_wait(url)
        engine = sa.create_engine(
            url, **as_json, connect_args={"timeout": longest}, pool_timeout=longest
        )
        event.listen(engine, "connect", _prepare_connection)
        event.listen(engine, "begin", _begin)
        return engine
    arguments = {k: v for k, v in _POSTGRESQL_ARGUMENTS.items() if k not in url.query}
    # Tested before use: a restarted database has ended the pooled connections.
    engine = sa.create_engine(
        url, **as_json, connect_args=arguments, pool_pre_ping=True, pool_timeout=BUSY_TIMEOUT_S
    )
    event.listen(engine, "begin", _begin_postgresql)
    return engine


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
    if cursor.execute("PRAGMA page_count").fetchone() == (0,):  # it holds from the first page
        cursor.execute("PRAGMA auto_vacuum = INCREMENTAL")
    for pragma in _PRAGMAS:
        cursor.execute(pragma)
    cursor.close()


def _begin(connection: sa.Connection) -> None:
    writes = connection.get_execution_options().get("tandem_writes", False)
    connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")


def _begin_postgresql(connection: sa.Connection) -> None:
    if connection.get_execution_options().get("tandem_writes", False):
        connection.exec_driver_sql(f"SELECT pg_advisory_xact_lock({_WRITE_LOCK})")
    else:
        connection.exec_driver_sql("SET TRANSACTION ISOLATION LEVEL REPEATABLE READ READ ONLY")
