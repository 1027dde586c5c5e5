"""Temporary folders of processes; those of killed processes are removed by later ones.

A process holds a lock of its folder (``flock``), which ends with the process. A folder without
a lock has no owner any more.
"""

import fcntl
import os
import shutil
import tempfile
from contextlib import suppress
from pathlib import Path

_FLAGS = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC


class TemporaryFolder:
    """A new folder of this process; those that killed ones left beside it are removed.

    Args:
        prefix: Start of its name; nothing else in ``parent`` has such a name.
        parent: Where it is made; by default the system's folder for temporary files.
    """

    def __init__(self, prefix: str, parent: Path | None = None) -> None:
        parent = parent or Path(tempfile.gettempdir())
        remove_left(parent, prefix)
        while (made := _made(parent, prefix)) is None:
            continue
        self.path = made[0]
        """The folder."""
        self._lock: int | None = made[1]

    def close(self) -> None:
        """Remove the folder; may be called twice."""
        shutil.rmtree(self.path, ignore_errors=True)
        lock, self._lock = self._lock, None
        if lock is not None:
            os.close(lock)


def remove_left(parent: Path, prefix: str) -> None:
    """Remove the folders that killed processes of this user have left."""
    for left in parent.glob(f"{prefix}*"):
        with suppress(OSError):  # in use, another user's, removed since, or no locks here
            lock = os.open(left, _FLAGS)
            try:
                if os.fstat(lock).st_uid == os.geteuid():
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(left)
            finally:
                os.close(lock)


def _made(parent: Path, prefix: str) -> tuple[Path, int] | None:
    """Return a new folder with its lock; None where another process removed it before."""
    path = Path(tempfile.mkdtemp(prefix=prefix, dir=parent))
    with suppress(FileNotFoundError):
        lock = os.open(path, _FLAGS)
        with suppress(OSError):  # a file system without locks
            fcntl.flock(lock, fcntl.LOCK_SH)
        if path.exists():
            return path, lock
        os.close(lock)
    return None
