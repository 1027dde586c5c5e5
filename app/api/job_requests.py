"""Jobs in HTTP requests: lookup by path, pages of the list, checks before one is queued."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Annotated, Any, NamedTuple

from fastapi import Depends, Header, Response

from app.api.schemas.jobs import JobList, JobPublic
from app.api.services import Services, ServicesDep
from app.errors import InvalidInput
from app.policies.checkpoints import pretrained
from app.policies.configs import presets
from app.policies.evaluation.registry import (
    OF_CHOICE,
    WITHOUT_CHECKPOINT,
    check_task,
    lacks_for_choice,
)
from app.policies.report.page import evaluations
from app.sim.cells.cell import cell_names
from app.store import job_actions, jobs, metrics
from app.store.records import JobKind, JobRecord, JobState, MetricRow, NewJob, References
from app.store.references import references_of
from jobs.spec import AnySpec, EvaluateSpec, ReportSpec, SweepSpec


class PageQuery(NamedTuple):
    """Requested page of the list of jobs; fields as in ``app.store.jobs.list_jobs``."""

    cursor: str | None
    limit: int
    state: JobState | None
    part_of: str | None
    kind: JobKind | None
    preset: str | None


def page_of_jobs(services: Services, query: PageQuery, waiting: str | None) -> bytes:
    """Return a page of the jobs as JSON, newest first.

    Args:
        waiting: Reason for which no job runs.

    Raises:
        InvalidInput: The cursor or limit is invalid.
    """
    page = jobs.list_jobs(services.store, **query._asdict())
    steps = job_actions.resume_steps(services.store, [job.id for job in page.items])
    items = [
        JobPublic.from_domain(
            job, None if job.is_final else newest_point(services, job), steps.get(job.id)
        )
        for job in page.items
    ]
    answer = JobList(items=items, next_cursor=page.next_cursor, waiting=waiting)
    return answer.model_dump_json().encode()


def job_of_path(job_id: str, services: ServicesDep) -> JobRecord:
    """Return the job that the path names."""
    return jobs.get_job(services.store, job_id)


JobDep = Annotated[JobRecord, Depends(job_of_path)]
IdempotencyKey = Annotated[
    str | None, Header(description="the same key never makes a second job")
]


def require_named(body: AnySpec, new: NewJob, services: Services) -> None:
    """Check that everything that a job names exists.

    Args:
        body: Spec of the job.
        new: The job to queue.

    Raises:
        InvalidInput: A checkpoint, cell or recording is unknown or unfit.
        NotReady: A shipped checkpoint is not stored yet.
    """
    if not _shipped_of(body, new) <= services.checkpoints.aliases.keys():
        services.readiness.require()
    if isinstance(body, EvaluateSpec):
        if body.checkpoint is not None:
            record, _ = services.checkpoints.read(body.checkpoint)
            check_task(body.protocol, record.manifest, body.checkpoint)
        services.recordings.check(body.recordings)
    if new.preset is not None:
        preset = presets.resolve(new.preset, new.overrides or {})
        cell = services.cells.to_train_in(preset)
        if isinstance(body, SweepSpec) and body.objective.protocol in OF_CHOICE:
            if (lack := lacks_for_choice(cell)) is not None:
                rule = f"cannot be run in the cell {cell.name!r}: it {lack}"
                raise InvalidInput("objective.protocol", body.objective.protocol, rule)


def _shipped_of(body: AnySpec, new: NewJob) -> set[str]:
    """Return the aliases of the shipped checkpoints that a job needs."""
    needed: set[str | None] = {new.spec.get("checkpoint")}
    if isinstance(body, ReportSpec) and body.measure:
        needed = {checkpoint for _, checkpoint in evaluations().values()}
    return {alias for alias in needed if alias in pretrained.ALIASES}


def queued(
    new: NewJob,
    services: Services,
    response: Response,
    key: str | None,
    check: Callable[[], None],
    submitted: Mapping[str, Any] | None = None,
) -> JobPublic:
    """Queue a job; ``Location`` says where to follow it.

    Args:
        key: Idempotency key of the request.
        check: Refuses a request of which no job is queued yet.
        submitted: JSON data that repetitions of the request have in common; None: spec, labels
            and budgets of the job.

    Raises:
        Conflict: The key was used for another request.
    """
    job = None
    if key is not None:
        job = jobs.find_submission(services.store, new, key, submitted)
    if job is None:
        check()
        job = jobs.create_job(
            services.store,
            new,
            idempotency_key=key,
            references=stored_references(new),
            submitted=submitted,
        )
        services.supervisor.wake()
    return _located(job, response)


def repeated(
    services: Services, response: Response, key: str | None, submitted: Mapping[str, Any]
) -> JobPublic | None:
    """Return the job that the same action on another job has queued; None: none yet.

    The other job may have been deleted since.

    Args:
        key: Idempotency key of the request.
        submitted: As for :func:`queued`.

    Raises:
        Conflict: The key was used for another request.
    """
    job = None if key is None else jobs.find_repetition(services.store, key, submitted)
    return None if job is None else _located(job, response)


def _located(job: JobRecord, response: Response) -> JobPublic:
    """Return a queued job, with its address in the answer."""
    response.headers["Location"] = f"/v1/jobs/{job.id}"
    return JobPublic.from_domain(job)


def stored_references(job: NewJob) -> References:
    """Return what a job refers to in the database, which has no shipped cells."""
    found = references_of(job)
    return replace(found, cell=None) if found.cell in cell_names() else found


def shown(job: JobRecord, services: Services) -> JobPublic:
    """Return a job with the newest point of its curve and the step it would resume from."""
    steps = job_actions.resume_steps(services.store, [job.id])
    return JobPublic.from_domain(job, newest_point(services, job), steps.get(job.id))


def newest_point(services: Services, job: JobRecord) -> MetricRow | None:
    """Return the last point of a job's curve, None before the first."""
    if job.step <= 0:
        return None
    return metrics.newest_point(services.store, job.id)


def known_spec(job: JobRecord) -> dict[str, Any]:
    """Return a job's spec by the present rules; older evaluations without policy name one."""
    spec = dict(job.spec)
    if spec.get("protocol") in WITHOUT_CHECKPOINT:
        spec["checkpoint"] = None
    return spec
