"""Files are written wholly or not at all, and errors of the disk have names."""

import errno
import os
from pathlib import Path

import pytest

from app.durable_files import write_durably
from app.storage_errors import StorageFull, StorageUnavailable


@pytest.mark.parametrize(
    ("number", "expected", "short"),
    [
        (errno.ENOSPC, StorageFull, "disk full"),
        (errno.EIO, StorageUnavailable, "disk error"),
        (errno.EROFS, StorageUnavailable, "disk error"),
        (errno.EINVAL, OSError, None),
    ],
)
def test_error_of_the_disk_leaves_the_file_as_it_was(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    number: int,
    expected: type[Exception],
    short: str | None,
) -> None:
    path = tmp_path / "state"
    write_durably(path, b"before")

    def fails(_: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", fails)
    with pytest.raises(expected) as found:
        write_durably(path, b"after")
    assert getattr(found.value, "short", None) == short
    assert path.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [path]
