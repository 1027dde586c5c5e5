"""A full disk, a lock and a broken disk cost no job a failure, and it goes on by itself."""

import errno
import os
import sqlite3
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import pytest
import sqlalchemy as sa
from alembic import command
from sqlalchemy import event
from sqlalchemy.pool import PoolProxiedConnection

from app.storage_errors import StaleAttempt, StorageFull
from app.store import attempts, completion, jobs
from app.store.database.lock import ServerLock
from app.store.database.migrate import alembic_config
from app.store.engine import Store
from app.store.records import Claim
from jobs import worker as jobs_worker
from jobs.access import StoreAccess
from jobs.executor import NO_CPU, Exit, LocalExecutor, LocalHandle
from jobs.supervisor import Supervisor
from jobs.worker import JobWorker
from tests.jobs.counting_worker import count
from tests.jobs.machinery import (
    PATIENCE,
    assert_counted_once,
    queue,
    supervised,
    wait_for,
    wait_until,
    wait_until_final,
)
from tests.store.test_engine import fill_up
from tests.support.databases import SQLITE_ONLY, claimed
from tests.support.full_disk import files_up_to

pytestmark = SQLITE_ONLY  # its limits and locks are those of a file

UNLIMITED = "1000000"


def n_pages(store: Store) -> int:
    with store.reading() as connection:
        return int(connection.execute(sa.text("PRAGMA page_count")).scalar_one())


@contextmanager
def locked(store: Store) -> Iterator[None]:
    """Hold the write lock, as another program does that backs the file up."""
    assert store.sqlite_path is not None
    other = sqlite3.connect(store.sqlite_path, isolation_level=None, timeout=60.0)
    other.execute("BEGIN IMMEDIATE")
    try:
        yield
    finally:
        other.execute("ROLLBACK")
        other.close()


@contextmanager
def impatient(store: Store, tmp_path: Path) -> Iterator[Supervisor]:
    """A supervisor and workers that wait 0.2 s for a lock."""
    short = Store(f"{store.url}?timeout=0.2")
    executor = LocalExecutor(short.url, tmp_path, "tests.jobs.counting_worker")
    timeouts = replace(PATIENCE, silence_s=1.0, retry_s=0.1)
    with supervised(short, tmp_path, executor=executor, timeouts=timeouts) as supervisor:
        yield supervisor
    short.close()


def test_job_in_a_full_database_waits_and_goes_on(
    store: Store, supervisor: Supervisor, tmp_path: Path
) -> None:
    limit = tmp_path / "max_pages"
    limit.write_text(str(n_pages(store) + 60))
    full = queue(store, seed=3, steps=100, padding=50_000, max_pages=str(limit))
    following = queue(store, steps=40)
    job = wait_for(store, full, lambda job: job.waiting is not None)
    assert (job.state, job.waiting, job.failures) == ("running", "disk full", 0)
    wait_until(lambda: supervisor.waiting == "disk full")
    assert attempts.load_resume(store, full) is not None
    assert jobs.get_job(store, following).state == "queued"
    limit.write_text(UNLIMITED)
    job = wait_until_final(store, full)
    assert (job.state, job.attempt, job.failures, job.waiting) == ("succeeded", 1, 0, None)
    assert_counted_once(store, full, steps=100, seed=3)
    assert wait_until_final(store, following).state == "succeeded"
    assert supervisor.waiting is None


def test_start_on_a_full_disk_waits_for_room(
    store: Store, tmp_path: Path, executor: LocalExecutor
) -> None:
    job_id = queue(store, steps=20)
    store.close()  # as after a clean stop
    with ExitStack() as block:
        with files_up_to(1000):
            started = supervised(store, tmp_path, executor=executor)
            supervisor = block.enter_context(started)
            assert supervisor.waiting == "disk full"
        assert wait_until_final(store, job_id).state == "succeeded"


@pytest.mark.parametrize("revision", ["0003", "base"])
def test_upgrade_on_a_full_disk_is_refused_with_this_reason(
    store: Store, tmp_path: Path, revision: str
) -> None:
    config = alembic_config()
    with store.writing() as connection:
        config.attributes["connection"] = connection
        command.downgrade(config, revision)
    with closing(sqlite3.connect(str(store.sqlite_path))) as database:
        database.execute("VACUUM")
    fill_up(store, spare_pages=0)
    supervisor = Supervisor(store, tmp_path)
    with pytest.raises(StorageFull):
        supervisor.start()
    ServerLock(store, tmp_path).acquire()  # which the supervisor has released


@pytest.mark.parametrize("end", ["cancel", "SIGTERM"])
def test_job_that_waits_for_room_can_be_stopped(
    store: Store, supervisor: Supervisor, tmp_path: Path, end: str
) -> None:
    limit = tmp_path / "max_pages"
    limit.write_text(str(n_pages(store) + 60))
    full = queue(store, seed=3, steps=100, padding=50_000, max_pages=str(limit))
    wait_for(store, full, lambda job: job.waiting is not None)
    if end == "cancel":
        jobs.request_cancel(store, full)
        assert wait_until_final(store, full).state == "cancelled"
        return
    supervisor.stop()
    job = jobs.get_job(store, full)
    assert (job.state, job.failures, job.waiting) == ("queued", 0, None)
    limit.write_text(UNLIMITED)
    supervisor.start()
    assert wait_until_final(store, full).state == "succeeded"
    assert_counted_once(store, full, steps=100, seed=3)


def test_queue_waits_while_the_disk_has_too_little_room(
    store: Store, tmp_path: Path, executor: LocalExecutor
) -> None:
    with supervised(store, tmp_path, executor=executor, min_free_bytes=1 << 62) as supervisor:
        job_id = queue(store, steps=20)
        wait_until(lambda: supervisor.waiting == "disk full")
    assert jobs.get_job(store, job_id).attempt == 0


class Exhausted(LocalExecutor):
    """An executor whose first starts meet a full disk, or a machine without free resources."""

    def __init__(self, store: Store, data_dir: Path, error: int) -> None:
        super().__init__(store.url, data_dir, "tests.jobs.counting_worker")
        self.left, self.error = 4, error

    def start(self, claim: Claim) -> LocalHandle:
        if self.left:
            self.left -= 1
            raise OSError(self.error, os.strerror(self.error))
        return super().start(claim)


@pytest.mark.parametrize(
    ("error", "reason"),
    [
        (errno.ENOSPC, "disk full"),
        (errno.EAGAIN, "no free resources"),
        (errno.EMFILE, "no free resources"),
        (errno.EROFS, "disk error"),
    ],
)
def test_worker_that_cannot_be_started_for_now_is_started_later(
    store: Store, tmp_path: Path, error: int, reason: str
) -> None:
    executor = Exhausted(store, tmp_path, error)
    timeouts = replace(PATIENCE, retry_s=0.2)
    job_id = queue(store, steps=20)
    with supervised(store, tmp_path, executor=executor, timeouts=timeouts) as supervisor:
        wait_until(lambda: supervisor.waiting == reason)
        job = wait_until_final(store, job_id)
    assert (job.state, job.attempt, job.failures) == ("succeeded", 5, 0)


class Crowded(LocalExecutor):
    """An executor on which every job lacks a free CPU of the cluster."""

    def __init__(self, store: Store, data_dir: Path) -> None:
        super().__init__(store.url, data_dir, "tests.jobs.counting_worker")
        self.store = store

    def poll(self, handle: LocalHandle) -> Exit | None:
        for job in attempts.running_jobs(self.store):
            with suppress(StaleAttempt):
                attempts.heartbeat(self.store, job.claim, NO_CPU)
        return super().poll(handle)


def test_wait_for_a_cpu_of_the_cluster_is_a_warning(
    store: Store, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    job_id = queue(store, steps=20, hold_at=[10])
    with supervised(store, tmp_path, executor=Crowded(store, tmp_path)) as supervisor:
        wait_until(lambda: supervisor.waiting == NO_CPU)
        jobs.request_cancel(store, job_id)
        assert wait_until_final(store, job_id).state == "cancelled"
    found = [one.levelname for one in caplog.records if "the queue waits" in one.message]
    assert set(found) == {"WARNING"}


def test_lock_beyond_every_timeout_costs_no_job_a_failure(store: Store, tmp_path: Path) -> None:
    job_id = queue(store, seed=5, steps=400, hold_at=[30])
    queued = queue(store, steps=20)
    with impatient(store, tmp_path) as supervisor:
        wait_for(store, job_id, lambda job: job.step == 30)
        with locked(store):
            wait_until(lambda: supervisor.waiting == "database locked")
            time.sleep(2.0)  # twice the silence after which a worker is killed
        job = wait_for(store, job_id, lambda job: True)
        assert (job.state, job.attempt, job.failures) == ("running", 1, 0)
        jobs.request_cancel(store, job_id)
        assert wait_until_final(store, job_id).state == "cancelled"
        assert wait_until_final(store, queued).state == "succeeded"
        wait_until(lambda: supervisor.waiting is None)


def test_job_steps_on_after_a_lock(store: Store, tmp_path: Path) -> None:
    job_id = queue(store, seed=5, steps=100)
    with impatient(store, tmp_path):
        for _ in range(20):
            with locked(store):
                time.sleep(0.3)
            time.sleep(0.05)
        job = wait_until_final(store, job_id)
    assert (job.state, job.failures) == ("succeeded", 0)
    assert_counted_once(store, job_id, steps=100, seed=5)


WRITES = [
    "INSERT INTO metrics",
    "INSERT INTO events",
    "INSERT INTO checkpoints",
    "INSERT INTO job_checkpoints",
    "INSERT INTO resume_states",
    "UPDATE jobs",
    "before COMMIT",
    "after COMMIT",
]
ERRORS = ["database or disk is full", "disk I/O error", "database is locked"]


@pytest.mark.parametrize("error", ERRORS)
@pytest.mark.parametrize("place", WRITES)
def test_error_at_any_write_of_a_worker_loses_nothing(
    store: Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str, error: str
) -> None:
    job_id = queue(store, seed=7, steps=60)
    found = claimed(store)
    worker = JobWorker(StoreAccess(store, tmp_path, found[0]))
    monkeypatch.setattr(jobs_worker, "RETRY_S", 0.01)
    n, commit = 0, store.engine.dialect.do_commit

    def fail_at(reached: str) -> None:
        """Raise the driver's error the second and third time that the place is reached."""
        nonlocal n
        if threading.current_thread() is threading.main_thread() and reached.startswith(place):
            n += 1
            if n in (2, 3):
                raise sqlite3.OperationalError(error)

    def do_commit(connection: PoolProxiedConnection) -> None:
        fail_at("before COMMIT")
        commit(connection)
        fail_at("after COMMIT")

    event.listen(store.engine, "do_execute", lambda _cursor, sql, *_: fail_at(sql))
    monkeypatch.setattr(store.engine.dialect, "do_commit", do_commit)
    assert worker.execute(count) == 0
    assert n >= 3
    assert jobs.get_job(store, job_id).state == "succeeded"
    assert_counted_once(store, job_id, steps=60, seed=7)


def test_job_killed_with_its_server_thirty_times_ends_and_says_so(store: Store) -> None:
    job_id = queue(store, steps=20)
    attempts.claim_next(store)
    for n in range(1, completion.MAX_KILLS):
        completion.requeue_orphans(store)
        job = jobs.get_job(store, job_id)
        assert (job.state, job.kills, job.failures) == ("queued", n, 0)
        attempts.claim_next(store)
    completion.requeue_orphans(store)
    job = jobs.get_job(store, job_id)
    assert (job.state, job.kills) == ("failed", 30)
    assert job.error is not None and job.error.startswith("Killed 30 times with the server")
