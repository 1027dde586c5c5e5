"""A full disk of PostgreSQL costs no job a failure, and it goes on by itself.

Tables are on the full disk, the write-ahead log is not: a PostgreSQL server that cannot write
its log ends.
"""

import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.storage_errors import StorageFull
from app.store import jobs
from app.store.database.migrate import migrate
from app.store.engine import Store
from jobs.executor import LocalExecutor
from jobs.supervisor import Supervisor
from tests.jobs.machinery import (
    PATIENCE,
    assert_counted_once,
    queue,
    wait_for,
    wait_until,
    wait_until_final,
)
from tests.jobs.supervisor_process import COUNTING
from tests.support.postgresql_server import SMALL, PostgresqlServer, postgresql_server

pytestmark = pytest.mark.postgres

DISK_BYTES = 48 << 20


@pytest.fixture
def server() -> Iterator[PostgresqlServer]:
    with postgresql_server(DISK_BYTES) as started:
        yield started


@pytest.fixture
def store(server: PostgresqlServer) -> Iterator[Store]:
    with server.database("template0", SMALL) as url:
        opened = Store(url)
        migrate(opened)
        yield opened
        opened.close()


def queue_until_full(store: Store) -> list[str]:
    """Queue jobs until one is refused; return the acknowledged ones."""
    chance, acknowledged = random.Random(1), list[str]()
    with pytest.raises(StorageFull):
        while True:  # a page holds a few rows of this length
            text = chance.randbytes(300).hex()
            acknowledged.append(queue(store, seed=4, steps=20, text=text))
    return acknowledged


def test_nothing_acknowledged_is_lost_on_a_full_disk(
    server: PostgresqlServer, store: Store, tmp_path: Path
) -> None:
    executor = LocalExecutor(store.url, tmp_path, COUNTING)
    supervisor = Supervisor(store, tmp_path, executor=executor, timeouts=PATIENCE)
    supervisor.start()
    first = queue(store, steps=20, padding=50_000)
    assert wait_until_final(store, first).state == "succeeded"
    server.fill_disk()
    full = queue(store, seed=3, steps=100, padding=50_000)
    job = wait_for(store, full, lambda job: job.waiting is not None)
    assert (job.state, job.waiting, job.failures) == ("running", "disk full", 0)
    wait_until(lambda: supervisor.waiting == "disk full")
    queued = queue_until_full(store)
    assert queued
    assert all(jobs.get_job(store, one).state == "queued" for one in queued)
    server.free_disk()
    job = wait_until_final(store, full)
    assert (job.state, job.attempt, job.failures, job.waiting) == ("succeeded", 1, 0, None)
    assert_counted_once(store, full, steps=100, seed=3)
    for one in queued:
        assert wait_until_final(store, one).state == "succeeded"
        assert_counted_once(store, one, steps=20, seed=4)
    assert supervisor.waiting is None
    supervisor.stop()
