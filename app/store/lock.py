"""One server per data folder and database.

The lock is the kernel's (``flock``): it ends with the process that holds it, however that
dies, so there is never a stale one to remove and no process id to trust. The id inside the
file is for people.
"""

import fcntl
import os
from pathlib import Path

from app.errors import Conflict
from app.store.engine import Store


class ServerLock:
    """The right to be the one server of a data folder and of a database.

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

    def acquire(self) -> None:
        """Take the lock, or say who has it.

        Raises:
            Conflict: Another server holds it.
        """
        if self._files:
            return
        try:
            for path in self._paths:
                self._files.append(_lock(path))
        except Conflict:
            self.release()
            raise

    def release(self) -> None:
        """Give the lock back; harmless when it is not held."""
        while self._files:
            os.close(self._files.pop())


def _lock(path: Path) -> int:
    path.parent.mkdir(parents=True, exist_ok=True)
    file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        holder = os.read(file, 32).decode(errors="replace").strip() or "unknown"
        os.close(file)
        raise Conflict(
            f"another Tandem server (process {holder}) already uses {path.parent}: stop it, or "
            "give this one a folder of its own with TANDEM_DATA"
        ) from error
    os.ftruncate(file, 0)
    os.pwrite(file, f"{os.getpid()}\n".encode(), 0)
    return file
