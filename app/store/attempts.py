"""What workers and the supervisor write: claims, progress, checkpoints, ends.

Every write of an attempt goes through one fenced UPDATE
(``WHERE id = ? AND attempt = ? AND state = 'running'``) in the same transaction: an attempt
that lost its job, for whatever reason, can change nothing any more.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Literal

import sqlalchemy as sa

from app.errors import InvalidInput, StaleAttempt, StorageFull
from app.store.checkpoints import drop_job_checkpoints, insert_checkpoint
from app.store.engine import Store
from app.store.events import append_event
from app.store.jobs import job_from_row, read_job
from app.store.records import Claim, JobRecord, NewCheckpoint, ResumeState
from app.store.tables import events, job_checkpoints, jobs, metrics, reserve, resume_states

MAX_RESUME = 900 * 1024 * 1024
"""Largest resume state; SQLite holds blobs of at most 1e9 bytes [bytes]."""

MAX_ERROR = 4000
"""Longest error text kept with a job [characters]."""

_RESERVE_BYTES = 128 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """The little that a supervisor needs to watch over a running job."""

    claim: Claim
    """The attempt that runs."""
    cancel_requested: bool
    """Whether somebody asked to cancel it."""
    heartbeat_at: datetime | None
    """Last sign of life of its worker."""


def claim_next(store: Store) -> tuple[Claim, JobRecord] | None:
    """Take the oldest queued job and start its next attempt.

    Points of the curve and checkpoints beyond the last resume state are dropped, since the
    new attempt will write those steps again.

    Returns:
        The claim and the job, or None if nothing is queued.
    """
    oldest = sa.select(jobs.c.id).where(jobs.c.state == "queued").order_by(jobs.c.number)
    with store.writing() as connection:
        job_id = connection.execute(oldest.limit(1).with_for_update(skip_locked=True)).scalar()
        if job_id is None:
            return None
        step = _forget_beyond_resume(connection, job_id)
        attempt = read_job(connection, job_id).attempt + 1
        now = datetime.now(UTC)
        changes = {
            "state": "running",
            "attempt": attempt,
            "started_at": sa.func.coalesce(jobs.c.started_at, now),
            "heartbeat_at": now,
            "step": max(step, 0),
        }
        data = {"attempt": attempt, "resumed_from_step": max(step, 0)}
        _change_state(connection, job_id, "running", changes, data)
        return Claim(job_id=job_id, attempt=attempt), read_job(connection, job_id)


def heartbeat(store: Store, claim: Claim) -> JobRecord:
    """Note that the worker lives and return its job, with ``cancel_requested``.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
    """
    with store.writing() as connection:
        _fenced(connection, claim, {"heartbeat_at": datetime.now(UTC)}, counts=False)
        return read_job(connection, claim.job_id)


def peek(store: Store, claim: Claim) -> JobRecord:
    """Return the job of a claim without writing.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
    """
    with store.reading() as connection:
        job = read_job(connection, claim.job_id)
    if job.attempt != claim.attempt or job.state not in ("running", "cancelling"):
        raise StaleAttempt(claim.job_id, claim.attempt)
    return job


def record_progress(
    store: Store,
    claim: Claim,
    step: int,
    values: Mapping[str, float | None],
    *,
    total_steps: int | None = None,
) -> None:
    """Add one point to the job's curve.

    Args:
        store: The database.
        claim: The attempt that writes.
        step: Steps done, above every step recorded before.
        values: Named numbers; None where not defined. No NaN, no infinity.
        total_steps: Steps to do, where known.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        InvalidInput: The step lies not above the one recorded last.
        StorageFull: No room is left.
    """
    now = datetime.now(UTC)
    changes: dict[str, Any] = {"heartbeat_at": now, "step": step}
    if total_steps is not None:
        changes["total_steps"] = total_steps
    with store.writing() as connection:
        event_id = _fenced(connection, claim, changes)
        mine = metrics.c.job_id == claim.job_id
        last = connection.execute(sa.select(sa.func.max(metrics.c.step)).where(mine)).scalar()
        if last is not None and step <= last:
            raise InvalidInput("step", step, f"must lie above the last recorded step {last}")
        row = {"job_id": claim.job_id, "step": step, "values": dict(values), "at": now}
        connection.execute(sa.insert(metrics).values(row))
        append_event(connection, claim.job_id, event_id, "progress", step=step)


def record_checkpoint(
    store: Store,
    claim: Claim,
    step: int,
    policy: NewCheckpoint,
    resume: ResumeState | None = None,
) -> None:
    """Store the policy of a step and, in the same transaction, what a new attempt needs.

    Args:
        store: The database.
        claim: The attempt that writes.
        step: Steps done.
        policy: The policy as it acts.
        resume: Replaces the job's earlier resume state.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        InvalidInput: Something is too large, or the steps differ.
        StorageFull: No room is left; the earlier resume state stays.
    """
    if resume is not None and resume.step != step:
        raise InvalidInput("resume.step", resume.step, f"must equal the checkpoint's {step}")
    if resume is not None and len(resume.tensors) > MAX_RESUME:
        rule = f"bytes exceed the limit of {MAX_RESUME} bytes"
        raise InvalidInput("resume.tensors", len(resume.tensors), rule)
    mine = job_checkpoints.c.job_id == claim.job_id
    with store.writing() as connection:
        event_id = _fenced(connection, claim, {"heartbeat_at": datetime.now(UTC)})
        insert_checkpoint(connection, policy)
        connection.execute(
            sa.delete(job_checkpoints).where(mine, job_checkpoints.c.step == step)
        )
        link = {"job_id": claim.job_id, "step": step, "sha256": policy.sha256}
        connection.execute(sa.insert(job_checkpoints).values(link))
        if resume is not None:
            _replace_resume(connection, claim.job_id, resume)
        data = {"sha256": policy.sha256}
        append_event(connection, claim.job_id, event_id, "checkpoint", data=data, step=step)


def load_resume(store: Store, job_id: str) -> ResumeState | None:
    """Return what a new attempt goes on from; None to start afresh."""
    query = sa.select(resume_states).where(resume_states.c.job_id == job_id)
    with store.reading() as connection:
        row = connection.execute(query).first()
    if row is None:
        return None
    return ResumeState(step=row.step, manifest=row.manifest, tensors=row.tensors)


def finish(
    store: Store,
    claim: Claim,
    *,
    state: Literal["succeeded", "cancelled"] = "succeeded",
    result: Mapping[str, Any] | None = None,
) -> None:
    """End a job well, or as cancelled.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        StorageFull: No room is left.
    """
    with store.writing() as connection:
        _drop_resume(connection, claim)
        changes = {"result": None if result is None else dict(result)}
        _end(connection, claim, state, changes)


def fail(store: Store, claim: Claim, error: str) -> None:
    """End a job with an error that no further attempt would cure.

    On a full database the room reserved for this moment is given up; the supervisor sets it
    aside again when it next starts.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        StorageFull: Not even that was enough.
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
    """Note that an attempt died; queue the job again unless that happened too often.

    Args:
        store: The database.
        claim: The attempt that died.
        error: Why, as far as known.
        max_failures: The job fails with its crash number ``max_failures``.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        StorageFull: No room is left.
    """
    job = peek(store, claim)
    failures = job.failures + 1
    if failures >= max_failures:
        fail(store, claim, f"crashed {failures} times, the last time so: {error}")
    else:
        with store.writing() as connection:
            changes = {"failures": failures, "error": error[-MAX_ERROR:]}
            _fenced(connection, claim, {}, counts=False)
            _requeue(connection, claim.job_id, changes)
    with store.reading() as connection:
        return read_job(connection, claim.job_id)


def give_back(store: Store, claim: Claim) -> None:
    """Queue a job again whose worker was stopped on purpose; not counted as a failure.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
    """
    with store.writing() as connection:
        _fenced(connection, claim, {}, counts=False)
        _requeue(connection, claim.job_id, {})


def requeue_orphans(store: Store) -> tuple[str, ...]:
    """Queue again what an earlier server left running; call it while holding the data lock.

    No process is looked for or killed: the raised attempt number fences off whatever may
    still run. Nothing is counted as a failure. Jobs that were to be cancelled are cancelled.

    Returns:
        The ids of these jobs.
    """
    running = sa.select(jobs.c.id).where(jobs.c.state == "running").order_by(jobs.c.number)
    with store.writing() as connection:
        orphans = connection.execute(running).scalars().all()
        for job_id in orphans:
            _requeue(connection, job_id, {})
    return tuple(orphans)


def watch_running(store: Store) -> tuple[Watch, ...]:
    """Return the running jobs, with what a supervisor looks at."""
    query = sa.select(jobs).where(jobs.c.state == "running")
    with store.reading() as connection:
        found = [job_from_row(row) for row in connection.execute(query).mappings()]
    return tuple(
        Watch(
            claim=Claim(job_id=job.id, attempt=job.attempt),
            cancel_requested=job.cancel_requested,
            heartbeat_at=job.heartbeat_at,
        )
        for job in found
    )


def fill_reserve(store: Store) -> None:
    """Set room aside, so that a job can be marked failed when the database is full."""
    with store.writing() as connection:
        if connection.execute(sa.select(reserve.c.id)).first() is None:
            filler = bytes(_RESERVE_BYTES)
            connection.execute(sa.insert(reserve).values(id=1, filler=filler))


def _fenced(
    connection: sa.Connection, claim: Claim, changes: Mapping[str, Any], *, counts: bool = True
) -> int:
    """Change the job's row if the claim still holds it; return the id for the event."""
    statement = (
        sa.update(jobs)
        .where(jobs.c.id == claim.job_id, jobs.c.attempt == claim.attempt)
        .where(jobs.c.state == "running")
        .values(last_event=jobs.c.last_event + int(counts), **changes)
        .returning(jobs.c.last_event)
    )
    event_id: int | None = connection.execute(statement).scalar()
    if event_id is None:
        raise StaleAttempt(claim.job_id, claim.attempt)
    return event_id


def _change_state(
    connection: sa.Connection,
    job_id: str,
    state: str,
    changes: Mapping[str, Any],
    data: Mapping[str, Any],
) -> None:
    values = {**changes, "state": state, "last_event": jobs.c.last_event + 1}
    statement = sa.update(jobs).where(jobs.c.id == job_id).values(values)
    event_id = connection.execute(statement.returning(jobs.c.last_event)).scalar_one()
    append_event(connection, job_id, event_id, "state", data={"state": state, **data})


def _end(
    connection: sa.Connection, claim: Claim, state: str, changes: Mapping[str, Any]
) -> None:
    _fenced(connection, claim, {}, counts=False)
    now = datetime.now(UTC)
    data: dict[str, Any] = {"attempt": claim.attempt}
    if changes.get("error"):
        data["error"] = changes["error"]
    values = {"error": None, **changes, "finished_at": now, "heartbeat_at": now}
    _change_state(connection, claim.job_id, state, values, data)


def _requeue(connection: sa.Connection, job_id: str, changes: Mapping[str, Any]) -> None:
    job = read_job(connection, job_id, for_update=True)
    data: dict[str, Any] = {"attempt": job.attempt}
    if job.cancel_requested:
        values = {**changes, "finished_at": datetime.now(UTC)}
        connection.execute(sa.delete(resume_states).where(resume_states.c.job_id == job_id))
        _change_state(connection, job_id, "cancelled", values, data)
        return
    if changes.get("error"):
        data["error"] = changes["error"]
    _change_state(connection, job_id, "queued", changes, data)


def _forget_beyond_resume(connection: sa.Connection, job_id: str) -> int:
    """Drop what the dead attempt wrote after its last resume state; return that step."""
    query = sa.select(resume_states.c.step).where(resume_states.c.job_id == job_id)
    found = connection.execute(query).scalar()
    step = -1 if found is None else int(found)
    connection.execute(
        sa.delete(metrics).where(metrics.c.job_id == job_id, metrics.c.step > step)
    )
    connection.execute(sa.delete(events).where(events.c.job_id == job_id, events.c.step > step))
    drop_job_checkpoints(connection, job_id, beyond=step)
    return step


def _replace_resume(connection: sa.Connection, job_id: str, resume: ResumeState) -> None:
    connection.execute(sa.delete(resume_states).where(resume_states.c.job_id == job_id))
    values = {
        "job_id": job_id,
        "step": resume.step,
        "manifest": dict(resume.manifest),
        "tensors": resume.tensors,
    }
    connection.execute(sa.insert(resume_states).values(values))


def _drop_resume(connection: sa.Connection, claim: Claim) -> None:
    """Free the resume state first: on a full database this makes room for what follows."""
    _fenced(connection, claim, {}, counts=False)
    mine = resume_states.c.job_id == claim.job_id
    connection.execute(sa.delete(resume_states).where(mine))
