"""Actions on jobs beside cancel: resume, name, notes, priority, budgets."""

from collections.abc import Mapping, Sequence
from typing import Any

import sqlalchemy as sa

from app.errors import InvalidInput, WrongState
from app.store.database.tables import jobs, resume_states
from app.store.engine import Store
from app.store.fencing import change_state
from app.store.jobs import NOTHING, read_job
from app.store.records import COMPOSITE_KINDS, JobRecord, References
from app.store.references import require_stored

BUDGETS = ("step_budget", "time_budget_s")
REPEATABLE = ("cancelled", "failed")
"""States from which a job is resumed or retried."""


def resume_steps(store: Store, job_ids: Sequence[str]) -> dict[str, int]:
    """Return the step of the newest state to resume from, for the jobs that have one."""
    with store.reading() as connection:
        return _newest_steps(connection, job_ids)


def resume_job(
    store: Store,
    job_id: str,
    budget: Mapping[str, float | None] | None = None,
    references: References = NOTHING,
) -> JobRecord:
    """Queue an ended job again; its next attempt resumes from its newest state.

    Crashes and kills before count no longer.

    Args:
        job_id: A job that is cancelled, has failed, or was ended by a budget or failed parts.
        budget: Changed budgets by name; None removes one.
        references: What must be stored.

    Raises:
        NotFound: There is no such job.
        WrongState: It has not ended or is complete, or it has no state to resume from.
        InvalidInput: A budget is spent already, or a reference is not stored.
    """
    with store.writing() as connection:
        job = read_job(connection, job_id)
        if not job.is_final or job.ended_by is None:  # one that is pruned has it earlier
            require_repeatable(job, "resume")
        step = _newest_steps(connection, [job_id]).get(job_id)
        if step is None and job.kind in COMPOSITE_KINDS:
            step = job.step
        elif step is None:
            rule = (
                f"for job {job.number}: it ended before its first checkpoint, or its state is "
                "not kept any more; retry it, which starts at step 0"
            )
            raise WrongState("resume_step", None, rule)
        budgets = {"step_budget": job.step_budget, "time_budget_s": job.time_budget_s}
        budgets |= budget or {}
        require_stored(connection, references)
        _require_left(job, budgets, {"step_budget": step, "time_budget_s": job.run_s})
        changes = {
            **budgets,
            "failures": 0,
            "kills": 0,
            "cancel_requested": False,
            "error": None,
            "ended_by": None,
            "result": None,
            "finished_at": None,
        }
        change_state(connection, job_id, "queued", changes, {"attempt": job.attempt})
        return read_job(connection, job_id)


def _newest_steps(connection: sa.Connection, job_ids: Sequence[str]) -> dict[str, int]:
    query = (
        sa.select(resume_states.c.job_id, sa.func.max(resume_states.c.step).label("step"))
        .where(resume_states.c.job_id.in_(job_ids))
        .group_by(resume_states.c.job_id)
    )
    return {row.job_id: row.step for row in connection.execute(query)}


def _require_left(
    job: JobRecord, budgets: Mapping[str, float | None], used: Mapping[str, float]
) -> None:
    """Check that something is left of each budget."""
    units = {"step_budget": "steps", "time_budget_s": "s of run time"}
    for name, budget in budgets.items():
        if budget is not None and budget <= used[name]:
            spent = f"{used[name]:.10g} {units[name]}"
            rule = f"must be above the {spent} that job {job.number} has used"
            raise InvalidInput(name, budget, rule)


def require_repeatable(job: JobRecord, action: str) -> None:
    """Check that a job has ended without a result.

    Raises:
        WrongState: It has not ended, or has succeeded.
    """
    if job.state in REPEATABLE:
        return
    remedy = "cancel it first"
    if job.state == "succeeded":
        remedy = "clone it with changes"
        if job.ended_by:
            composed = job.kind in COMPOSITE_KINDS
            remedy = "resume it" if composed else "resume it with a larger budget"
    rule = f"must be {' or '.join(REPEATABLE)} to {action} job {job.number}: {remedy}"
    raise WrongState("state", job.state, rule, REPEATABLE)


def change_labels(store: Store, job_id: str, changes: Mapping[str, Any]) -> JobRecord:
    """Change name, notes, priority or budgets of a job.

    A priority counts while the job is queued, a budget until it has succeeded.

    Raises:
        NotFound: There is no such job.
        WrongState: A budget is changed of a job that has succeeded.
        InvalidInput: A budget is spent already.
    """
    with store.writing() as connection:
        job = read_job(connection, job_id)
        budgets = {name: changes[name] for name in BUDGETS if name in changes}
        if budgets and job.state == "succeeded":
            rule = f"must not be succeeded to change a budget of job {job.number}: resume it"
            raise WrongState("state", job.state, rule)
        step: int | None = job.step
        if job.state in REPEATABLE:
            step = _newest_steps(connection, [job_id]).get(job_id)
        _require_left(job, budgets, {"step_budget": step or 0, "time_budget_s": job.run_s})
        if changes:
            connection.execute(sa.update(jobs).where(jobs.c.id == job_id).values(**changes))
        return read_job(connection, job_id)
