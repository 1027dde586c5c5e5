"""Files that trainings need to resume are deleted when no job needs them any more."""

import logging
import os
import time
from pathlib import Path

import pytest

from app.digests import digest
from app.store import attempts, completion, jobs
from app.store.engine import Store
from app.store.records import NewCheckpoint, NewJob, ResumeState
from jobs.resume_files import KEEP_UNKNOWN_S, folder_of, remove_unneeded
from jobs.retention import MAX_JOBS_AT_ONCE, Retention
from tests.support.databases import claimed


def with_file(data_dir: Path, job_id: str) -> Path:
    path = folder_of(data_dir, job_id) / "transitions.safetensors"
    path.parent.mkdir(parents=True)
    path.write_bytes(b"rows")
    return path


def test_files_go_with_their_job_and_after_its_success(store: Store, tmp_path: Path) -> None:
    policy = NewCheckpoint(sha256=digest({}, b"p"), manifest={}, tensors=b"p")
    paths = {}
    for name in ("succeeded", "running"):
        jobs.create_job(store, NewJob(kind="count", spec={}))
        claim, _ = claimed(store)
        resume = ResumeState(step=10, manifest={}, tensors=b"r")
        attempts.record_checkpoint(store, claim, 10, policy, resume)
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
    policy = NewCheckpoint(sha256=digest({}, b"p"), manifest={}, tensors=b"p")
    left: dict[str, list[str]] = {}
    for name in ("cancelled", "running"):
        jobs.create_job(store, NewJob(kind="count", spec={}))
        claim, _ = claimed(store)
        resume = ResumeState(step=10, manifest={}, tensors=b"r")
        attempts.record_checkpoint(store, claim, 10, policy, resume)
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
    assert keep.apply()
    assert len(jobs.list_jobs(store).items) == 1
    assert not keep.apply()
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
    with caplog.at_level(logging.WARNING):
        keep.delete(ids[0])
        keep.apply()
    assert jobs.list_jobs(store).items == ()
    assert not any(folder_of(tmp_path, one).exists() for one in ids)
    assert [f"the log of job {one} stays" in caplog.text for one in ids] == [True] * 3
