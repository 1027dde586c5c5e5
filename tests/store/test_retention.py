import json
import sqlite3
from contextlib import closing
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import sqlalchemy as sa

from app.errors import NotFound, WrongState
from app.storage_errors import StorageFull
from app.store import (
    attempts,
    checkpoints,
    completion,
    composed_jobs,
    events,
    jobs,
    metrics,
    retention,
)
from app.store.database import tables
from app.store.database.backup import restore_backup, write_backup
from app.store.database.size import MIN_FREE_BYTES
from app.store.engine import Store
from app.store.records import Claim, NewJob, ResumeState
from jobs.retention import Retention
from tests.store.test_attempts import policy
from tests.support.databases import SQLITE_ONLY, claimed, started


def save(store: Store, claim: Claim, step: int, content: bytes) -> str:
    state = ResumeState(step=step, manifest={}, tensors=b"state")
    made = policy(content)
    attempts.record_checkpoint(store, claim, step, made, state)
    return made.sha256


def rows(store: Store, table: str) -> int:
    with store.reading() as connection:
        return int(connection.execute(sa.text(f"SELECT count(*) FROM {table}")).scalar_one())


def test_deleted_job_leaves_nothing_but_shared_and_named_checkpoints(
    store: Store, claim: Claim
) -> None:
    own, named, shared = (save(store, claim, k, bytes([k])) for k in (1, 2, 3))
    attempts.record_progress(store, claim, 4, {"value": 1.0})
    checkpoints.set_alias(store, "best", named)
    completion.finish(store, claim, state="cancelled")
    other = started(store)
    save(store, other, 3, bytes([3]))
    assert retention.delete_job(store, claim.job_id, {}) == (own,)
    assert {c.sha256 for c in checkpoints.list_checkpoints(store).items} == {named, shared}
    assert (rows(store, "metrics"), rows(store, "resume_states")) == (0, 1)
    assert events.list_events(store, claim.job_id) == ()
    assert jobs.find_job(store, claim.job_id) is None
    with pytest.raises(NotFound):
        retention.delete_job(store, claim.job_id, {})


def test_job_that_has_not_ended_is_not_deleted(store: Store, claim: Claim) -> None:
    with pytest.raises(WrongState, match="must be final to delete job 1: cancel it first"):
        retention.delete_job(store, claim.job_id, {})


def test_job_with_an_acting_checkpoint_is_not_deleted(store: Store, claim: Claim) -> None:
    sha256 = save(store, claim, 1, b"1")
    completion.finish(store, claim)
    with pytest.raises(WrongState, match="acts in world main") as refused:
        retention.delete_job(store, claim.job_id, {sha256: "world main"})
    assert refused.value.problem()["field"] == "checkpoint"
    assert checkpoints.get_checkpoint(store, sha256).job_id == claim.job_id


def test_job_whose_checkpoint_is_to_be_evaluated_is_not_deleted(
    store: Store, claim: Claim
) -> None:
    spec = {"kind": "evaluate", "checkpoint": save(store, claim, 1, b"1")}
    completion.finish(store, claim)
    user = jobs.create_job(store, NewJob(kind="evaluate", spec=spec))
    with pytest.raises(WrongState, match=f"is evaluated by job {user.number}"):
        retention.delete_job(store, claim.job_id, {})
    jobs.request_cancel(store, user.id)
    assert len(retention.delete_job(store, claim.job_id, {})) == 1


@SQLITE_ONLY
def test_deletion_takes_no_longer_with_many_jobs_in_the_queue(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[str] = []
    ended = []
    for content in (b"1", b"2"):
        claim = started(store)
        save(store, claim, 1, content)
        completion.finish(store, claim, state="cancelled")
        ended.append(claim.job_id)
    loads = json.loads
    monkeypatch.setattr(json, "loads", lambda text: read.append(text) or loads(text))
    retention.delete_job(store, ended[0], {})
    few = len(read)
    for _ in range(30):
        jobs.create_job(store, NewJob(kind="evaluate", spec={"checkpoint": "other"}))
    read.clear()
    retention.delete_job(store, ended[1], {})
    assert len(read) == few  # columns of JSON: no spec of a queued job


def test_uploaded_checkpoint_is_deleted_once_nothing_uses_it(store: Store) -> None:
    sha256 = checkpoints.put_checkpoint(store, policy(b"1")).sha256
    checkpoints.set_alias(store, "best", sha256)
    with pytest.raises(WrongState, match="remove the alias first") as refused:
        retention.delete_checkpoint(store, sha256, {})
    assert (refused.value.field, refused.value.value) == ("alias", "best")
    checkpoints.remove_alias(store, "best")
    user = jobs.create_job(store, NewJob(kind="evaluate", spec={"checkpoint": sha256}))
    with pytest.raises(WrongState, match="is evaluated by job 1: wait for its end"):
        retention.delete_checkpoint(store, sha256, {})
    jobs.request_cancel(store, user.id)
    with pytest.raises(WrongState, match="acts in world main"):
        retention.delete_checkpoint(store, sha256, {sha256: "world main"})
    retention.delete_checkpoint(store, sha256, {})
    assert checkpoints.list_checkpoints(store).items == ()
    with pytest.raises(NotFound):
        retention.delete_checkpoint(store, sha256, {})


def test_checkpoint_of_a_job_goes_with_the_job_only(store: Store, claim: Claim) -> None:
    sha256 = save(store, claim, 1, b"1")
    checkpoints.put_checkpoint(store, policy(b"1"))  # uploaded, too
    completion.finish(store, claim)
    with pytest.raises(WrongState, match="delete job 1 instead") as refused:
        retention.delete_checkpoint(store, sha256, {})
    assert (refused.value.field, refused.value.value) == ("job_id", claim.job_id)
    assert retention.delete_job(store, claim.job_id, {}) == ()
    retention.delete_checkpoint(store, sha256, {})
    assert rows(store, "checkpoints") == 0


def test_parts_of_a_deleted_job_are_jobs_of_their_own(store: Store, claim: Claim) -> None:
    new = NewJob(kind="count", spec={}, part_of=claim.job_id, trial=1)
    part = jobs.create_job(store, new)
    completion.finish(store, claim)
    retention.delete_job(store, claim.job_id, {})
    assert [job.id for job in jobs.list_jobs(store, part_of="none").items] == [part.id]


def test_newest_ended_jobs_and_states_are_kept(store: Store, claim: Claim) -> None:
    ended, made = [claim.job_id], {}
    acts = save(store, claim, 1, b"0")
    completion.fail(store, claim, "x")
    for k in range(1, 5):
        later = started(store)
        made[later.job_id] = (save(store, later, 1, bytes([k])),)
        completion.fail(store, later, "x")
        ended.append(later.job_id)
    active = started(store)
    save(store, active, 1, b"active")
    gone = dict(retention.prune(store, keep_jobs=2, keep_states=1, acting={acts: "w"}))
    assert gone == {job_id: made[job_id] for job_id in ended[1:3]}
    kept = {ended[0], ended[3], ended[4], active.job_id}
    assert {job.id for job in jobs.list_jobs(store).items} == kept
    assert attempts.load_resume(store, ended[4]) is not None
    assert attempts.load_resume(store, ended[3]) is None
    assert attempts.load_resume(store, active.job_id) is not None
    assert not list(retention.prune(store, keep_jobs=2, keep_states=1, acting={acts: "w"}))


def test_pruned_trials_take_no_state_from_other_jobs(store: Store, claim: Claim) -> None:
    save(store, claim, 1, b"0")
    completion.finish(store, claim, ended_by="time budget")
    pruned = []
    for k in range(1, 4):
        trial = started(store)
        save(store, trial, 1, bytes([k]))
        composed_jobs.mark_pruned(store, trial.job_id)
        jobs.request_cancel(store, trial.job_id)
        completion.finish(store, trial, state="cancelled")
        pruned.append(trial.job_id)
    for keep, kept in ((2, [claim.job_id, pruned[2]]), (1, [claim.job_id])):
        list(retention.prune(store, keep_jobs=9, keep_states=keep, acting={}))
        found = [one for one in (claim.job_id, *pruned) if attempts.has_resume(store, one)]
        assert found == kept


def test_job_that_ended_last_is_kept_though_the_clock_stepped_back(
    store: Store, claim: Claim
) -> None:
    later = started(store)
    completion.fail(store, later, "x")
    ahead = datetime.now(UTC) + timedelta(hours=1)
    with store.writing() as connection:
        connection.execute(sa.update(tables.jobs).values(finished_at=ahead))
    completion.fail(store, claim, "x")  # submitted first, ended last
    assert list(dict(retention.prune(store, keep_jobs=1, keep_states=1, acting={}))) == [
        later.job_id
    ]


def test_curve_of_a_deleted_job_is_not_found(store: Store, claim: Claim) -> None:
    completion.finish(store, claim)
    retention.delete_job(store, claim.job_id, {})
    with pytest.raises(NotFound):
        metrics.list_metrics(store, claim.job_id)


def test_parts_of_a_job_that_has_not_ended_are_kept(store: Store, claim: Claim) -> None:
    completion.finish(store, claim)
    sweep = jobs.create_job(store, NewJob(kind="sweep", spec={}))
    composed_jobs.start(store, sweep.id)
    part = jobs.create_job(store, NewJob(kind="count", spec={}, part_of=sweep.id, trial=1))
    found = claimed(store)
    completion.finish(store, found[0])
    with pytest.raises(WrongState, match="sweep 2 has not ended and needs it; cancel 2 first"):
        retention.delete_job(store, part.id, {})
    newest = started(store)
    completion.finish(store, newest)
    gone = dict(retention.prune(store, keep_jobs=1, keep_states=1, acting={}))
    assert tuple(gone) == (claim.job_id,)
    composed_jobs.end(store, sweep.id, "cancelled")
    gone = dict(retention.prune(store, keep_jobs=2, keep_states=1, acting={}))
    assert tuple(gone) == (part.id,)


def test_what_was_deleted_before_the_disk_is_full_is_deleted_completely(
    store: Store, tmp_path: Path
) -> None:
    made = {}
    for content in (b"1", b"2", b"3"):
        claim = started(store)
        made[claim.job_id] = save(store, claim, 1, content)
        completion.finish(store, claim, state="cancelled")
        (tmp_path / f"{claim.job_id}.log").touch()
    left: list[int] = [2]  # writes: of states, and of the first job

    def fill(_connection: sa.Connection) -> None:
        left[0] -= 1
        if left[0] < 0:
            raise StorageFull("the disk")

    removed: list[str] = []
    retention = Retention(
        store=store,
        logs=tmp_path,
        keep_jobs=1,
        keep_states=1,
        acting=dict,
        on_removed=removed.extend,
    )
    with pytest.raises(StorageFull):
        retention.apply(store.fenced(fill))
    kept = {job.id for job in jobs.list_jobs(store).items}
    assert {one.stem for one in tmp_path.glob("*.log")} == kept
    assert removed == [sha256 for job_id, sha256 in made.items() if job_id not in kept] != []


@SQLITE_ONLY
def test_space_of_deleted_rows_is_given_back_to_the_disk(
    store: Store, claim: Claim, tmp_path: Path
) -> None:
    state = ResumeState(step=1, manifest={}, tensors=bytes(2 * MIN_FREE_BYTES))
    attempts.record_checkpoint(store, claim, 1, policy(b"1"), state)
    completion.finish(store, claim, state="cancelled")
    keep = Retention(store=store, logs=tmp_path, keep_jobs=1, keep_states=0, acting=dict)
    turns = [keep.apply(store) for _ in range(3)]
    assert turns == [True, True, False]  # each is short: other writers wait
    store.close()  # the log is now in the file
    assert store.sqlite_path is not None
    assert store.sqlite_path.stat().st_size < 1.2 * MIN_FREE_BYTES
    assert jobs.get_job(store, claim.job_id).state == "cancelled"


@SQLITE_ONLY
def test_file_of_an_earlier_version_shrinks_once_its_backup_is_restored(
    store: Store, claim: Claim, tmp_path: Path
) -> None:
    save(store, claim, 1, bytes(100_000))
    store.close()
    path = store.sqlite_path
    assert path is not None
    with closing(sqlite3.connect(path)) as database:
        for statement in ("journal_mode = DELETE", "auto_vacuum = NONE"):
            database.execute(f"PRAGMA {statement}")
        database.execute("VACUUM")
    completion.finish(store, claim, state="cancelled")
    retention.delete_job(store, claim.job_id, {})
    write_backup(store, tmp_path, tmp_path / "b.tar")
    store.close()
    restore_backup(store, tmp_path, tmp_path / "b.tar")
    with closing(sqlite3.connect(path)) as database:
        (mode,) = database.execute("PRAGMA auto_vacuum").fetchone()
        (free,) = database.execute("PRAGMA freelist_count").fetchone()
    assert (mode, free) == (2, 0)
