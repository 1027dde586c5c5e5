"""Events of jobs, the source of event streams.

Ids increase strictly within a job in the order of commits, so that reading after the last known
id gives every event once. When an attempt resumes from an earlier step, the progress beyond it
is deleted here and in the curve; the ``state`` event of the start has ``resumed_from_step``.
"""

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa

from app.store.database.tables import events, metrics
from app.store.engine import Store
from app.store.records import JobEvent


def list_events(
    store: Store, job_id: str, *, after: int = 0, limit: int = 500
) -> tuple[JobEvent, ...]:
    """Return the events of a job with an id above ``after``, oldest first.

    Args:
        after: Last known id (``Last-Event-ID``), 0 for all.
    """
    on_step = sa.and_(metrics.c.job_id == events.c.job_id, metrics.c.step == events.c.step)
    query = (
        sa.select(events, metrics.c["values"].label("curve"))
        .outerjoin(metrics, sa.and_(on_step, events.c.kind == "progress"))
        .where(events.c.job_id == job_id, events.c.id > after)
        .order_by(events.c.id)
        .limit(limit)
    )
    with store.reading() as connection:
        rows = connection.execute(query).all()
    return tuple(JobEvent(id=row.id, kind=row.kind, data=_data(row), at=row.at) for row in rows)


def append_event(
    connection: sa.Connection,
    job_id: str,
    event_id: int,
    kind: str,
    *,
    data: Mapping[str, Any] | None = None,
    step: int | None = None,
) -> None:
    """Insert an event in the transaction that set ``jobs.last_event`` to its id."""
    connection.execute(
        sa.insert(events).values(
            job_id=job_id,
            id=event_id,
            kind=kind,
            step=step,
            data=dict(data or {}),
            at=datetime.now(UTC),
        )
    )


def drop_points(connection: sa.Connection, job_id: str, *, beyond: int) -> None:
    """Delete the points of a job's curve beyond a step, and their events."""
    for table in (metrics, events):
        connection.execute(
            sa.delete(table).where(table.c.job_id == job_id, table.c.step > beyond)
        )


def _data(row: Any) -> dict[str, Any]:
    step = {} if row.step is None else {"step": row.step}
    return {**step, **row.data, **(row.curve or {})}
