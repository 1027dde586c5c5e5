"""Jobs that are made of jobs: sweeps and reports.

``jobs.composed.sweeps`` and ``jobs.composed.reports`` decide what is next.
"""

import contextlib
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from typing import Any, Literal

import sqlalchemy as sa

from app.errors import NotFound, WrongState
from app.store.database.tables import jobs, metrics
from app.store.engine import Store
from app.store.events import append_event, drop_points
from app.store.fencing import change_state
from app.store.jobs import cancel_parts, ended_now, read_job, select_jobs
from app.store.jobs import request_cancel as cancel_job
from app.store.records import EarlyEnd, JobRecord


def open_jobs(store: Store, kind: str) -> tuple[JobRecord, ...]:
    """Return the jobs of a kind that have not ended, oldest first."""
    active = jobs.c.state.in_(("queued", "running"))
    with store.reading() as connection:
        return tuple(select_jobs(connection, active, jobs.c.kind == kind))


def parts_of(store: Store, job_id: str) -> tuple[JobRecord, ...]:
    """Return the trainings and evaluations of a job, oldest first."""
    with store.reading() as connection:
        return tuple(select_jobs(connection, jobs.c.part_of == job_id))


def start(store: Store, job_id: str) -> None:
    """Let a queued job run."""
    with store.writing() as connection:
        job = read_job(connection, job_id)
        if job.state == "queued":
            now = datetime.now(UTC)
            changes = {"started_at": job.started_at or now, "attempt": job.attempt + 1}
            change_state(connection, job_id, "running", changes, {"attempt": job.attempt + 1})


def record(store: Store, job_id: str, done: int, values: Mapping[str, float | None]) -> None:
    """Add a point to the curve of a job, where the number of its ended parts has changed.

    It falls when parts are repeated: later points and their events are deleted, as when a
    training is resumed.

    Args:
        done: Number of ended trials or evaluations.
    """
    with store.writing() as connection:
        job = read_job(connection, job_id)
        if done == job.step or job.is_final:
            return
        drop_points(connection, job_id, beyond=done - 1)
        event = job.last_event + 1
        if done < job.step:  # which revokes the points of readers
            data = {"state": job.state, "attempt": job.attempt}
            data |= {"resumed_from_step": max(done - 1, 0)}
            append_event(connection, job_id, event, "state", data=data)
            event += 1
        statement = sa.update(jobs).where(jobs.c.id == job_id)
        connection.execute(statement.values(step=done, last_event=event))
        row = {"job_id": job_id, "step": done, "values": dict(values)}
        connection.execute(sa.insert(metrics).values(row | {"at": datetime.now(UTC)}))
        append_event(connection, job_id, event, "progress", step=done)


def end(
    store: Store,
    job_id: str,
    state: Literal["succeeded", "failed", "cancelled"],
    *,
    result: Mapping[str, Any] | None = None,
    error: str | None = None,
    ended_by: EarlyEnd | None = None,
) -> None:
    """End a job; the parts of one that fails are cancelled in the same transaction."""
    changes = {"result": result, "error": error, "ended_by": ended_by, **ended_now()}
    with store.writing() as connection:
        job = read_job(connection, job_id)
        if not job.is_final:
            data = {"attempt": job.attempt} | ({"error": error} if error else {})
            change_state(connection, job_id, state, changes, data)
            if state == "failed":
                cancel_parts(connection, job_id)


def cancel(store: Store, job: JobRecord, parts: Iterable[JobRecord]) -> None:
    """Cancel the parts of a job; the job ends after the last of them."""
    active = [part for part in parts if not part.is_final]
    for part in active:
        request_cancel(store, part)
    if not active:
        end(store, job.id, "cancelled")


def request_cancel(store: Store, job: JobRecord) -> None:
    """Request the cancel of a part that may have ended since."""
    with contextlib.suppress(WrongState, NotFound):
        cancel_job(store, job.id)


def mark_pruned(store: Store, job_id: str) -> None:
    """State that a training is cancelled by the pruner of its sweep, unless it has ended."""
    with store.writing() as connection:
        mine = sa.and_(jobs.c.id == job_id, jobs.c.state.in_(("queued", "running")))
        connection.execute(sa.update(jobs).where(mine).values(ended_by="pruned"))
