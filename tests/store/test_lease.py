from collections.abc import Callable
from pathlib import Path

import pytest
import sqlalchemy as sa

from app.errors import Conflict
from app.storage_errors import LeaseLost
from app.store import attempts, completion, jobs
from app.store.database import reserve
from app.store.database.lease import Lease
from app.store.database.lock import ServerLock
from app.store.database.migrate import migrate
from app.store.engine import Store
from app.store.records import Claim, NewJob
from jobs.retention import Retention
from tests.support.databases import POSTGRESQL_ONLY, wait_until_lease_expires


def server(store: Store, folder: Path, duration_s: float = 1000.0) -> tuple[Lease, ServerLock]:
    """A lease, not yet taken, and the lock that it needs."""
    lock = ServerLock(store, folder)
    lock.acquire()
    return Lease(store, lock, duration_s), lock


@POSTGRESQL_ONLY
def test_second_server_learns_who_holds_the_lease_and_until_when(
    store: Store, tmp_path: Path
) -> None:
    first, _lock = server(store, tmp_path / "a")
    migrate(store, first)
    second, _lock2 = server(store, tmp_path / "b")
    rule = r"server \(process \d+ on \S+\) holds the lease of postgresql:.* until [\d:]+ UTC"
    with pytest.raises(Conflict, match=rule):
        second.check()
    with pytest.raises(Conflict, match=rule):
        migrate(store, second)
    first.renew()
    first.release()
    migrate(store, second)


def test_earlier_server_of_the_same_folder_has_ended(store: Store, tmp_path: Path) -> None:
    first, lock = server(store, tmp_path)
    migrate(store, first)
    lock.release()
    second, _lock = server(store, tmp_path)
    migrate(store, second)
    with pytest.raises(LeaseLost, match=r"which process \d+ on \S+ took \(epoch 2\)"):
        with store.fenced(first.require).writing():
            pass


@POSTGRESQL_ONLY
def test_expired_lease_is_held_until_another_server_takes_it(
    store: Store, tmp_path: Path
) -> None:
    first, _lock = server(store, tmp_path / "a", duration_s=0.01)
    migrate(store, first)
    wait_until_lease_expires(store)
    first.renew()
    wait_until_lease_expires(store)
    second, _lock2 = server(store, tmp_path / "b")
    migrate(store, second)
    with pytest.raises(LeaseLost):
        first.renew()
    first.release()
    with store.writing() as connection:
        second.require(connection)


WRITES: dict[str, Callable[[Store, Claim], object]] = {
    "claim": lambda store, _: attempts.claim_next(store),
    "crash": lambda store, claim: completion.crash(store, claim, "stale", max_failures=3),
    "fail": lambda store, claim: completion.fail(store, claim, "stale"),
    "give back": lambda store, claim: completion.give_back(store, claim),
    "orphans": lambda store, _: completion.requeue_orphans(store),
    "remove old": lambda store, _: Retention(
        store=Store(store.url), logs=Path("logs"), keep_jobs=0, keep_states=0, acting=dict
    ).apply(store),
    "reserve": lambda store, _: reserve.fill_reserve(store),
}


@pytest.mark.parametrize("write", WRITES.values(), ids=WRITES)
def test_server_without_the_lease_can_change_nothing(
    store: Store, tmp_path: Path, claim: Claim, write: Callable[[Store, Claim], object]
) -> None:
    lease, _lock = server(store, tmp_path)
    migrate(store, lease)
    queued, ended = (jobs.create_job(store, NewJob(kind="count", spec={})) for _ in range(2))
    jobs.request_cancel(store, ended.id)
    with store.writing() as connection:
        connection.execute(sa.text("UPDATE leases SET token = 'other', epoch = 7"))
    before = jobs.list_jobs(store)
    with pytest.raises(LeaseLost, match="this write is refused"):
        write(store.fenced(lease.require), claim)
    assert jobs.list_jobs(store) == before
    assert jobs.get_job(store, queued.id).attempt == 0


def test_first_start_creates_the_tables_and_takes_the_lease(tmp_path: Path) -> None:
    store = Store(f"sqlite:///{tmp_path}/new.db")
    lease, _lock = server(store, tmp_path)
    lease.check()
    migrate(store, lease)
    with store.writing() as connection:
        lease.require(connection)
    store.close()
