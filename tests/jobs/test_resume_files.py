"""Files that trainings need to resume are deleted when no job needs them any more."""

import os
import time
from pathlib import Path

from app.digests import digest
from app.store import attempts, completion, jobs
from app.store.engine import Store
from app.store.records import NewCheckpoint, NewJob, ResumeState
from jobs.resume_files import KEEP_UNKNOWN_S, folder_of, remove_unneeded
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
