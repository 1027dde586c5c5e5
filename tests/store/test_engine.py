import os
import signal
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path

import pytest
import sqlalchemy as sa
from sqlalchemy import event

from app.errors import InvalidInput
from app.storage_errors import StorageFull, StorageUnavailable
from app.store import attempts, completion, jobs, metrics
from app.store.database.migrate import migrate
from app.store.database.reserve import fill_reserve
from app.store.database.size import size_of
from app.store.engine import MAX_PATH_BYTES, Store
from app.store.records import Claim, NewJob
from tests.store.test_attempts import policy, resume
from tests.support.databases import POSTGRESQL_ONLY, SQLITE_ONLY
from tests.support.full_disk import files_up_to
from tests.support.postgresql_server import PostgresqlServer


def fill_up(store: Store, *, spare_pages: int) -> None:
    """Let the database grow by ``spare_pages`` and no further."""
    with store.reading() as connection:
        pages = connection.execute(sa.text("PRAGMA page_count")).scalar_one()
    limit = f"PRAGMA max_page_count = {pages + spare_pages}"
    store.close()
    event.listen(store.engine, "connect", lambda connection, _: connection.execute(limit))


def record_until_full(store: Store, claim: Claim) -> int:
    with pytest.raises(StorageFull):
        for step in range(1, 1000):
            values = {f"x{i}": i / step for i in range(50)}
            attempts.record_progress(store, claim, step, values)
    return len(metrics.list_metrics(store, claim.job_id))


def test_size_of_the_database_grows_with_its_content(store: Store, claim: Claim) -> None:
    before = size_of(store)
    tensors = os.urandom(3_000_000)
    attempts.record_checkpoint(store, claim, 1, policy(tensors), None)
    assert 0 < before <= size_of(store) - len(tensors)


@SQLITE_ONLY
def test_sqlite_is_durable_and_checks_references(store: Store) -> None:
    with store.reading() as connection:
        pragmas = {
            name: connection.execute(sa.text(f"PRAGMA {name}")).scalar()
            for name in ("journal_mode", "synchronous", "foreign_keys", "busy_timeout")
        }
    assert pragmas == {
        "journal_mode": "wal",
        "synchronous": 2,
        "foreign_keys": 1,
        "busy_timeout": 10_000,
    }


@pytest.mark.parametrize(
    ("url", "rule"),
    [
        ("nonsense", "must be a database URL"),
        ("mysql://localhost/x", "must name a database that Tandem knows"),
        ("postgresql+pg8000://host/x", "driver that is not installed.*the extra 'postgres'"),
        ("sqlite://", "must name a file"),
        ("sqlite:///:memory:", "must name a file"),
        ("sqlite:////no/such/folder/x.db", "there is no /no/such/folder"),
        ("sqlite:///x.db?timeout=soon", r"timeout = 'soon' must lie in \(0, 3600\] s"),
        ("sqlite:///x.db?timeout=-1", r"timeout = '-1' must lie in \(0, 3600\] s"),
        ("sqlite:///x.db?timeout=1&timeout=2", r"must lie in \(0, 3600\] s"),
        ("sqlite:///x.db?mode=ro", "mode.* is not a parameter of a SQLite file.*timeout"),
    ],
)
def test_bad_database_url_says_what_is_wrong(url: str, rule: str) -> None:
    with pytest.raises(InvalidInput, match=rule):
        Store(url)


@pytest.mark.parametrize("parameter", ["colour=red", "connect_timeout=soon"])
def test_parameter_that_the_driver_refuses_is_named(parameter: str) -> None:
    store = Store(f"postgresql://me@127.0.0.1:1/x?{parameter}")
    rule = f"must have parameters that its driver takes .*{parameter.split('=')[0]}"
    with pytest.raises(InvalidInput, match=rule), store.reading():
        pass


@pytest.mark.parametrize(
    "url",
    [
        "mysql://me:secret@host/x",
        "mysql://me@host/x?password=secret",
        "postgresql+pg8000://me@host/x?password=secret",
        "postgres//me:secret@host/x",
        "postgresql://me:a@b:secret@host/x",  # an @ that is not written %40
    ],
)
def test_password_is_hidden_in_messages(url: str) -> None:
    with pytest.raises(InvalidInput) as caught:
        Store(url)
    assert "secret" not in str(caught.value)
    assert caught.value.__cause__ is None or "secret" not in str(caught.value.__cause__)


def test_password_is_hidden_in_the_shown_url() -> None:
    store = Store("postgresql://me@host/x?sslmode=require&password=secret&sslpassword=secret")
    assert store.shown_url == "postgresql://me@host/x?sslmode=require"


def test_longer_path_than_sqlite_opens_is_refused(tmp_path: Path) -> None:
    folder = tmp_path
    while len(str(folder)) < MAX_PATH_BYTES - 205:
        folder /= "a" * 100
    folder /= "b" * (MAX_PATH_BYTES - len(f"{folder}//x.db"))
    folder.mkdir(parents=True)
    longest = Store(f"sqlite:///{folder / 'x.db'}")
    with longest.reading() as connection:
        assert connection.execute(sa.text("SELECT 1")).scalar_one() == 1
    longest.close()
    with pytest.raises(InvalidInput, match="at most 504 bytes, not 505"):
        Store(f"sqlite:///{folder / 'xy.db'}")


def test_relative_path_is_made_absolute_for_workers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    store = Store("sqlite:///tandem.db")
    assert store.sqlite_path == tmp_path / "tandem.db"
    assert store.url == f"sqlite:///{tmp_path}/tandem.db"


def test_many_threads_write_and_none_is_turned_away(store: Store) -> None:
    def submit(_thread: int) -> None:
        for i in range(10):
            jobs.create_job(store, NewJob(kind="count", spec={"i": i}))

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(submit, range(8)))
    assert len(jobs.list_jobs(store, limit=200).items) == 80


@SQLITE_ONLY
def test_commit_number_differs_after_commits_and_not_after_reads(store: Store) -> None:
    first = store.commit_number()
    jobs.list_jobs(store)
    assert store.commit_number() == first is not None
    other = Store(store.url)  # as of another process
    jobs.create_job(other, NewJob(kind="count", spec={}))
    other.close()
    second = store.commit_number()
    assert second != first
    jobs.create_job(store, NewJob(kind="count", spec={}))
    assert store.commit_number() != second
    with store.writing() as connection:
        before = store.commit_number()
        connection.execute(sa.text("UPDATE jobs SET seed = 5"))
        assert store.commit_number() == before
    assert store.commit_number() != before


def test_one_key_posted_by_many_threads_makes_one_job(store: Store) -> None:
    def submit(_thread: int) -> str:
        new = NewJob(kind="count", spec={"a": 1})
        return jobs.create_job(store, new, idempotency_key="k").id

    with ThreadPoolExecutor(8) as pool:
        assert len(set(pool.map(submit, range(8)))) == 1


@SQLITE_ONLY
def test_full_database_refuses_and_keeps_what_it_has(store: Store, claim: Claim) -> None:
    fill_up(store, spare_pages=10)
    n = record_until_full(store, claim)
    assert [row.step for row in metrics.list_metrics(store, claim.job_id)] == list(
        range(1, n + 1)
    )
    assert jobs.get_job(store, claim.job_id).step == n


@SQLITE_ONLY
def test_full_database_refuses_new_jobs_with_a_reason(store: Store) -> None:
    fill_up(store, spare_pages=0)
    with pytest.raises(StorageFull, match=r"no room left in sqlite:.* free some space"):
        for i in range(1000):
            jobs.create_job(store, NewJob(kind="count", spec={"text": "x" * 2000, "i": i}))


@SQLITE_ONLY
def test_job_can_fail_in_a_full_database_with_room_set_aside(
    store: Store, claim: Claim
) -> None:
    fill_reserve(store)
    fill_up(store, spare_pages=10)
    record_until_full(store, claim)
    completion.fail(store, claim, "e" * completion.MAX_ERROR)
    job = jobs.get_job(store, claim.job_id)
    assert (job.state, job.error) == ("failed", "e" * completion.MAX_ERROR)


@SQLITE_ONLY
def test_full_database_keeps_the_earlier_resume_state(store: Store, claim: Claim) -> None:
    content = bytes(range(200)) * 2000
    earlier = resume(10, content)
    attempts.record_checkpoint(store, claim, 10, policy(), earlier)
    fill_up(store, spare_pages=4)
    with pytest.raises(StorageFull):
        attempts.record_checkpoint(store, claim, 20, policy(), resume(20, content * 2))
    assert attempts.load_resume(store, claim.job_id) == earlier


@SQLITE_ONLY
def test_disk_without_room_for_the_index_of_the_log_is_full(store: Store) -> None:
    store.close()  # the last connection removes the index
    with files_up_to(1000), pytest.raises(StorageFull):
        jobs.list_jobs(store)
    assert jobs.list_jobs(store).items == ()


def test_reserve_is_filled_once(store: Store) -> None:
    fill_reserve(store)
    fill_reserve(store)
    migrate(store)
    with store.reading() as connection:
        assert connection.execute(sa.text("SELECT count(*) FROM reserve")).scalar() == 1


@POSTGRESQL_ONLY
def test_reader_sees_one_state_and_writes_nothing(store: Store) -> None:
    count = sa.text("SELECT count(*) FROM jobs")
    with store.reading() as connection:
        before = connection.execute(count).scalar()
        jobs.create_job(store, NewJob(kind="count", spec={}))
        assert connection.execute(count).scalar() == before
    with pytest.raises(StorageUnavailable, match="read-only"), store.reading() as connection:
        connection.execute(sa.text("DELETE FROM jobs"))


@POSTGRESQL_ONLY
def test_ended_sessions_are_replaced(store: Store, postgresql: PostgresqlServer) -> None:
    job_id = jobs.create_job(store, NewJob(kind="count", spec={})).id
    postgresql.stop(signal.SIGQUIT)
    try:
        with pytest.raises(StorageUnavailable, match="cannot be used for now: connection"):
            jobs.get_job(store, job_id)
    finally:
        postgresql.start()
    assert jobs.get_job(store, job_id).id == job_id


@POSTGRESQL_ONLY
def test_session_ended_within_a_transaction_makes_storage_unavailable(
    store: Store, postgresql: PostgresqlServer
) -> None:
    with pytest.raises(StorageUnavailable), store.writing() as connection:
        pid = connection.execute(sa.text("SELECT pg_backend_pid()")).scalar()
        postgresql.execute(f"SELECT pg_terminate_backend({pid})")
        connection.execute(sa.text("DELETE FROM jobs"))


@POSTGRESQL_ONLY
def test_paused_writer_loses_its_transaction_to_the_next(
    store: Store, database_url: str
) -> None:
    options = "-c%20idle_in_transaction_session_timeout=100"
    paused = Store(f"{database_url}&options={options}")
    with pytest.raises(StorageUnavailable, match="idle-in-transaction"):
        with paused.writing() as connection:
            jobs.create_job(store, NewJob(kind="count", spec={}))
            connection.execute(sa.text("SELECT 1"))
    paused.close()


@POSTGRESQL_ONLY
def test_user_without_rights_is_named(store: Store, postgresql: PostgresqlServer) -> None:
    postgresql.execute("DROP ROLE IF EXISTS guest")
    postgresql.execute("CREATE ROLE guest LOGIN")
    guest = Store(store.url.replace("tandem@", "guest@"))
    with pytest.raises(InvalidInput, match=r"guest@.* must name the owner of the database"):
        jobs.list_jobs(guest)
    guest.close()


@POSTGRESQL_ONLY
def test_nul_is_refused_by_name(store: Store) -> None:
    with pytest.raises(InvalidInput, match="must not contain the character NUL"):
        jobs.get_job(store, "a\0b")


def test_text_that_is_no_utf8_is_refused_by_name(store: Store) -> None:
    """As bytes of a command line are that Python could not decode."""
    with pytest.raises(InvalidInput, match=r"text = 'a\\udcff' must be text in UTF-8"):
        jobs.get_job(store, "a\udcff")


def test_error_with_a_nul_is_stored(store: Store, claim: Claim) -> None:
    completion.fail(store, claim, "output: \0\0.")
    assert jobs.get_job(store, claim.job_id).error == "output: ."


def test_error_with_a_file_name_that_is_no_utf8_is_stored(store: Store, claim: Claim) -> None:
    name = os.fsdecode(b"walk-\xff.bvh")
    completion.crash(store, claim, f"cannot read {name}", max_failures=1)
    error = jobs.get_job(store, claim.job_id).error
    assert error == "Failed after 1 attempts. Last error: cannot read walk-\\udcff.bvh"


@SQLITE_ONLY
def test_transaction_beyond_the_connections_waits_no_longer_than_for_a_lock(
    store: Store,
) -> None:
    short = Store(f"{store.url}?timeout=0.2")
    with ExitStack() as held:
        for _ in range(15):
            held.enter_context(short.reading())
        with pytest.raises(StorageUnavailable, match="all connections"), short.reading():
            pass
    with short.reading():
        pass
