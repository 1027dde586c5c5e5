"""Writes of a running attempt: its claim, heartbeats, progress, checkpoints.

Every write is fenced (``app.store.fencing``). ``app.store.completion`` ends attempts.
"""

import logging
import math
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa

from app.digests import digest, has_digest
from app.errors import InvalidInput
from app.store.checkpoints import drop_job_checkpoints, insert_checkpoint
from app.store.database.tables import events, job_checkpoints, jobs, metrics, resume_states
from app.store.engine import Store
from app.store.events import append_event, drop_points
from app.store.fencing import change_state, fenced_update
from app.store.jobs import read_job, select_jobs
from app.store.records import COMPOSITE_KINDS, Claim, JobRecord, NewCheckpoint, ResumeState

logger = logging.getLogger(__name__)

MAX_RESUME = 256 * 1024 * 1024
"""Largest tensors of a resume state [bytes]."""


def claim_next(store: Store) -> tuple[Claim, JobRecord] | None:
    """Claim the oldest queued job of the highest priority; None: nothing is queued.

    Points of the curve and checkpoints beyond the last resume state are deleted, since the new
    attempt repeats those steps.
    """
    queued = sa.select(jobs.c.id).where(
        jobs.c.state == "queued", jobs.c.kind.not_in(COMPOSITE_KINDS)
    )
    first = queued.order_by(jobs.c.priority.desc(), jobs.c.number)
    with store.reading() as connection:  # an empty queue needs no write lock
        if connection.execute(first.limit(1)).scalar() is None:
            return None
    with store.writing() as connection:
        job_id = connection.execute(first.limit(1)).scalar()
        if job_id is None:
            return None
        found = next(_sound_states(connection, job_id), None)
        step = -1 if found is None else found.step
        _forget_beyond(connection, job_id, step)
        attempt = read_job(connection, job_id).attempt + 1
        now, started = datetime.now(UTC), jobs.c.started_at
        changes = {
            "state": "running",
            "attempt": attempt,
            "started_at": sa.func.coalesce(started, sa.literal(now, started.type)),
            "heartbeat_at": now,
            "step": max(step, 0),
            "waiting": None,
        }
        data = {"attempt": attempt, "resumed_from_step": max(step, 0)}
        change_state(connection, job_id, "running", changes, data)
        job = read_job(connection, job_id)
        return job.claim, job


def heartbeat(
    store: Store, claim: Claim, waiting: str | None = None, *, run_s: float | None = None
) -> JobRecord:
    """Record a heartbeat and return the job, with ``cancel_requested``.

    Args:
        waiting: Reason for which its worker cannot write.
        run_s: Run time of all attempts; None leaves it [s].

    Raises:
        StaleAttempt: The attempt no longer holds the job.
    """
    changes: dict[str, Any] = {"heartbeat_at": datetime.now(UTC), "waiting": waiting}
    if run_s is not None:
        changes["run_s"] = run_s
    with store.writing() as connection:
        fenced_update(connection, claim, changes, counts=False)
        return read_job(connection, claim.job_id)


def record_progress(
    store: Store,
    claim: Claim,
    step: int,
    values: Mapping[str, float | None],
    *,
    total_steps: int | None = None,
) -> None:
    """Add a point to the job's curve; the last one again has no effect.

    Args:
        step: Steps done, above every recorded step.
        values: Named finite numbers; None where not defined.
        total_steps: Steps to do, where known.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        InvalidInput: The step is not above the last recorded one, or a value is not finite.
        StorageFull: No room is left.
    """
    for name, value in values.items():
        if value is not None and not math.isfinite(value):
            raise InvalidInput(name, value, "must be finite, or None where not defined")
    now = datetime.now(UTC)
    changes: dict[str, Any] = {"step": step}
    if total_steps is not None:
        changes["total_steps"] = total_steps
    with store.writing() as connection:
        alive = {"heartbeat_at": now, "waiting": None}
        fenced_update(connection, claim, alive, counts=False)
        points = sa.select(metrics).where(metrics.c.job_id == claim.job_id)
        last = connection.execute(points.order_by(metrics.c.step.desc()).limit(1)).first()
        if last is not None and (last.step, last.values) == (step, dict(values)):
            return
        if last is not None and step <= last.step:
            rule = f"must lie above the last recorded step {last.step}"
            raise InvalidInput("step", step, rule)
        event_id = fenced_update(connection, claim, changes)
        row = {"job_id": claim.job_id, "step": step, "values": dict(values), "at": now}
        connection.execute(sa.insert(metrics).values(row))
        append_event(connection, claim.job_id, event_id, "progress", step=step)


def record_checkpoint(
    store: Store,
    claim: Claim,
    step: int,
    policy: NewCheckpoint,
    resume: ResumeState | None = None,
) -> bool:
    """Store the policy of a step and, in the same transaction, the state to resume from.

    Args:
        step: Steps done, not below those of the last checkpoint; one of the same step is
            replaced.
        resume: Stored beside the job's last one; earlier ones are deleted.

    Returns:
        Whether it is new; the last one again has no effect.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        InvalidInput: A size exceeds its limit, the steps differ, or a later checkpoint is
            stored.
        StorageFull: No room is left; the earlier resume state stays.
    """
    if resume is not None and resume.step != step:
        raise InvalidInput("resume.step", resume.step, f"must equal the checkpoint's {step}")
    if resume is not None and len(resume.tensors) > MAX_RESUME:
        rule = f"bytes exceed the limit of {MAX_RESUME} bytes"
        raise InvalidInput("resume.tensors", len(resume.tensors), rule)
    with store.writing() as connection:
        alive = {"heartbeat_at": datetime.now(UTC), "waiting": None}
        fenced_update(connection, claim, alive, counts=False)
        if _is_last(connection, claim.job_id, step, policy, resume):
            insert_checkpoint(connection, policy)  # it may be damaged
            return False
        event_id = fenced_update(connection, claim, {})
        drop_job_checkpoints(connection, claim.job_id, beyond=step - 1)
        insert_checkpoint(connection, policy)
        link = {"job_id": claim.job_id, "step": step, "sha256": policy.sha256}
        connection.execute(sa.insert(job_checkpoints).values(link))
        if resume is not None:
            _replace_resume(connection, claim.job_id, resume)
        data = {"sha256": policy.sha256}
        append_event(connection, claim.job_id, event_id, "checkpoint", data=data, step=step)
    return True


def load_resume(
    store: Store, job_id: str, usable: Callable[[ResumeState], bool] = lambda _: True
) -> ResumeState | None:
    """Return the newest undamaged resume state of a job; None where there is none.

    Args:
        usable: Whether what a state refers to is there, such as its files.
    """
    below: int | None = None
    while True:
        with store.reading() as connection:  # over before files are read
            found = next(_sound_states(connection, job_id, below), None)
        if found is None or usable(found):
            return found
        below = found.step


def has_resume(store: Store, job_id: str) -> bool:
    """Return whether a job has a state to resume from, sound or not."""
    query = sa.select(resume_states.c.step).where(resume_states.c.job_id == job_id)
    with store.reading() as connection:
        return connection.execute(query).first() is not None


def resume_earlier(store: Store, claim: Claim, step: int | None) -> None:
    """Let a claimed attempt start from an earlier state than its claim states.

    The job's points and checkpoints beyond that state are deleted. Once the attempt has
    recorded something, the same start again has no effect: it was delayed.

    Args:
        step: Step of the state; None: the attempt starts without one.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        InvalidInput: The attempt has recorded something since its start from another step.
    """
    with store.writing() as connection:
        fenced_update(connection, claim, {}, counts=False)
        started_from, has_recorded = _start_of(connection, claim.job_id)
        if has_recorded and started_from != (step or 0):
            rule = f"must equal {started_from}, the start of what the attempt has recorded"
            raise InvalidInput("step", step, rule)
        if has_recorded:
            return
        _forget_beyond(connection, claim.job_id, -1 if step is None else step)
        if started_from != (step or 0):
            data = {"attempt": claim.attempt, "resumed_from_step": step or 0}
            change_state(connection, claim.job_id, "running", {"step": step or 0}, data)


def _start_of(connection: sa.Connection, job_id: str) -> tuple[int, bool]:
    """Return the first step of a running attempt, and whether it has recorded something."""
    of_job = sa.select(events).where(events.c.job_id == job_id)
    states = of_job.where(events.c.kind == "state").order_by(events.c.id.desc())
    found = connection.execute(states).all()
    start = next(one for one in found if one.data.get("state") == "running")
    later = of_job.where(events.c.id > start.id, events.c.kind != "state").limit(1)
    return start.data["resumed_from_step"], connection.execute(later).first() is not None


def resume_manifests(store: Store, job_id: str) -> tuple[Mapping[str, Any], ...]:
    """Return the manifests of a job's resume states, without their tensors."""
    query = sa.select(resume_states.c.manifest).where(resume_states.c.job_id == job_id)
    with store.reading() as connection:
        return tuple(connection.execute(query).scalars())


def running_jobs(store: Store) -> list[JobRecord]:
    """Return the running jobs that have a worker."""
    running = jobs.c.state == "running"
    with store.reading() as connection:
        return select_jobs(connection, running, jobs.c.kind.not_in(COMPOSITE_KINDS))


def _forget_beyond(connection: sa.Connection, job_id: str, step: int) -> None:
    beyond = sa.and_(resume_states.c.job_id == job_id, resume_states.c.step > step)
    connection.execute(sa.delete(resume_states).where(beyond))
    drop_points(connection, job_id, beyond=step)
    drop_job_checkpoints(connection, job_id, beyond=step)


def _is_last(
    connection: sa.Connection,
    job_id: str,
    step: int,
    policy: NewCheckpoint,
    resume: ResumeState | None,
) -> bool:
    """Return whether a checkpoint and its state are a job's last ones; refuse a delayed one."""
    mine = sa.select(job_checkpoints).where(job_checkpoints.c.job_id == job_id)
    last = connection.execute(mine.order_by(job_checkpoints.c.step.desc()).limit(1)).first()
    if last is not None and step < last.step:
        rule = f"must not lie below {last.step}, the last checkpoint's"
        raise InvalidInput("step", step, rule)
    if last is None or (last.step, last.sha256) != (step, policy.sha256):
        return False
    if resume is None:
        return True
    stored = sa.select(resume_states.c.digest)
    stored = stored.where(resume_states.c.job_id == job_id, resume_states.c.step == step)
    return connection.execute(stored).scalar() == _digest(resume)


def _digest(resume: ResumeState) -> str:
    return digest({"manifest": dict(resume.manifest)}, resume.tensors)


def _replace_resume(connection: sa.Connection, job_id: str, resume: ResumeState) -> None:
    mine = resume_states.c.job_id == job_id
    newest = sa.select(sa.func.max(resume_states.c.step))
    newest = newest.where(mine, resume_states.c.step < resume.step)
    previous = connection.execute(newest).scalar()
    keeps = resume_states.c.step != (-1 if previous is None else previous)
    connection.execute(sa.delete(resume_states).where(mine, keeps))
    values = {
        "job_id": job_id,
        "step": resume.step,
        "manifest": dict(resume.manifest),
        "digest": _digest(resume),
        "tensors": resume.tensors,
    }
    connection.execute(sa.insert(resume_states).values(values))


def _sound_states(
    connection: sa.Connection, job_id: str, below: int | None = None
) -> Iterator[ResumeState]:
    """Yield the undamaged resume states of a job, newest first; those of earlier steps."""
    mine = sa.select(resume_states).where(resume_states.c.job_id == job_id)
    if below is not None:
        mine = mine.where(resume_states.c.step < below)
    for row in connection.execute(mine.order_by(resume_states.c.step.desc())):
        if has_digest(row.digest, {"manifest": row.manifest}, row.tensors):
            yield ResumeState(step=row.step, manifest=row.manifest, tensors=row.tensors)
            continue
        logger.warning(
            "job %s: its state at step %d is damaged, it resumes from an earlier one",
            job_id,
            row.step,
            extra={"job_id": job_id},
        )
