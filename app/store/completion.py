"""Ends of attempts: succeeded, cancelled, failed, crashed, interrupted, orphaned.

Crashes of its worker count as failures of a job; deaths of the server do not.
"""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, Literal

import sqlalchemy as sa

from app.errors import StorageFull
from app.store.engine import Store
from app.store.fencing import change_state, fenced_update, peek
from app.store.jobs import read_job
from app.store.records import Claim, JobRecord
from app.store.tables import jobs, reserve, resume_states

MAX_ERROR = 4000
"""Longest error text of a job [characters]."""
RESERVE_BYTES = 128 * 1024
"""Space reserved for marking a job failed in a full database [bytes]."""


def finish(
    store: Store,
    claim: Claim,
    *,
    state: Literal["succeeded", "cancelled"] = "succeeded",
    result: Mapping[str, Any] | None = None,
) -> None:
    """End a job as succeeded or cancelled.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        StorageFull: No room is left.
    """
    with store.writing() as connection:
        _drop_resume(connection, claim)
        changes = {"result": None if result is None else dict(result)}
        _end(connection, claim, state, changes)


def fail(store: Store, claim: Claim, error: str) -> None:
    """End a job with a permanent error.

    On a full database the reserved space is freed; the supervisor reserves it again at its next
    start.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        StorageFull: The reserved space was not sufficient.
    """
    changes = {"error": error[-MAX_ERROR:]}
    try:
        with store.writing() as connection:
            _drop_resume(connection, claim)
            _end(connection, claim, "failed", changes)
    except StorageFull:
        with store.writing() as connection:
            connection.execute(sa.delete(reserve))
            _drop_resume(connection, claim)
            _end(connection, claim, "failed", changes)


def crash(store: Store, claim: Claim, error: str, *, max_failures: int) -> JobRecord:
    """Record the crash of an attempt; queue the job again up to a number of crashes.

    Args:
        store: The database.
        claim: The crashed attempt.
        error: The cause, as far as known.
        max_failures: The job fails with this number of crashes.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        StorageFull: No room is left.
    """
    job = peek(store, claim)
    failures = job.failures + 1
    if failures >= max_failures:
        fail(store, claim, f"Failed after {failures} attempts. Last error: {error}")
    else:
        with store.writing() as connection:
            changes = {"failures": failures, "error": error[-MAX_ERROR:]}
            fenced_update(connection, claim, {}, counts=False)
            _requeue(connection, claim.job_id, changes)
    with store.reading() as connection:
        return read_job(connection, claim.job_id)


def give_back(store: Store, claim: Claim) -> None:
    """Queue the job of a stopped worker again, without counting a failure.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
    """
    with store.writing() as connection:
        fenced_update(connection, claim, {}, counts=False)
        _requeue(connection, claim.job_id, {})


def requeue_orphans(store: Store) -> tuple[str, ...]:
    """Queue the running jobs of an earlier server again; requires the server's lock.

    The higher attempt number fences off a worker that still runs. Nothing is counted as a
    failure. A job with a requested cancel is cancelled.

    Returns:
        The ids of these jobs.
    """
    running = sa.select(jobs.c.id).where(jobs.c.state == "running").order_by(jobs.c.number)
    with store.writing() as connection:
        orphans = connection.execute(running).scalars().all()
        for job_id in orphans:
            _requeue(connection, job_id, {})
    return tuple(orphans)


def fill_reserve(store: Store) -> None:
    """Reserve space, so that a job can be marked failed in a full database."""
    with store.writing() as connection:
        if connection.execute(sa.select(reserve.c.id)).first() is None:
            filler = bytes(RESERVE_BYTES)
            connection.execute(sa.insert(reserve).values(id=1, filler=filler))


def _end(
    connection: sa.Connection, claim: Claim, state: str, changes: Mapping[str, Any]
) -> None:
    fenced_update(connection, claim, {}, counts=False)
    now = datetime.now(UTC)
    data: dict[str, Any] = {"attempt": claim.attempt}
    if changes.get("error"):
        data["error"] = changes["error"]
    values = {"error": None, **changes, "finished_at": now, "heartbeat_at": now}
    change_state(connection, claim.job_id, state, values, data)


def _requeue(connection: sa.Connection, job_id: str, changes: Mapping[str, Any]) -> None:
    job = read_job(connection, job_id, for_update=True)
    data: dict[str, Any] = {"attempt": job.attempt}
    if job.cancel_requested:
        values = {**changes, "error": None, "finished_at": datetime.now(UTC)}
        connection.execute(sa.delete(resume_states).where(resume_states.c.job_id == job_id))
        change_state(connection, job_id, "cancelled", values, data)
        return
    if changes.get("error"):
        data["error"] = changes["error"]
    change_state(connection, job_id, "queued", changes, data)


def _drop_resume(connection: sa.Connection, claim: Claim) -> None:
    """Delete the resume state first, which frees space in a full database."""
    fenced_update(connection, claim, {}, counts=False)
    mine = resume_states.c.job_id == claim.job_id
    connection.execute(sa.delete(resume_states).where(mine))
