"""Stores of files that are named by their SHA-256; a folder is one."""

from collections.abc import Collection
from pathlib import Path
from typing import Protocol

from app.durable_files import read_stored, write_durably

SUFFIX = ".safetensors"


class FileStore(Protocol):
    """Files of one training."""

    def write(self, sha256: str, content: bytes) -> None:
        """Store a file that exists wholly or not at all, also after a power failure.

        Raises:
            StorageFull: No room is left.
        """

    def read(self, sha256: str) -> bytes:
        """Return a file, which may be damaged.

        Raises:
            FileNotFoundError: It is missing.
            StorageUnavailable: It cannot be read for now.
        """

    def keep(self, names: Collection[str]) -> None:
        """Delete all files except some, by SHA-256."""


class FileFolder:
    """A folder as a store; no other files are in it.

    Args:
        folder: The folder; made with the first file.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def path(self, sha256: str) -> Path:
        """Return the path of a file."""
        return self._folder / f"{sha256}{SUFFIX}"

    def write(self, sha256: str, content: bytes) -> None:
        """Store a file; see :class:`FileStore`."""
        write_durably(self.path(sha256), content)

    def read(self, sha256: str) -> bytes:
        """Return a file; see :class:`FileStore`."""
        return read_stored(self.path(sha256))

    def keep(self, names: Collection[str]) -> None:
        """Delete all files except some; see :class:`FileStore`."""
        for path in self._folder.glob("*"):
            if path.name.removesuffix(SUFFIX) not in names:
                path.unlink(missing_ok=True)

    def size(self) -> int:
        """Return the size of all files [bytes]."""
        return sum(path.stat().st_size for path in self._folder.glob("*"))
