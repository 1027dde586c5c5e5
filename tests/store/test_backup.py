"""A backup restores exactly what was there; a damaged one changes nothing."""

import errno
import hashlib
import io
import json
import os
import random
import sqlite3
import tarfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from app.errors import Conflict, InvalidInput
from app.storage_errors import StorageDamaged, StorageFull
from app.store import attempts, checkpoints, jobs, metrics
from app.store.database import backup
from app.store.database.backup import restore_backup, write_backup
from app.store.database.lock import ServerLock
from app.store.engine import Store
from app.store.records import Claim
from tests.store.test_attempts import policy, record, resume
from tests.support.databases import SQLITE_ONLY

pytestmark = SQLITE_ONLY

CONTENT = random.Random(3).randbytes(300_000)


def dump(path: Path) -> list[str]:
    database = sqlite3.connect(path)
    try:
        return list(database.iterdump())
    finally:
        database.close()


@pytest.fixture
def data(store: Store, claim: Claim, tmp_path: Path) -> Path:
    """A data folder with a job, its checkpoints and files beside the database."""
    record(store, claim, 5, 10)
    attempts.record_checkpoint(store, claim, 10, policy(CONTENT), resume(10, CONTENT))
    for name in ("memory/a/one.bin", "logs/x.log", "kernels/k.nbi", "memory/a/two.bin.part"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes(CONTENT)
    return tmp_path


def path_of(store: Store) -> Path:
    assert store.sqlite_path is not None
    return store.sqlite_path


def test_backup_is_restored_exactly_and_the_database_before_is_kept(
    store: Store, data: Path, claim: Claim, tmp_path: Path
) -> None:
    before = dump(path_of(store))
    found = write_backup(store, data, tmp_path / "b.tar")
    assert (found.rows["jobs"], found.rows["checkpoints"], found.n_files) == (1, 1, 1)
    record(store, claim, 15)
    (data / "memory/a/one.bin").unlink()
    later = dump(path_of(store))
    store.close()
    restored, kept = restore_backup(store, data, tmp_path / "b.tar")
    assert restored == found
    assert dump(path_of(store)) == before != later
    assert kept is not None and dump(kept) == later
    assert (data / "memory/a/one.bin").read_bytes() == CONTENT
    assert attempts.load_resume(store, claim.job_id) == resume(10, CONTENT)
    assert not list(tmp_path.glob("**/.unfinished-*"))


def test_backup_goes_to_another_folder_that_has_no_database(
    store: Store, data: Path, tmp_path: Path
) -> None:
    write_backup(store, data, tmp_path / "b.tar")
    (tmp_path / "other").mkdir()
    other = Store(f"sqlite:///{tmp_path}/other/tandem.db")
    _, kept = restore_backup(other, tmp_path / "other", tmp_path / "b.tar")
    assert kept is None
    assert dump(path_of(other)) == dump(path_of(store))
    assert (tmp_path / "other/memory/a/one.bin").read_bytes() == CONTENT
    other.close()


def test_backup_during_writes_is_one_consistent_state(
    store: Store, claim: Claim, tmp_path: Path
) -> None:
    over = threading.Event()

    def work() -> None:
        step = 0
        while not over.is_set():
            step += 1
            record(store, claim, step)
            attempts.record_checkpoint(
                store, claim, step, policy(CONTENT + bytes([step % 256])), resume(step)
            )

    thread = threading.Thread(target=work)
    thread.start()
    try:
        for n in range(4):
            write_backup(store, tmp_path, tmp_path / f"{n}.tar")
    finally:
        over.set()
        thread.join()
    for n in range(4):
        (tmp_path / f"{n}").mkdir()
        copy = Store(f"sqlite:///{tmp_path}/{n}/tandem.db")
        restore_backup(copy, tmp_path / f"{n}", tmp_path / f"{n}.tar")
        job = jobs.get_job(copy, claim.job_id)
        steps = [row.step for row in metrics.list_metrics(copy, claim.job_id)]
        assert steps == list(range(1, job.step + 1))
        assert all(error is None for error in checkpoints.find_damaged(copy))
        copy.close()


def test_locked_database_is_backed_up(store: Store, data: Path, tmp_path: Path) -> None:
    with store.writing():
        write_backup(store, data, tmp_path / "b.tar")


def test_restore_beside_a_server_is_refused(store: Store, data: Path, tmp_path: Path) -> None:
    write_backup(store, data, tmp_path / "b.tar")
    before = dump(path_of(store))
    lock = ServerLock(store, data)
    lock.acquire()
    with pytest.raises(Conflict, match=rf"process {os.getpid()}\) already uses .* stop it"):
        restore_backup(store, data, tmp_path / "b.tar")
    lock.release()
    assert dump(path_of(store)) == before


@pytest.mark.parametrize("part", ["head", "database", "end", "torn", "other", "missing"])
def test_damaged_backup_is_named_and_changes_nothing(
    store: Store, data: Path, tmp_path: Path, part: str
) -> None:
    file = tmp_path / "b.tar"
    write_backup(store, data, file)
    before = dump(path_of(store))
    content = bytearray(file.read_bytes())
    if part == "missing":
        file.unlink()
    elif part == "other":
        file.write_bytes(b"my notes" * 5000)
    elif part == "torn":
        file.write_bytes(content[: len(content) // 2])
    else:
        place = {
            "head": 700,
            "database": content.index(CONTENT[:1000]),
            "end": content.rindex(CONTENT[:1000]),
        }
        content[place[part] + 9] ^= 4
        file.write_bytes(content)
    with pytest.raises(InvalidInput, match=r"b\.tar"):
        restore_backup(store, data, file)
    assert dump(path_of(store)) == before
    assert not list(data.glob("*.kept")) and not list(data.glob(".unfinished-*"))


def write_edited(
    whole: Path, file: Path, edit: Callable[[dict[str, Any]], object], more: list[str]
) -> None:
    """Write a copy of a backup with another head and more copies of the database."""
    with tarfile.open(whole) as archive:
        members = {one.name: archive.extractfile(one).read() for one in archive}
    head = json.loads(members["backup.json"])
    edit(head)
    members["backup.json"] = json.dumps(head).encode()
    members["backup.json.sha256"] = hashlib.sha256(members["backup.json"]).hexdigest().encode()
    members |= dict.fromkeys(more, members["tandem.db"])
    with tarfile.open(file, "w") as archive:
        for name, content in members.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))


@pytest.mark.parametrize("name", ["kernels/ab/k.nbi", "memory/.hidden", "other.lock"])
def test_a_crafted_backup_restores_no_files_that_backups_do_not_contain(
    store: Store, data: Path, tmp_path: Path, name: str
) -> None:
    whole, file = tmp_path / "whole.tar", tmp_path / "b.tar"
    write_backup(store, data, whole)
    added = {f"files/{name}", "files/memory/added.bin"}

    def edit(head: dict[str, Any]) -> None:
        head["files"] |= dict.fromkeys(added, head["files"]["tandem.db"])

    write_edited(whole, file, edit, sorted(added))
    (tmp_path / "other").mkdir()
    other = Store(f"sqlite:///{tmp_path}/other/tandem.db")
    restore_backup(other, tmp_path / "other", file)
    assert (tmp_path / "other/memory/added.bin").exists()
    assert not (tmp_path / "other" / name).exists()
    other.close()


@pytest.mark.parametrize(
    "edit",
    [
        lambda head: head.pop("revision"),
        lambda head: head.update(rows=[]),
        lambda head: head.update(files=["tandem.db"]),
        lambda head: head["files"].update({"kept.txt": head["files"]["tandem.db"]}),
        lambda head: head["files"].pop("tandem.db"),
    ],
)
def test_head_of_another_form_is_refused(
    store: Store, data: Path, tmp_path: Path, edit: Callable[[dict[str, Any]], object]
) -> None:
    whole, file = tmp_path / "whole.tar", tmp_path / "b.tar"
    write_backup(store, data, whole)
    write_edited(whole, file, edit, ["kept.txt"])
    with pytest.raises(InvalidInput, match=r"b\.tar"):
        restore_backup(store, data, file)
    assert not list(data.glob("*.kept")) and not (data / "kept.txt").exists()


def test_backup_of_a_newer_version_is_refused(
    store: Store, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_backup(store, data, tmp_path / "b.tar")
    monkeypatch.setattr(backup, "REVISION", "0001")
    with pytest.raises(Conflict, match="this version of Tandem knows 0001 at most"):
        restore_backup(store, data, tmp_path / "b.tar")


def test_existing_file_is_not_replaced(store: Store, data: Path, tmp_path: Path) -> None:
    (tmp_path / "notes").write_text("mine")
    with pytest.raises(InvalidInput, match=r"notes' exists: name a new file"):
        write_backup(store, data, tmp_path / "notes")
    assert (tmp_path / "notes").read_text() == "mine"


def ruin(store: Store) -> None:
    path = path_of(store)
    store.close()
    content = bytearray(path.read_bytes())
    content[8192:] = random.Random(1).randbytes(len(content) - 8192)
    path.write_bytes(content)


def test_damaged_database_is_not_backed_up_and_is_restored(
    store: Store, data: Path, tmp_path: Path
) -> None:
    before = dump(path_of(store))
    write_backup(store, data, tmp_path / "b.tar")
    ruin(store)
    damaged = path_of(store).read_bytes()
    with pytest.raises(StorageDamaged, match="restore a backup with 'python -m app restore"):
        write_backup(store, data, tmp_path / "second.tar")
    assert not (tmp_path / "second.tar").exists()
    _, kept = restore_backup(store, data, tmp_path / "b.tar")
    assert dump(path_of(store)) == before
    assert kept is not None and kept.read_bytes() == damaged


@pytest.mark.parametrize("call", ["fsync", "link"])
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
def test_disk_error_leaves_no_half_backup(
    store: Store,
    data: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    call: str,
    number: int,
) -> None:
    folder = tmp_path / "backups"
    folder.mkdir()
    if call == "link":
        write_backup(store, data, folder / "b.tar")
        before = dump(path_of(store))
        store.close()

    def fail(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, call, fail)
    expected = StorageFull if number == errno.ENOSPC else InvalidInput
    with pytest.raises(expected):
        if call == "fsync":
            write_backup(store, data, folder / "b.tar")
        else:
            restore_backup(store, data, folder / "b.tar")
    if call == "fsync":
        assert list(folder.iterdir()) == []
    else:
        assert dump(path_of(store)) == before
    assert not list(data.glob(".unfinished-*"))


def test_folder_of_a_job_that_ends_during_a_backup_is_left_out(
    store: Store, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gone, scan, seen = data / "resume/ended", os.scandir, []
    gone.mkdir(parents=True)

    def remove_and_scan(path: Any) -> Any:
        seen.append(str(path))
        if seen[-1] == str(gone):
            gone.rmdir()
        return scan(path)

    monkeypatch.setattr(os, "scandir", remove_and_scan)
    assert write_backup(store, data, tmp_path / "b.tar").n_files == 1
    assert str(gone) in seen and str(data / "kernels") not in seen


def test_file_that_cannot_be_read_is_named(
    store: Store, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(file: Path, _name: Path) -> None:
        raise OSError(errno.EIO, os.strerror(errno.EIO), str(file))

    monkeypatch.setattr(os, "link", fail)
    with pytest.raises(InvalidInput, match=r"memory/a/one\.bin' cannot be read or written"):
        write_backup(store, data, tmp_path / "b.tar")


@pytest.mark.parametrize("number", [errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EXDEV])
def test_file_system_without_links_is_backed_up_and_restored(
    store: Store, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def fail(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "link", fail)
    before = dump(path_of(store))
    assert write_backup(store, data, tmp_path / "b.tar").n_files == 1
    store.close()
    _, kept = restore_backup(store, data, tmp_path / "b.tar")
    assert kept is not None and dump(kept) == dump(path_of(store)) == before


def test_head_says_what_is_inside(store: Store, data: Path, tmp_path: Path) -> None:
    write_backup(store, data, tmp_path / "b.tar")
    content = (tmp_path / "b.tar").read_bytes()
    head = json.loads(content[512 : content.index(b"\0", 512)])
    assert set(head["files"]) == {"tandem.db", "files/memory/a/one.bin"}


@pytest.fixture
def named(store: Store, data: Path) -> Store:
    """A copy of the database under a name that does not end with ``.db``."""
    database = sqlite3.connect(data / "jobs.sqlite")
    database.executescript("\n".join(dump(path_of(store))))
    database.close()
    return Store(f"sqlite:///{data}/jobs.sqlite")


def test_database_of_another_name_is_restored_and_the_present_one_kept(
    named: Store, claim: Claim, tmp_path: Path
) -> None:
    before = dump(path_of(named))
    assert write_backup(named, tmp_path, tmp_path / "b.tar").n_files == 1
    record(named, claim, 15)
    later = dump(path_of(named))
    named.close()
    _, kept = restore_backup(named, tmp_path, tmp_path / "b.tar")
    assert dump(path_of(named)) == before != later
    assert kept is not None and dump(kept) == later
    assert write_backup(named, tmp_path, tmp_path / "c.tar").n_files == 1


def test_file_of_a_backup_does_not_replace_the_database_before_it_is_kept(
    store: Store, data: Path, named: Store, claim: Claim, tmp_path: Path
) -> None:
    assert write_backup(store, data, tmp_path / "b.tar").n_files > 1  # with ``jobs.sqlite``
    record(named, claim, 15)
    later = dump(path_of(named))
    named.close()
    _, kept = restore_backup(named, data, tmp_path / "b.tar")
    assert dump(path_of(named)) == dump(path_of(store)) != later
    assert kept is not None and dump(kept) == later


def test_backups_in_the_data_folder_do_not_contain_earlier_ones(
    store: Store, data: Path
) -> None:
    sizes = [write_backup(store, data, data / f"{n}.tar").size for n in range(3)]
    assert len(set(sizes)) == 1
