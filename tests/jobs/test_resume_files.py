"""Files that trainings need to resume are deleted when no job needs them any more."""

import logging
import os
import threading
import time
from functools import partial
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from app.policies.training import state as states
from app.policies.training.file_store import FileFolder
from app.policies.training.memory_files import MemoryFiles
from app.store import attempts, checkpoints, completion, jobs, metrics
from app.store.engine import Store
from app.store.records import NewJob, ResumeState
from jobs.access import StoreAccess
from jobs.resume_files import KEEP_UNKNOWN_S, folder_of, remove_unneeded
from jobs.retention import MAX_JOBS_AT_ONCE, Retention
from jobs.run import usable
from jobs.worker import JobWorker
from tests.jobs.machinery import wait_for
from tests.store.test_attempts import policy, resume
from tests.support.databases import claimed, started


def with_file(data_dir: Path, job_id: str) -> Path:
    path = folder_of(data_dir, job_id) / "transitions.safetensors"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"rows")
    return path


def test_files_go_with_their_job_and_after_its_success(store: Store, tmp_path: Path) -> None:
    paths = {}
    for name in ("succeeded", "running"):
        claim = started(store)
        attempts.record_checkpoint(store, claim, 10, policy(), resume(10))
        if name == "succeeded":
            completion.finish(store, claim, result={})
        paths[name] = with_file(tmp_path, claim.job_id)
    paths["queued"] = with_file(tmp_path, jobs.create_job(store, NewJob(kind="x", spec={})).id)
    remove_unneeded(store, tmp_path)
    assert {name: path.exists() for name, path in paths.items()} == {
        "succeeded": False,
        "running": True,
        "queued": True,
    }


def test_files_of_an_unknown_job_are_kept_for_a_while(store: Store, tmp_path: Path) -> None:
    """They may belong to the database that the settings name again after an error."""
    known = jobs.create_job(store, NewJob(kind="x", spec={})).id
    long_ago = time.time() - KEEP_UNKNOWN_S - 60.0
    paths = [with_file(tmp_path, name) for name in ("other", known)]
    remove_unneeded(store, tmp_path)
    (paths[1].parent / "unknown-job").touch()
    for path in paths:
        os.utime(path, (long_ago, long_ago))
        os.utime(path.parent / "unknown-job", (long_ago, long_ago))
        assert path.exists()
    remove_unneeded(store, tmp_path)
    assert [path.exists() for path in paths] == [False, True]
    assert not (paths[1].parent / "unknown-job").exists()


def test_unfinished_files_of_ended_jobs_are_deleted(store: Store, tmp_path: Path) -> None:
    left: dict[str, list[str]] = {}
    for name in ("cancelled", "running"):
        claim = started(store)
        attempts.record_checkpoint(store, claim, 10, policy(), resume(10))
        path = with_file(tmp_path, claim.job_id)
        for suffix in (".unfinished", ".part"):
            path.with_name(path.name + suffix).touch()
        if name == "cancelled":
            completion.finish(store, claim, state="cancelled")
        remove_unneeded(store, tmp_path)
        left[name] = sorted(one.name for one in path.parent.iterdir())
    kept = "transitions.safetensors"
    assert left == {
        "cancelled": [kept],
        "running": [kept, f"{kept}.part", f"{kept}.unfinished"],
    }


def test_what_is_no_folder_keeps_no_other_from_being_deleted(
    store: Store, tmp_path: Path
) -> None:
    ids = [jobs.create_job(store, NewJob(kind="x", spec={})).id for _ in range(5)]
    for job_id in ids:
        jobs.request_cancel(store, job_id)
    paths = [with_file(tmp_path, job_id) for job_id in ids]
    for path in paths[::2]:
        path.unlink()
        path.parent.rmdir()
        path.parent.touch()
    remove_unneeded(store, tmp_path)
    assert not any(path.exists() for path in paths)


def test_jobs_beyond_those_to_keep_are_deleted_some_at_a_time(
    store: Store, tmp_path: Path
) -> None:
    for _ in range(MAX_JOBS_AT_ONCE + 1):
        jobs.request_cancel(store, jobs.create_job(store, NewJob(kind="x", spec={})).id)
    keep = Retention(store=store, logs=tmp_path, keep_jobs=0, keep_states=0, acting=dict)
    assert keep.apply(store)
    assert len(jobs.list_jobs(store).items) == 1
    assert not keep.apply(store)
    assert jobs.list_jobs(store).items == ()


def test_log_that_cannot_be_deleted_is_stated_and_its_job_is_deleted_with_its_files(
    store: Store, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    logs, ids = tmp_path / "logs", []
    for _ in range(3):
        ids.append(jobs.create_job(store, NewJob(kind="x", spec={})).id)
        jobs.request_cancel(store, ids[-1])
        folder_of(tmp_path, ids[-1]).mkdir(parents=True)
        (logs / f"{ids[-1]}.log").mkdir(parents=True)
    keep = Retention(store=store, logs=logs, keep_jobs=0, keep_states=0, acting=dict)
    with caplog.at_level(logging.INFO):
        keep.delete(ids[0])
        keep.apply(store)
    assert jobs.list_jobs(store).items == ()
    assert not any(folder_of(tmp_path, one).exists() for one in ids)
    stays, deleted = (
        [vars(one)["job_id"] for one in caplog.records if text in one.message]
        for text in ("the log of job", "is deleted: the newest 0 are kept")
    )
    assert sorted(stays) == sorted(ids) and sorted(deleted) == sorted(ids[1:])


def test_store_and_trainings_have_one_limit_of_states() -> None:
    assert states.MAX_STATE_BYTES == attempts.MAX_RESUME


@pytest.mark.parametrize("is_read_later", [True, False])
def test_training_whose_files_cannot_be_read_for_now_waits_and_loses_nothing(
    store: Store, tmp_path: Path, is_read_later: bool
) -> None:
    name = sha256(b"rows").hexdigest()
    claim = started(store)
    job_id = claim.job_id
    files = FileFolder(folder_of(tmp_path, job_id))
    files.write(name, b"rows")
    for step in (10, 20):
        state = state_with_file(step, name)
        attempts.record_progress(store, claim, step, {})
        attempts.record_checkpoint(store, claim, step, policy(bytes([step])), state)
    completion.give_back(store, claim)
    path = files.path(name)
    path.unlink()
    path.symlink_to(path)  # which the system refuses to follow
    worker = JobWorker(StoreAccess(store, tmp_path, claimed(store)[0]))

    def run(worker: JobWorker) -> dict[str, int]:
        found = worker.resume(partial(usable, MemoryFiles(files, worker.wait_to)))
        return {"resumed": -1 if found is None else found.step}

    def let_go_on() -> None:
        wait_for(store, job_id, lambda job: job.waiting == "disk error")
        if is_read_later:
            path.unlink()
            path.write_bytes(b"rows")
        else:
            worker.interrupt()

    beside = threading.Thread(target=let_go_on)
    beside.start()
    code = worker.execute(run)
    beside.join()
    assert code == (os.EX_OK if is_read_later else os.EX_TEMPFAIL)
    job = jobs.get_job(store, job_id)
    assert (job.state, job.result) == (
        ("succeeded", {"resumed": 20}) if is_read_later else ("running", None)
    )
    assert [point.step for point in metrics.list_metrics(store, job_id)] == [10, 20]
    made = checkpoints.list_checkpoints(store, job_id=job_id).items
    assert [one.step for one in made] == [20, 10]
    assert attempts.has_resume(store, job_id) != is_read_later


def test_log_of_an_unknown_job_is_deleted_a_week_after_the_first_look(
    store: Store, tmp_path: Path
) -> None:
    known = jobs.create_job(store, NewJob(kind="count", spec={})).id
    logs, long_ago = tmp_path / "logs", time.time() - KEEP_UNKNOWN_S - 60.0
    logs.mkdir()
    for name in (f"{known}.log", "gone.log", "later.log", "notes.txt"):
        (logs / name).write_text("a line")
        os.utime(logs / name, (long_ago, long_ago))
    keep = Retention(store=store, logs=logs, keep_jobs=9, keep_states=9, acting=dict)
    before = {one.name for one in logs.iterdir()}
    assert keep.apply(store) is False
    marks = {"gone.unknown-job", "later.unknown-job"}
    assert {one.name for one in logs.iterdir()} == before | marks
    os.utime(logs / "gone.unknown-job", (long_ago, long_ago))
    (logs / f"{known}.unknown-job").touch()  # as with another database before
    keep.apply(store)
    left = before - {"gone.log"} | {"later.unknown-job"}
    assert {one.name for one in logs.iterdir()} == left


def state_with_file(step: int, name: str) -> ResumeState:
    manifest = {name: kind() for name, kind in states.REQUIRED.items()}
    manifest |= {"step": step, "memory": [{"first": 0, "last": 3, "sha256": name}]}
    state = states.pack(manifest, {"step": np.array([step])})
    return ResumeState(step=step, manifest=state.manifest, tensors=state.tensors)
