"""References of jobs: stored when a job is queued, kept until it has ended.

Both are checked in the transaction that queues the job or deletes the object: of two at once
the later one is refused.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any

import sqlalchemy as sa

from app.errors import InvalidInput, WrongState
from app.store.database.tables import aliases, cells, checkpoints, jobs, recordings
from app.store.records import FINAL_STATES, NewJob, References


def references_of(job: NewJob) -> References:
    """Return what a job refers to; its cell may be a shipped one."""
    return _references(job.spec, job.overrides or {})


def named_checkpoint(connection: sa.Connection, reference: str | None) -> str | None:
    """Return the SHA-256 that an alias names; anything else as it is."""
    query = sa.select(aliases.c.sha256).where(aliases.c.name == reference)
    return connection.execute(query).scalar() or reference


def require_stored(connection: sa.Connection, references: References) -> None:
    """Check that what a job refers to is stored.

    Raises:
        InvalidInput: Something is not, since it was deleted after the job was checked.
    """
    checkpoint, cell = references.checkpoint, references.cell
    named = named_checkpoint(connection, checkpoint)
    rows = [
        ("checkpoint", checkpoint, checkpoints.c.sha256 == named),
        ("overrides.cell", cell, cells.c.name == cell),
    ]
    for place, name in enumerate(references.recordings):
        rows.append((f"recordings[{place}]", name, recordings.c.name == name))
    for field, given, same in rows:
        query = sa.select(sa.literal(1)).where(same)
        if given is not None and connection.execute(query).first() is None:
            raise InvalidInput(field, given, "is no longer stored")


def to_be_evaluated(
    connection: sa.Connection, among: Collection[str]
) -> Iterator[tuple[str, int]]:
    """Yield those of some checkpoints that jobs which have not ended evaluate, by number.

    The checkpoint is the one that the job's alias named at the submission.
    """
    named = jobs.c.checkpoint.in_(among)
    earlier = sa.and_(jobs.c.checkpoint.is_(None), jobs.c.kind == "evaluate")
    query = sa.select(jobs.c.number, jobs.c.checkpoint, jobs.c.spec)  # before migration 0013
    query = query.where(jobs.c.state.not_in(FINAL_STATES), named | earlier)
    for row in connection.execute(query.order_by(jobs.c.number)):
        sha256 = row.checkpoint or row.spec.get("checkpoint")
        if sha256 in among:
            yield sha256, row.number


def require_unused(
    connection: sa.Connection, field: str, name: str, refers: Callable[[References], bool]
) -> None:
    """Check that no job that has not ended refers to an object.

    Args:
        refers: Whether references are to this object.

    Raises:
        WrongState: A job does.
    """
    query = sa.select(jobs.c.number, jobs.c.spec, jobs.c.overrides)
    query = query.where(jobs.c.state.not_in(FINAL_STATES)).order_by(jobs.c.number)
    for row in connection.execute(query):
        if refers(_references(row.spec, row.overrides)):
            rule = f"is in use by job {row.number}, which has not ended: cancel the job first"
            raise WrongState(field, name, rule)


def _references(spec: Mapping[str, Any], overrides: Mapping[str, Any]) -> References:
    return References(
        checkpoint=spec.get("checkpoint"),
        cell=overrides.get("cell"),
        recordings=tuple(spec.get("recordings", ())),
    )
