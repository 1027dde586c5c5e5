"""Files that exist wholly or not at all, also after a power failure."""

import errno
import os
from contextlib import suppress
from pathlib import Path

from app.storage_errors import StorageFull, StorageUnavailable

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of a full disk."""
UNREADABLE = (errno.EIO, errno.EROFS, errno.ESTALE)
"""Errors of a disk that fails, is mounted read-only or is no longer there."""


def write_durably(path: Path, content: bytes) -> None:
    """Write a file; one of that name stays until then.

    Raises:
        StorageFull: No room is left.
        StorageUnavailable: The disk fails, is mounted read-only or is no longer there.
    """
    unfinished = path.with_name(f"{path.name}.unfinished")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with unfinished.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        unfinished.replace(path)
        sync_folder(path.parent)
    except OSError as error:
        with suppress(OSError):  # a read-only folder
            unfinished.unlink(missing_ok=True)
        if error.errno in FULL:
            raise StorageFull(str(path.parent)) from error
        if error.errno in UNREADABLE:
            reason = f"disk I/O: {error.strerror}"
            raise StorageUnavailable(str(path.parent), reason) from error
        raise


def read_stored(path: Path) -> bytes:
    """Return the content of a file that must not pass for missing because a read fails.

    Raises:
        FileNotFoundError: It is missing.
        StorageUnavailable: It cannot be read for now.
    """
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise
    except OSError as error:
        raise StorageUnavailable(str(path), f"disk I/O: {error.strerror}") from error


def sync_folder(path: Path) -> None:
    """Keep the names of a folder's files also after a power failure."""
    folder = os.open(path, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
