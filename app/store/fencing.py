"""Fencing of writes about a running job by its attempt number.

Every write contains an ``UPDATE ... WHERE id = ? AND attempt = ? AND state = 'running'`` in the
same transaction, so that an attempt that lost its job cannot change anything.
"""

from collections.abc import Mapping
from typing import Any

import sqlalchemy as sa

from app.storage_errors import StaleAttempt
from app.store.database.tables import jobs
from app.store.engine import Store
from app.store.events import append_event
from app.store.jobs import find_job
from app.store.records import Claim, JobRecord


def fenced_update(
    connection: sa.Connection, claim: Claim, changes: Mapping[str, Any], *, counts: bool = True
) -> int:
    """Change the job's row if the claim holds it; return the id for the event."""
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


def change_state(
    connection: sa.Connection,
    job_id: str,
    state: str,
    changes: Mapping[str, Any],
    data: Mapping[str, Any],
) -> None:
    """Change the state of a job and append the event, inside a transaction."""
    values = {**changes, "state": state, "last_event": jobs.c.last_event + 1}
    statement = sa.update(jobs).where(jobs.c.id == job_id).values(values)
    event_id = connection.execute(statement.returning(jobs.c.last_event)).scalar_one()
    append_event(connection, job_id, event_id, "state", data={"state": state, **data})


def peek(store: Store, claim: Claim) -> JobRecord:
    """Return the job of a claim without writing.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
    """
    job = find_job(store, claim.job_id)  # None: deleted after its end
    if job is None or job.claim != claim or job.state not in ("running", "cancelling"):
        raise StaleAttempt(claim.job_id, claim.attempt)
    return job
