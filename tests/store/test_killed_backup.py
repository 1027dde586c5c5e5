"""Backups of processes that were killed, or are still at work."""

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from app.store.database.backup import remove_unfinished, restore_backup, write_backup
from app.store.engine import Store
from tests.support.databases import SQLITE_ONLY
from tests.support.waiting import wait_until

pytestmark = SQLITE_ONLY

SIZE = 20_000_000
WRITER = """
import sys
from itertools import count
from pathlib import Path

from app.store.database.backup import write_backup
from app.store.engine import Store

data, folder = Path(sys.argv[2]), Path(sys.argv[3])
for n in count():
    write_backup(Store(sys.argv[1]), data, folder / f"{n}.tar")
"""


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A data folder with a file that takes a while."""
    (tmp_path / "memory").mkdir()
    (tmp_path / "memory/one.bin").write_bytes(bytes(SIZE))
    return tmp_path


@pytest.fixture
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for backups."""
    return tmp_path_factory.mktemp("backups")


RESTORER = """
import sys
from pathlib import Path

from app.store.database.backup import restore_backup
from app.store.engine import Store

data = Path(sys.argv[2])
while True:
    (data / "memory/one.bin").unlink(missing_ok=True)
    restore_backup(Store(sys.argv[1]), data, Path(sys.argv[3]))
"""


@contextmanager
def stopped_writer(store: Store, data: Path, folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """Yield a process that writes backups, stopped in the middle of one."""
    with stopped(WRITER, store, data, folder) as process:
        yield process


@contextmanager
def stopped(
    program: str, store: Store, data: Path, place: Path
) -> Iterator[subprocess.Popen[bytes]]:
    """Yield a process that is stopped while its temporary folders have content.

    Without content it may be stopped before it holds the lock of its folder.
    """
    command = [sys.executable, "-c", program, store.url, str(data), str(place)]
    folders = [one for one in (data, place) if not one.suffix]
    with subprocess.Popen(command, stderr=subprocess.PIPE) as process:

        def stop_within() -> bool:
            assert process.poll() is None
            process.send_signal(signal.SIGSTOP)
            if all(any(holds(one) for one in hidden(folder)) for folder in folders):
                return True
            process.send_signal(signal.SIGCONT)
            return False

        try:
            wait_until(stop_within)
            yield process
        finally:
            process.kill()


def holds(one: Path) -> bool:
    """Return whether a temporary file or folder has content."""
    try:
        return one.is_file() or any(one.iterdir())
    except FileNotFoundError:
        return False  # removed since


def hidden(folder: Path) -> list[Path]:
    """Return the temporary files and folders of backups."""
    return [one for one in folder.glob("*") if one.suffix == ".part" or one.name[0] == "."]


def test_next_backup_removes_what_a_killed_one_left(
    store: Store, data: Path, folder: Path
) -> None:
    with stopped_writer(store, data, folder) as process:
        process.kill()
    assert hidden(data) and hidden(folder)
    (data / ".backup-notes").mkdir()
    write_backup(store, data, folder / "next.tar")
    assert hidden(data) == [data / ".backup-notes"] and not hidden(folder)


def test_start_removes_what_a_killed_restoration_left(
    store: Store, data: Path, folder: Path
) -> None:
    write_backup(store, data, folder / "1.tar")
    other = Store(f"sqlite:///{folder}/tandem.db")
    with stopped(RESTORER, other, folder, folder / "1.tar") as process:
        before = hidden(folder)
        remove_unfinished(other, folder)
        assert hidden(folder) == before  # it is at work
        process.kill()
    assert hidden(folder)
    remove_unfinished(other, folder)
    assert not hidden(folder)
    other.close()


def test_hidden_files_enter_no_backup(store: Store, data: Path, folder: Path) -> None:
    """Such as those of killed backups of an earlier version."""
    left = data / ".backup-k3x_9abz/memory/one.bin"
    left.parent.mkdir(parents=True)
    left.write_bytes(b"old")
    assert write_backup(store, data, folder / "1.tar").n_files == 1


def test_next_backup_leaves_those_at_work_alone(store: Store, data: Path, folder: Path) -> None:
    with stopped_writer(store, data, folder) as process:
        before, complete = hidden(data) + hidden(folder), set(folder.glob("*.tar"))
        write_backup(store, data, folder / "next.tar")
        assert hidden(data) + hidden(folder) == before
        process.send_signal(signal.SIGCONT)
        file = folder / f"{len(complete)}.tar"
        wait_until(lambda: file.exists() or process.poll() is not None)
    (folder / "other").mkdir()
    other = Store(f"sqlite:///{folder}/other/tandem.db")
    restore_backup(other, folder / "other", file)
    assert (folder / "other/memory/one.bin").stat().st_size == SIZE
    other.close()


def test_two_backups_do_not_take_the_same_name(store: Store, data: Path, folder: Path) -> None:
    with stopped_writer(store, data, folder) as process:
        file = folder / f"{len(set(folder.glob('*.tar')))}.tar"
        write_backup(store, data, file)
        content = file.read_bytes()
        process.send_signal(signal.SIGCONT)
        assert b"exists: name a new file" in process.communicate(timeout=60.0)[1]
    assert file.read_bytes() == content
