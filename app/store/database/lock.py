"""Lock for one server per data folder and SQLite file.

The lock is the kernel's (``flock``) and ends with its process, so that it is never stale. The
process id in the file is for error messages. ``lease.py`` covers several machines.
"""

import fcntl
import os
import socket
from pathlib import Path

from app.errors import Conflict, InvalidInput
from app.store.engine import Store

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
_LENGTH = 32
"""Length of the process id in the file, which replaces an earlier one without growing it."""


class ServerLock:
    """Exclusive use of a data folder and a SQLite file."""

    def __init__(self, store: Store, data_dir: Path) -> None:
        paths = [data_dir.absolute() / "server.lock"]
        if store.sqlite_path is not None:  # beside the file itself: folders differ, links too
            file = store.sqlite_path.resolve()
            paths.append(file.with_name(file.name + ".lock"))
        self._paths = tuple(paths)
        self._files: list[int] = []
        self._is_sqlite = store.sqlite_path is not None

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
        except (Conflict, InvalidInput):
            self.release()
            raise

    def release(self) -> None:
        """Release the lock, if it is held."""
        while self._files:
            os.close(self._files.pop())

    @property
    def place(self) -> str:
        """Identifies the locked file: no other server has this place while the lock is held.

        PostgreSQL: the machine, its start, and the number of the file in the data folder.
        """
        if self._is_sqlite:
            return "sqlite"
        start = _BOOT_ID.read_text().strip() if _BOOT_ID.exists() else "unknown"
        file = os.fstat(self._files[0])
        return f"{socket.gethostname()} {start} {file.st_dev}:{file.st_ino}"


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
        holder = os.read(file, _LENGTH).decode(errors="replace").strip() or "unknown"
        os.close(file)
        raise Conflict(
            f"another Tandem server (process {holder}) already uses {path.parent}: stop it, or "
            "set another folder with TANDEM_DATA"
        ) from error
    try:
        os.pwrite(file, f"{os.getpid()}\n".ljust(_LENGTH).encode(), 0)
    except OSError:  # no room is left; the lock does not need it
        os.ftruncate(file, 0)
    return file
