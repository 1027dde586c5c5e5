"""Lock for one server per data folder and database.

The lock is the kernel's (``flock``) and ends with its process, so that it is never stale. The
process id in the file is for error messages. A PostgreSQL database has an advisory lock, too.
"""

import fcntl
import os
from pathlib import Path

import sqlalchemy as sa

from app.errors import Conflict, InvalidInput
from app.store.engine import Store

_POSTGRESQL_KEY = 0x74616E64656D
"""Number of the advisory lock: ``tandem`` in ASCII."""


class ServerLock:
    """Exclusive use of a data folder and a database.

    Args:
        store: The database.
        data_dir: The data folder.
    """

    def __init__(self, store: Store, data_dir: Path) -> None:
        paths = [data_dir.absolute() / "server.lock"]
        if store.sqlite_path is not None and store.sqlite_path.parent != data_dir.absolute():
            paths.append(store.sqlite_path.with_name(store.sqlite_path.name + ".lock"))
        self._paths = tuple(paths)
        self._files: list[int] = []
        self._store = store
        self._session: sa.Connection | None = None

    def acquire(self) -> None:
        """Acquire the lock.

        Raises:
            Conflict: Another server holds it.
            InvalidInput: The folder cannot be written to.
        """
        if self._files:
            return
        try:
            for path in self._paths:
                self._files.append(_lock(path))
            if self._store.sqlite_path is None:
                self._session = _lock_postgresql(self._store)
        except (Conflict, InvalidInput):
            self.release()
            raise

    def release(self) -> None:
        """Release the lock, if it is held."""
        if self._session is not None:
            self._session.invalidate()  # ends the session and the lock with it
            self._session.close()
            self._session = None
        while self._files:
            os.close(self._files.pop())


def _lock_postgresql(store: Store) -> sa.Connection:
    session = store.engine.connect().execution_options(isolation_level="AUTOCOMMIT")
    key = {"key": _POSTGRESQL_KEY}
    if session.execute(sa.text("SELECT pg_try_advisory_lock(:key)"), key).scalar():
        return session
    session.close()
    raise Conflict(f"another Tandem server already uses {store.shown_url}: stop it first")


def _lock(path: Path) -> int:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    except OSError as error:
        rule = f"must be a folder that this process may write to ({error.strerror})"
        raise InvalidInput("TANDEM_DATA", str(path.parent), rule) from error
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        holder = os.read(file, 32).decode(errors="replace").strip() or "unknown"
        os.close(file)
        raise Conflict(
            f"another Tandem server (process {holder}) already uses {path.parent}: stop it, or "
            "set another folder with TANDEM_DATA"
        ) from error
    os.ftruncate(file, 0)
    os.pwrite(file, f"{os.getpid()}\n".encode(), 0)
    return file
