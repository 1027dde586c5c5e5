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


class PostgresqlServer:
    """A server that can be stopped, killed and started again with its data.

    Args:
        folder: A folder of the server's user.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._number = 0
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
        self.start()

    def start(self) -> None:
        """Start; returns when it answers."""
        options = ["-k", self._folder, "-c", "listen_addresses=", "-c", "fsync=off"]
        with (self._folder / "log").open("ab") as log:
            command = [_program("postgres"), "-D", self._folder / "data", *options]
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
        self._process.send_signal(how)
        self._process.wait(WAIT_S)

    def url(self, database: str) -> str:
        """Return the URL of a database."""
        return f"postgresql://tandem@/{database}?host={self._folder}"

    @contextmanager
    def database(self, template: str = TEMPLATE) -> Iterator[str]:
        """Create a database and yield its URL; it is dropped at the end."""
        self._number += 1
        name = f"test{self._number}"
        self.execute(f"CREATE DATABASE {name} TEMPLATE {template}")
        yield self.url(name)
        self.execute(f"DROP DATABASE {name} WITH (FORCE)")

    def execute(self, statement: str) -> None:
        """Execute a statement outside a transaction."""
        engine = sa.create_engine(self.url("postgres"), poolclass=sa.NullPool)
        with engine.connect().execution_options(isolation_level="AUTOCOMMIT") as connection:
            connection.execute(sa.text(statement))


@contextmanager
def postgresql_server() -> Iterator[PostgresqlServer]:
    """Run a server; its folder is removed at the end."""
    with tempfile.TemporaryDirectory(prefix="tandem-pg-", dir="/tmp") as name:
        folder = Path(name)
        user = _user().get("user")
        if user is not None:
            shutil.chown(folder, user)
        server = PostgresqlServer(folder)
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
