"""A private PostgreSQL server for tests: a folder of its own, a Unix socket, no password."""

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import sqlalchemy as sa

WAIT_S = 300.0
"""Far above the duration of a start or stop; only a hang reaches it."""
TEMPLATE = "migrated"
"""A database whose copies have tables and no rows."""
SMALL = "small"
"""Tablespace of a server with a small disk."""
_WITH_SMALL_DISK = (
    *("unshare", "--user", "--map-current-user", "--mount", "--keep-caps", "sh", "-c"),
    'mount -t tmpfs -o size="$0" tmpfs "$1" && shift && exec "$@"',
)
"""Runs a program beside a memory file system that only this program sees; needs no root."""
_CATALOGS = "pg_class", "pg_attrdef", "pg_constraint", "pg_trigger", "pg_proc"
_OBJECTS = "\nUNION ALL ".join(
    f"SELECT '{one} ' || oid || ' ' || xmin FROM {one} WHERE oid >= 16384" for one in _CATALOGS
)
_SCHEMA = f"""SELECT string_agg(one, ',' ORDER BY one) FROM (
    {_OBJECTS}
    UNION ALL SELECT 'column ' || attrelid || ' ' || attnum || ' ' || xmin
        FROM pg_attribute WHERE attrelid >= 16384
    UNION ALL SELECT 'rows ' || oid || ' ' || reltuples FROM pg_class WHERE oid >= 16384
    UNION ALL SELECT 'version ' || version_num FROM alembic_version
) AS parts (one)"""
"""Identifies a schema, its migration and its statistics: equal in all copies of a database."""
_OTHERS = """SELECT count(*) FROM pg_stat_activity
    WHERE datname = current_database() AND pid <> pg_backend_pid()"""
_SIZE = "SELECT sum(pg_total_relation_size(oid)) FROM pg_class WHERE oid >= 16384"
_TABLES = """SELECT tablename FROM pg_tables
    WHERE schemaname = 'public' AND tablename <> 'alembic_version'"""
_RESTART = "SELECT setval(seqrelid::regclass, seqstart, false) FROM pg_sequence"
MOST_GROWTH = 1 << 20
"""Growth of a database beyond which it is no longer used [bytes]."""


class PostgresqlServer:
    """A server that can be stopped, killed and started again with its data.

    Args:
        folder: A folder of the server's user.
        disk_bytes: Size of a disk of its own for the tablespace ``SMALL``, which is lost when
            the server stops; None: it has none. The write-ahead log is not on it.
    """

    def __init__(self, folder: Path, disk_bytes: int | None = None) -> None:
        self._folder, self._disk_bytes = folder, disk_bytes
        self._number = 0
        self._spare: str | None = None
        self._session: sa.Connection | None = None
        self._template: tuple[str, int] | None = None
        _run(
            "initdb",
            "-D",
            folder / "data",
            "-U",
            "tandem",
            "-E",
            "UTF8",
            "--no-sync",
            "-A",
            "trust",
        )
        if disk_bytes is not None:
            self._disk.mkdir()
            shutil.chown(self._disk, _user().get("user", os.geteuid()))
        self.start()
        if disk_bytes is not None:
            self.execute(f"CREATE TABLESPACE {SMALL} LOCATION '{self._disk}'")

    @property
    def _disk(self) -> Path:
        return self._folder / SMALL

    def start(self) -> None:
        """Start; returns when it answers."""
        options = ["-k", self._folder, "-c", "listen_addresses=", "-c", "fsync=off"]
        with (self._folder / "log").open("ab") as log:
            command = [_program("postgres"), "-D", self._folder / "data", *options]
            if self._disk_bytes is not None:
                command = [*_WITH_SMALL_DISK, str(self._disk_bytes), self._disk, *command]
            self._process = subprocess.Popen(
                command, stdout=log, stderr=log, cwd=self._folder, **_user()
            )
        engine = sa.create_engine(self.url("postgres"), poolclass=sa.NullPool)
        give_up = time.monotonic() + WAIT_S
        while True:
            try:
                engine.connect().close()
                return
            except sa.exc.OperationalError:
                assert self._process.poll() is None, (self._folder / "log").read_text()
                assert time.monotonic() < give_up
                time.sleep(0.05)

    def stop(self, how: signal.Signals = signal.SIGINT) -> None:
        """Stop; sessions end at once.

        Args:
            how: SIGINT for a fast shutdown, SIGQUIT for a crash with recovery at the start.
        """
        self._close_session()
        self._process.send_signal(how)
        self._process.wait(WAIT_S)

    def url(self, database: str) -> str:
        """Return the URL of a database."""
        return f"postgresql://tandem@/{database}?host={self._folder}"

    def fill_disk(self) -> None:
        """Write a file to the small disk until it is full."""
        rows = (self._disk_bytes or 0) // 1000
        try:
            self._write_to_disk(f"SELECT repeat('x', 1000) FROM generate_series(0, {rows})")
        except sa.exc.OperationalError as error:
            assert getattr(error.orig, "sqlstate", None) == "53100", error
        else:
            raise AssertionError("the disk is not full")

    def free_disk(self) -> None:
        """Remove the content of that file."""
        self._write_to_disk("SELECT WHERE false")

    def _write_to_disk(self, query: str) -> None:
        self.execute(f"COPY ({query}) TO '{self._disk}/ballast'")

    @contextmanager
    def database(self, template: str, tablespace: str = "pg_default") -> Iterator[str]:
        """Create a database and yield its URL; it is dropped at the end."""
        self._number += 1
        name = f"test{self._number}"
        self.execute(f"CREATE DATABASE {name} TEMPLATE {template} TABLESPACE {tablespace}")
        yield self.url(name)
        self.execute(f"DROP DATABASE {name} WITH (FORCE)")

    def emptied_database(self) -> str:
        """Return the URL of a database with the tables of ``TEMPLATE``, for one test at a time.

        It is that of the last call without its rows, or another copy where schema, statistics,
        size or open sessions differ from those of a copy. A copy takes ten times as long.
        """
        if self._spare is None or not self._empty(self._spare):
            self._close_session()
            if self._spare is not None:
                self.execute(f"DROP DATABASE {self._spare} WITH (FORCE)")
            self._number += 1
            self._spare = f"test{self._number}"
            self.execute(f"CREATE DATABASE {self._spare} TEMPLATE {TEMPLATE}")
            if self._template is None:
                with self._connection(self._spare) as copied:
                    self._template = _schema_and_size(copied)
        return self.url(self._spare)

    def _empty(self, name: str) -> bool:
        """Delete the rows of a database; returns whether it is like a copy then."""
        assert self._template is not None
        try:
            if self._session is None:
                self._session = self._connection(name)
                self._session.exec_driver_sql("SET session_replication_role = replica")
            schema, size = _schema_and_size(self._session)
            grown = size - self._template[1] > MOST_GROWTH
            if schema != self._template[0] or grown or self._session.scalar(sa.text(_OTHERS)):
                return False
            tables = self._session.scalars(sa.text(_TABLES))
            deleted = [f"DELETE FROM {one}" for one in tables]
            self._session.exec_driver_sql("; ".join([*deleted, _RESTART]))
        except sa.exc.DBAPIError:
            return False
        return True

    def _close_session(self) -> None:
        """Close the session that empties a database, if there is one."""
        if self._session is not None:
            self._session.close()
            self._session = None

    def _connection(self, database: str) -> sa.Connection:
        """Return a connection without transactions; the caller closes it."""
        engine = sa.create_engine(self.url(database), poolclass=sa.NullPool)
        return engine.connect().execution_options(isolation_level="AUTOCOMMIT")

    def execute(self, statement: str) -> None:
        """Execute a statement outside a transaction."""
        with self._connection("postgres") as connection:
            connection.execute(sa.text(statement))


def _schema_and_size(connection: sa.Connection) -> tuple[str, int]:
    return (
        str(connection.scalar(sa.text(_SCHEMA))),
        int(connection.scalar(sa.text(_SIZE)) or 0),
    )


@contextmanager
def postgresql_server(disk_bytes: int | None = None) -> Iterator[PostgresqlServer]:
    """Run a server; its folder is removed at the end."""
    with tempfile.TemporaryDirectory(prefix="tandem-pg-", dir="/tmp") as name:
        folder = Path(name)
        user = _user().get("user")
        if user is not None:
            shutil.chown(folder, user)
        server = PostgresqlServer(folder, disk_bytes)
        try:
            yield server
        finally:
            server.stop()


def _user() -> dict[str, Any]:
    """Return the user of the server as arguments of ``subprocess``; root must not be it."""
    if os.geteuid() != 0:
        return {}
    names = {entry.pw_name for entry in pwd.getpwall()}
    name = "postgres" if "postgres" in names else "nobody"
    return {"user": name, "group": pwd.getpwnam(name).pw_gid, "extra_groups": []}


def _program(name: str) -> str:
    """Return the path of a program of PostgreSQL; Debian keeps them out of the search path."""
    folders = sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    found = shutil.which(name, path=os.pathsep.join([os.environ["PATH"], *map(str, folders)]))
    assert found, f"no {name}: install PostgreSQL's server, such as the package postgresql"
    return found


def _run(program: str, *arguments: str | Path) -> None:
    done = subprocess.run(
        [_program(program), *arguments], capture_output=True, text=True, cwd="/", **_user()
    )
    assert done.returncode == 0, done.stderr
