import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.errors import Conflict, InvalidInput
from app.store.database.lock import ServerLock
from app.store.engine import Store
from tests.support.databases import SQLITE_ONLY
from tests.support.full_disk import files_up_to

HOLDER = """
import sys, time
from pathlib import Path
from app.store.engine import Store
from app.store.database.lock import ServerLock
lock = ServerLock(Store(sys.argv[1]), Path(sys.argv[2]))
lock.acquire()
print("held", flush=True)
sys.stdin.read()
"""


def test_second_lock_names_the_process_that_holds_the_first(
    store: Store, tmp_path: Path
) -> None:
    first, second = ServerLock(store, tmp_path), ServerLock(store, tmp_path)
    first.acquire()
    with pytest.raises(Conflict, match=rf"process {os.getpid()}\) already uses {tmp_path}"):
        second.acquire()
    first.release()
    second.acquire()
    second.release()


@SQLITE_ONLY
def test_one_database_has_one_server_even_from_two_folders(
    store: Store, tmp_path: Path
) -> None:
    first, second = ServerLock(store, tmp_path / "a"), ServerLock(store, tmp_path / "b")
    first.acquire()
    with pytest.raises(Conflict, match="already uses"):
        second.acquire()
    ServerLock(Store(f"sqlite:///{tmp_path}/other.db"), tmp_path / "b").acquire()
    first.release()


@SQLITE_ONLY
@pytest.mark.parametrize("by_link", [False, True])
def test_database_in_the_folder_of_one_server_has_no_second_one(
    store: Store, tmp_path: Path, by_link: bool
) -> None:
    assert store.sqlite_path is not None
    url = store.url
    if by_link:
        link = tmp_path / "links" / "same.db"
        link.parent.mkdir()
        link.symlink_to(store.sqlite_path)
        url = f"sqlite:///{link}"
    first = ServerLock(store, store.sqlite_path.parent)
    second = ServerLock(Store(url), tmp_path / "b")
    for held, refused in ((first, second), (second, first)):
        held.acquire()
        with pytest.raises(Conflict, match="already uses"):
            refused.acquire()
        held.release()


def test_lock_ends_with_the_process_that_held_it(store: Store, tmp_path: Path) -> None:
    arguments = [sys.executable, "-c", HOLDER, store.url, str(tmp_path)]
    with subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None and holder.stdout.readline() == b"held\n"
        lock = ServerLock(store, tmp_path)
        with pytest.raises(Conflict, match=f"process {holder.pid}"):
            lock.acquire()
        holder.kill()
        holder.wait()
    lock.acquire()
    lock.release()


def test_folder_that_cannot_be_made_is_named(store: Store, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InvalidInput, match=r"TANDEM_DATA = '.*file/data' must be a folder"):
        ServerLock(store, tmp_path / "file" / "data").acquire()


def test_lock_of_a_full_disk_is_held_without_the_process_id(
    store: Store, tmp_path: Path
) -> None:
    first, second = ServerLock(store, tmp_path), ServerLock(store, tmp_path)
    with files_up_to(0):
        first.acquire()
    with pytest.raises(Conflict, match=r"process unknown\) already uses"):
        second.acquire()
    first.release()
    second.acquire()
    second.release()
