"""Ends of attempts: succeeded, cancelled, failed, crashed, interrupted, orphaned.

Crashes of its worker count as failures of a job; deaths of the server do not. The step of the
job becomes that of its last checkpoint, where this lies beyond the last point of the curve.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Literal

import sqlalchemy as sa

from app.errors import InvalidInput
from app.store.database.reserve import write_with_reserve
from app.store.database.tables import job_checkpoints, jobs, resume_states
from app.store.engine import Store
from app.store.fencing import change_state, fenced_update
from app.store.jobs import ended_now, read_job, select_jobs
from app.store.records import COMPOSITE_KINDS, Claim, JobRecord, SpentBudget

MAX_ERROR = 4000
"""Longest error text of a job [characters]."""
MAX_KILLS = 30
"""A job fails when its server was killed with it so many times."""


def finish(
    store: Store,
    claim: Claim,
    *,
    state: Literal["succeeded", "cancelled"] = "succeeded",
    result: Mapping[str, Any] | None = None,
    ended_by: SpentBudget | None = None,
    run_s: float | None = None,
) -> None:
    """End a job as succeeded or cancelled.

    Args:
        state: Its state; a cancelled job keeps its state to resume from.
        ended_by: The budget that ended it; it keeps its state to resume from.
        run_s: Run time of all attempts; None leaves it [s].

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        InvalidInput: A number of the result is not finite.
        StorageFull: No room is left.
    """
    changes: dict[str, Any] = {"result": None if result is None else dict(result)}
    for field, number in _not_finite(changes["result"], "result"):
        raise InvalidInput(field, number, "must be a finite number, which JSON can state")
    if ended_by is not None:
        changes["ended_by"] = ended_by
    if run_s is not None:
        changes["run_s"] = run_s

    is_complete = state == "succeeded" and ended_by is None

    def end(connection: sa.Connection) -> None:
        if is_complete:  # first, which frees space in a full database
            mine = resume_states.c.job_id == claim.job_id
            connection.execute(sa.delete(resume_states).where(mine))
        _end(connection, claim, state, changes)

    write_with_reserve(store, end)


def fail(store: Store, claim: Claim, error: str) -> None:
    """End a job with a permanent error; it keeps its state to resume from.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        StorageFull: No room is left.
    """
    changes = {"error": _shown(error)}
    write_with_reserve(store, lambda connection: _end(connection, claim, "failed", changes))


def crash(store: Store, claim: Claim, error: str, *, max_failures: int) -> JobRecord:
    """Record the crash of an attempt; queue the job again up to a number of crashes.

    A job with a requested cancel is cancelled.

    Args:
        max_failures: The job fails with this number of crashes.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
        StorageFull: No room is left.
    """

    def end(connection: sa.Connection) -> JobRecord:
        fenced_update(connection, claim, {}, counts=False)
        job = read_job(connection, claim.job_id)
        failures = job.failures + 1
        if failures < max_failures or job.cancel_requested:
            changes = {"failures": failures, "error": _shown(error)}
            _requeue(connection, claim, changes)
        else:
            text = f"Failed after {failures} attempts. Last error: {error}"
            _end(connection, claim, "failed", {"error": _shown(text), "failures": failures})
        return read_job(connection, claim.job_id)

    return write_with_reserve(store, end)


def give_back(store: Store, claim: Claim) -> None:
    """Queue the job of a stopped worker again, without counting a failure.

    Raises:
        StaleAttempt: The attempt no longer holds the job.
    """
    write_with_reserve(store, lambda connection: _requeue(connection, claim, {}))


def requeue_orphans(store: Store) -> tuple[str, ...]:
    """Queue the running jobs of an earlier server again; return their ids.

    It requires the server's lock. The higher attempt number fences off a worker that still
    runs. A kill is counted, and no failure; the job fails with its kill number MAX_KILLS. A job
    with a requested cancel is cancelled.

    Raises:
        StorageFull: No room is left.
    """
    running = jobs.c.state == "running", jobs.c.kind.not_in(COMPOSITE_KINDS)

    def requeue(connection: sa.Connection) -> tuple[str, ...]:
        orphans = select_jobs(connection, *running)
        for job in orphans:
            _requeue_killed(connection, job)
        return tuple(job.id for job in orphans)

    return write_with_reserve(store, requeue)


def _not_finite(value: object, place: str) -> Iterator[tuple[str, float]]:
    """Yield the places of numbers that JSON cannot state."""
    if isinstance(value, float) and not math.isfinite(value):
        yield place, value
    elif isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _not_finite(inner, f"{place}.{name}")
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for index, inner in enumerate(value):
            yield from _not_finite(inner, f"{place}[{index}]")


def _shown(error: str) -> str:
    """Return the end of an error as text that every database stores.

    PostgreSQL takes no NUL, and neither takes bytes of file names that are no UTF-8.
    """
    return error.replace("\0", "").encode(errors="backslashreplace").decode()[-MAX_ERROR:]


def _end(
    connection: sa.Connection, claim: Claim, state: str, changes: Mapping[str, Any]
) -> None:
    fenced_update(connection, claim, {}, counts=False)
    data: dict[str, Any] = {"attempt": claim.attempt}
    for name in ("error", "ended_by"):
        if changes.get(name):
            data[name] = changes[name]
    values = {"error": None, **changes, **ended_now(), "waiting": None}
    job = read_job(connection, claim.job_id)
    values["step"] = _steps_done(connection, job, changes.get("result"))
    values["heartbeat_at"] = values["finished_at"]
    if state != "cancelled":  # its end came before the cancel of the pruner
        values.setdefault("ended_by", None)
    change_state(connection, claim.job_id, state, values, data)


def _steps_done(
    connection: sa.Connection, job: JobRecord, result: Mapping[str, Any] | None = None
) -> int:
    """Return the steps that the attempts of a job have done, by all that they have recorded."""
    saved = sa.select(sa.func.max(job_checkpoints.c.step))
    step = connection.execute(saved.where(job_checkpoints.c.job_id == job.id)).scalar() or 0
    stated = (result or {}).get("step")  # results of trainings state it
    return max(job.step, step, stated if type(stated) is int else 0)


def _requeue_killed(connection: sa.Connection, job: JobRecord) -> None:
    kills = job.kills + 1
    if kills < MAX_KILLS or job.cancel_requested:
        _requeue(connection, job.claim, {"kills": kills})
        return
    error = (
        f"Killed {kills} times with the server, the limit; at step {job.step} of its attempt "
        f"{job.attempt}. A job that exhausts the memory of the machine ends like this: the "
        "log of the system names the reason"
    )
    changes = {"error": error, "kills": kills}
    _end(connection, job.claim, "failed", changes)


def _requeue(connection: sa.Connection, claim: Claim, changes: Mapping[str, Any]) -> None:
    fenced_update(connection, claim, {}, counts=False)
    job = read_job(connection, claim.job_id)
    data: dict[str, Any] = {"attempt": job.attempt}
    changes = {**changes, "step": _steps_done(connection, job), "waiting": None}
    if job.cancel_requested:
        values = {**changes, "error": None, **ended_now()}
        change_state(connection, job.id, "cancelled", values, data)
        return
    if changes.get("error"):
        data["error"] = changes["error"]
    change_state(connection, job.id, "queued", changes, data)
