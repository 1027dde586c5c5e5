"""Sweeps: their rows, and the jobs of their trials. ``jobs.sweeps`` decides what is next."""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, Literal

import sqlalchemy as sa

from app.store.database.tables import jobs, metrics
from app.store.engine import Store
from app.store.events import append_event
from app.store.fencing import change_state
from app.store.jobs import job_from_row, read_job
from app.store.records import SWEEP, JobRecord


def open_sweeps(store: Store) -> tuple[JobRecord, ...]:
    """Return the sweeps that have not ended, oldest first."""
    active = jobs.c.state.in_(("queued", "running"))
    return _found(store, sa.select(jobs).where(active, jobs.c.kind == SWEEP))


def jobs_of(store: Store, sweep_id: str) -> tuple[JobRecord, ...]:
    """Return the trainings and evaluations of a sweep, oldest first."""
    return _found(store, sa.select(jobs).where(jobs.c.part_of == sweep_id))


def start_sweep(store: Store, sweep_id: str) -> None:
    """Let a queued sweep run."""
    with store.writing() as connection:
        job = read_job(connection, sweep_id, for_update=True)
        if job.state == "queued":
            now = datetime.now(UTC)
            changes = {"started_at": job.started_at or now, "attempt": job.attempt + 1}
            change_state(connection, sweep_id, "running", changes, {"attempt": job.attempt + 1})


def record_sweep(store: Store, sweep_id: str, done: int, best: float | None) -> None:
    """Add a point to the curve of a sweep, where more trials have ended than before.

    Args:
        store: The database.
        sweep_id: The sweep.
        done: Number of ended trials.
        best: Best value so far; None before the first.
    """
    with store.writing() as connection:
        job = read_job(connection, sweep_id, for_update=True)
        if done <= job.step or job.is_final:
            return
        event = job.last_event + 1
        statement = sa.update(jobs).where(jobs.c.id == sweep_id)
        connection.execute(statement.values(step=done, last_event=event))
        row = {"job_id": sweep_id, "step": done, "values": {"best": best}}
        connection.execute(sa.insert(metrics).values(row | {"at": datetime.now(UTC)}))
        append_event(connection, sweep_id, event, "progress", step=done)


def end_sweep(
    store: Store,
    sweep_id: str,
    state: Literal["succeeded", "failed", "cancelled"],
    *,
    result: Mapping[str, Any] | None = None,
    error: str | None = None,
) -> None:
    """End a sweep."""
    changes = {"result": result, "error": error, "finished_at": datetime.now(UTC)}
    with store.writing() as connection:
        job = read_job(connection, sweep_id, for_update=True)
        if not job.is_final:
            data = {"attempt": job.attempt} | ({"error": error} if error else {})
            change_state(connection, sweep_id, state, changes, data)


def mark_pruned(store: Store, job_id: str) -> None:
    """State that a training is cancelled by the pruner of its sweep."""
    with store.writing() as connection:
        mine = jobs.c.id == job_id
        connection.execute(sa.update(jobs).where(mine).values(ended_by="pruned"))


def _found(store: Store, query: sa.Select[Any]) -> tuple[JobRecord, ...]:
    with store.reading() as connection:
        rows = connection.execute(query.order_by(jobs.c.number)).mappings().all()
    return tuple(job_from_row(row) for row in rows)
