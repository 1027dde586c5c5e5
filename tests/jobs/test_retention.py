"""Ended jobs are deleted with their files."""

import logging
from pathlib import Path

import pytest

from app.store import jobs
from app.store.engine import Store
from app.store.records import NewJob
from jobs.resume_files import folder_of
from jobs.retention import Retention


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
