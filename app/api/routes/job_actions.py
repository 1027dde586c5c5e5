"""Actions on jobs: cancel, resume, retry, clone, change, delete."""

from dataclasses import replace
from typing import Annotated, Any

from fastapi import APIRouter, Body, Response

from app.api.description import CREATED
from app.api.job_requests import (
    IdempotencyKey,
    JobDep,
    known_spec,
    queued,
    repeated,
    require_named,
    shown,
    stored_references,
)
from app.api.schemas import examples
from app.api.schemas.examples import named
from app.api.schemas.jobs import JobPublic
from app.api.services import ServicesDep
from app.api.validation import validated
from app.store import job_actions, jobs
from jobs.job_changes import Budget, JobChanges
from jobs.spec import SPEC_TYPES, budgets, merge, require_budgeted

CHANGES = Body(
    description="fields that differ from the job's spec, as a JSON merge patch (RFC 7396): "
    "objects are merged, null removes a member; also name, notes, priority and budgets",
    openapi_examples=named({"change": examples.CHANGES}),
)

LABELS = Body(openapi_examples=named({"label": examples.LABELS}))
BUDGET = Body(
    description="changed budgets; without one they stay",
    openapi_examples=named({"larger": examples.BUDGET}),
)
DELETED: dict[int | str, dict[str, Any]] = {
    409: {
        "description": "The job or the one that it is part of has not ended, or one of its "
        "checkpoints is in use"
    },
    507: {},
}
ENDED: dict[int | str, dict[str, Any]] = {
    409: {"description": "The job is in another state"},
    507: {},
}
REPEATED: dict[int | str, dict[str, Any]] = {
    202: CREATED,
    409: {
        "description": "The job is in another state, an equal repetition has not ended, or the "
        "idempotency key belongs to another body"
    },
    507: {},
}

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["jobs"])


@router.post("/cancel", status_code=202, summary="Cancel a job", responses=ENDED)
def cancel_job(job: JobDep, services: ServicesDep) -> JobPublic:
    """Cancel a queued job at once, or stop a running one.

    A running training stores a last checkpoint after its present step; an evaluation, sweep or
    report stops without one.
    """
    cancelled = jobs.request_cancel(services.store, job.id)
    services.supervisor.wake()
    return shown(cancelled, services)


@router.post("/resume", status_code=202, summary="Resume an ended job", responses=ENDED)
def resume_job(
    job: JobDep, services: ServicesDep, body: Annotated[Budget | None, BUDGET] = None
) -> JobPublic:
    """Queue the same job again; it continues from its newest state, at ``resume_step``.

    A job can be resumed if it was cancelled, failed, or was ended by a budget, which must then
    be larger. A report that lacks the results of some evaluations runs these again.
    """
    changes = {} if body is None else body.model_dump(exclude_unset=True)
    require_budgeted(job, changes)
    references = stored_references(job)
    resumed = job_actions.resume_job(services.store, job.id, changes, references)
    services.supervisor.wake()
    return shown(resumed, services)


@router.post(
    "/retry",
    status_code=202,
    summary="Run a cancelled or failed job again",
    responses=REPEATED,
)
def retry_job(
    job_id: str,
    services: ServicesDep,
    response: Response,
    idempotency_key: IdempotencyKey = None,
) -> JobPublic:
    """Queue a new job with the same spec, name, priority and budgets, which starts at step 0.

    The first job stays as it is; its notes are not copied.
    """
    submitted = {"retry": job_id}
    if (earlier := repeated(services, response, idempotency_key, submitted)) is not None:
        return earlier
    job = jobs.get_job(services.store, job_id)
    labels = {"name": job.name, "priority": job.priority}
    spec = known_spec(job)
    if spec.get("checkpoint") is not None:
        spec["checkpoint"] = job.checkpoint or spec["checkpoint"]
    body = validated(SPEC_TYPES[job.kind], {**spec, **labels, **budgets(job)})
    new = replace(body.new_job(), parent=job.id)

    def check() -> None:
        job_actions.require_repeatable(job, "retry")
        require_named(body, new, services)

    return queued(new, services, response, idempotency_key, check, submitted)


@router.post(
    "/clone",
    status_code=202,
    summary="Start a job like another, with changes",
    responses=REPEATED,
)
def clone_job(
    job_id: str,
    services: ServicesDep,
    response: Response,
    changes: Annotated[dict[str, Any], CHANGES],
    idempotency_key: IdempotencyKey = None,
) -> JobPublic:
    """Queue a new job with the spec and budgets of this one and the given changes.

    Name, notes and priority are those of the changes, or the defaults.
    """
    submitted = {"clone": job_id, "changes": changes}
    if (earlier := repeated(services, response, idempotency_key, submitted)) is not None:
        return earlier
    job = jobs.get_job(services.store, job_id)
    body = validated(SPEC_TYPES[job.kind], merge({**known_spec(job), **budgets(job)}, changes))
    new = replace(body.new_job(), parent=job.id)

    def check() -> None:
        require_named(body, new, services)

    return queued(new, services, response, idempotency_key, check, submitted)


@router.patch("", summary="Change name, notes, priority or budgets of a job", responses=ENDED)
def update_job(
    job: JobDep, services: ServicesDep, body: Annotated[JobChanges, LABELS]
) -> JobPublic:
    """Change the given members; null removes name, notes or a budget.

    A priority counts while the job is queued, a budget until the job has succeeded.
    """
    changes = body.given()
    require_budgeted(job, changes)
    changed = job_actions.change_labels(services.store, job.id, changes)
    return shown(changed, services)


@router.delete("", status_code=204, summary="Delete an ended job", responses=DELETED)
def delete_job(job: JobDep, services: ServicesDep) -> None:
    """Delete a job with its curve, its states and the checkpoints without an alias."""
    services.retention.delete(job.id)
