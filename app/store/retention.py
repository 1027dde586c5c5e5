"""Removal of checkpoints, ended jobs and states: on request, and beyond a number to keep."""

import logging
from collections.abc import Iterator, Mapping

import sqlalchemy as sa

from app.errors import NotFound, WrongState
from app.store.checkpoints import drop_job_checkpoints, find_checkpoint, sole_checkpoints
from app.store.database.reserve import write_with_reserve
from app.store.database.tables import checkpoints, jobs, resume_states
from app.store.engine import Store
from app.store.jobs import read_job, select_jobs
from app.store.records import COMPOSITE_KINDS, FINAL_STATES, JobRecord
from app.store.references import to_be_evaluated

logger = logging.getLogger(__name__)

_ENDED = jobs.c.state.in_(FINAL_STATES)
_OPEN = sa.select(jobs.c.id).where(sa.not_(_ENDED), jobs.c.kind.in_(COMPOSITE_KINDS))
"""The sweeps and reports that still need their parts."""
_IS_PRUNED = sa.case((jobs.c.ended_by == "pruned", 1), else_=0)
"""1 for a trial that the pruner of a sweep has cancelled, 0 for any other job."""


def delete_job(store: Store, job_id: str, acting: Mapping[str, str]) -> tuple[str, ...]:
    """Delete an ended job: its curve, events and states, and the checkpoints only it has.

    Checkpoints with an alias, imported ones and those of other jobs stay.

    Args:
        acting: SHA-256 of each checkpoint that acts, with its place: ``"world main"``.

    Returns:
        SHA-256 of the deleted checkpoints.

    Raises:
        NotFound: There is no such job.
        WrongState: It has not ended, is part of a job that has not, or one of these checkpoints
            is in use.
        StorageFull: No room is left.
    """

    def delete(connection: sa.Connection) -> tuple[str, ...]:
        job = read_job(connection, job_id)
        if not job.is_final:
            rule = f"must be final to delete job {job.number}: cancel it first"
            raise WrongState("state", job.state, rule, FINAL_STATES)
        _require_no_part(connection, job)
        removed = sole_checkpoints(connection, job_id)
        _require_unused(connection, removed, acting, f"of job {job.number} ")
        drop_job_checkpoints(connection, job_id, beyond=-1)
        parts = sa.update(jobs).where(jobs.c.part_of == job_id)
        connection.execute(parts.values(part_of=None))  # listed by themselves from now on
        connection.execute(sa.delete(jobs).where(jobs.c.id == job_id))
        return removed

    return write_with_reserve(store, delete)


def delete_checkpoint(store: Store, sha256: str, acting: Mapping[str, str]) -> None:
    """Delete a checkpoint that was uploaded or recalibrated.

    Args:
        acting: As for :func:`delete_job`.

    Raises:
        NotFound: There is no such checkpoint.
        WrongState: It has an alias, a job made it, or it is in use.
        StorageFull: No room is left.
    """

    def delete(connection: sa.Connection) -> None:
        found = find_checkpoint(connection, sha256)
        if found.aliases:
            rule = "points to this checkpoint: remove the alias first"
            raise WrongState("alias", found.aliases[0], rule)
        if found.job_id is not None:
            number = read_job(connection, found.job_id).number
            rule = f"made this checkpoint: delete job {number} instead"
            raise WrongState("job_id", found.job_id, rule)
        _require_unused(connection, (sha256,), acting)
        connection.execute(sa.delete(checkpoints).where(checkpoints.c.sha256 == sha256))

    write_with_reserve(store, delete)


def prune(
    store: Store, *, keep_jobs: int, keep_states: int, acting: Mapping[str, str]
) -> Iterator[tuple[str, tuple[str, ...]]]:
    """Delete ended jobs beyond the newest, and states to resume from beyond the newest.

    A job with a checkpoint in use stays, and so do the parts of a job that has not ended.
    States of trials that the pruner of a sweep has cancelled go before all others.

    Args:
        keep_states: Number of ended jobs whose states are kept.
        acting: As for :func:`delete_job`.

    Yields:
        The id of each job once it is deleted, and the SHA-256 of the checkpoints that went
        with it.

    Raises:
        StorageFull: No room is left.
    """
    ended, by_end = sa.select(jobs.c.id).where(_ENDED), jobs.c.end_number.desc()
    newest = ended.order_by(by_end)
    with_state = ended.where(jobs.c.id.in_(sa.select(resume_states.c.job_id)))
    with_state = with_state.order_by(_IS_PRUNED, by_end)
    with store.reading() as connection:
        old = connection.execute(newest.offset(keep_jobs)).scalars().all()
        needed = sa.select(jobs.c.id).where(jobs.c.part_of.in_(_OPEN))
        parts = set(connection.execute(needed).scalars())
        stale = connection.execute(with_state.offset(keep_states)).scalars().all()
    if stale:
        dropped = resume_states.c.job_id.in_(ended.where(jobs.c.id.in_(stale)))
        with store.writing() as connection:
            connection.execute(sa.delete(resume_states).where(dropped))
    for job_id in (one for one in old if one not in parts):
        try:
            yield job_id, delete_job(store, job_id, acting)
        except WrongState as error:
            about = {"job_id": job_id}
            logger.info("job %s is kept: %s", job_id, error.message, extra=about)
        except NotFound:
            pass  # deleted by a request since


def _require_no_part(connection: sa.Connection, job: JobRecord) -> None:
    """Check that a job is no part of a sweep or report that has not ended."""
    for whole in select_jobs(connection, jobs.c.id == job.part_of, jobs.c.id.in_(_OPEN)):
        rule = (
            f"of job {job.number}: {whole.kind} {whole.number} has not ended and needs it; "
            f"cancel {whole.number} first"
        )
        raise WrongState("part_of", job.part_of, rule)


def _require_unused(
    connection: sa.Connection,
    removed: tuple[str, ...],
    acting: Mapping[str, str],
    whose: str = "",
) -> None:
    """Check that no checkpoint that would go acts or is to be evaluated.

    The problem has ``whose``, such as ``"of job 5 "``, behind its name.
    """
    for sha256 in removed:
        if sha256 in acting:
            rule = f"{whose}acts in {acting[sha256]}: choose another policy there"
            raise WrongState("checkpoint", sha256, rule)
    for sha256, number in to_be_evaluated(connection, removed):
        rule = f"{whose}is evaluated by job {number}: wait for its end, or cancel it first"
        raise WrongState("checkpoint", sha256, rule)
