"""Training and evaluation as jobs: post, list, cancel, follow."""

import asyncio
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Body, Depends, Header, Query, Response
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from app.api.description import CREATED
from app.api.schemas.examples import JOBS, named
from app.api.schemas.jobs import JobList, JobPublic, MetricsPublic
from app.api.services import Services, ServicesDep
from app.policies.configs import presets
from app.store import events, jobs, metrics
from app.store.cursors import MAX_INTEGER
from app.store.records import JobEvent, JobRecord, JobState, MetricRow
from jobs.spec import EvaluateSpec, JobSpec

POLL_S = 0.3
"""How often an open stream looks for news [s]."""

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])


def job_of_path(job_id: str, services: ServicesDep) -> JobRecord:
    """Return the job that the path names."""
    return jobs.get_job(services.store, job_id)


JobDep = Annotated[JobRecord, Depends(job_of_path)]


@router.post(
    "",
    status_code=202,
    summary="Post a job",
    responses={
        202: CREATED,
        409: {"description": "The idempotency key belongs to another body"},
        507: {},
    },
)
def create_job(
    body: Annotated[JobSpec, Body(openapi_examples=named(JOBS))],
    services: ServicesDep,
    response: Response,
    idempotency_key: Annotated[
        str | None, Header(description="the same key never makes a second job")
    ] = None,
) -> JobPublic:
    """Queue a training or an evaluation; ``Location`` says where to follow it."""
    if isinstance(body, EvaluateSpec) and body.checkpoint is not None:
        services.checkpoints.read(body.checkpoint)
    new = body.new_job()
    if isinstance(body, EvaluateSpec):
        services.recordings.check(body.recordings)
    if new.preset is not None:
        preset = presets.resolve(new.preset, new.overrides or {})
        services.cells.to_train_in(preset)
    job = jobs.create_job(services.store, new, idempotency_key=idempotency_key)
    services.supervisor.wake()
    response.headers["Location"] = f"/v1/jobs/{job.id}"
    return JobPublic.from_domain(job)


@router.get("", summary="List the jobs")
def list_jobs(
    services: ServicesDep,
    cursor: Annotated[str | None, Query(description="next_cursor of the page before")] = None,
    limit: Annotated[int, Query(description="length of the page, 1 to 200")] = 50,
    state: Annotated[JobState | None, Query(description="only jobs in this state")] = None,
) -> JobList:
    """Return one page, newest first."""
    page = jobs.list_jobs(services.store, cursor=cursor, limit=limit, state=state)
    items = [
        JobPublic.from_domain(job, None if job.is_final else newest_point(services, job))
        for job in page.items
    ]
    waiting = services.supervisor.waiting
    return JobList(items=items, next_cursor=page.next_cursor, waiting=waiting)


@router.get("/{job_id}", summary="One job")
def get_job(job: JobDep, services: ServicesDep) -> JobPublic:
    """Return one job with the newest point of its curve."""
    return JobPublic.from_domain(job, newest_point(services, job))


@router.post(
    "/{job_id}/cancel",
    status_code=202,
    summary="Cancel a job",
    responses={409: {"description": "The job has ended"}, 507: {}},
)
def cancel_job(job: JobDep, services: ServicesDep) -> JobPublic:
    """Cancel a queued job at once; a running one stops after its next checkpoint."""
    cancelled = jobs.request_cancel(services.store, job.id)
    services.supervisor.wake()
    return JobPublic.from_domain(cancelled)


@router.get("/{job_id}/metrics", summary="A job's learning curve")
def get_job_metrics(
    job: JobDep,
    services: ServicesDep,
    after_step: Annotated[
        int, Query(ge=-1, le=MAX_INTEGER, description="last step already known")
    ] = -1,
    limit: Annotated[int, Query(ge=1, le=10_000, description="at most so many")] = 10_000,
) -> MetricsPublic:
    """Return the points beyond a step, in order of steps."""
    rows = metrics.list_metrics(services.store, job.id, after_step=after_step, limit=limit)
    return MetricsPublic.from_domain(rows)


@router.get(
    "/{job_id}/events", response_class=EventSourceResponse, summary="Follow a job as it runs"
)
async def stream_job(
    job: JobDep,
    services: ServicesDep,
    last_event_id: Annotated[
        int | None, Header(ge=0, le=MAX_INTEGER, description="go on after this event")
    ] = None,
) -> AsyncIterator[ServerSentEvent]:
    """Send every event of the job, then new ones, then ``end`` once it is over."""
    after = last_event_id or 0
    while not services.stopping.is_set():
        news = await run_in_threadpool(events.list_events, services.store, job.id, after=after)
        for event in news:
            after = event.id
            yield sent(event)
        if not news:
            now = await run_in_threadpool(jobs.get_job, services.store, job.id)
            if now.is_final and now.last_event <= after:
                yield ServerSentEvent(event="end", data={"state": now.state})
                return
            await asyncio.sleep(POLL_S)


def sent(event: JobEvent) -> ServerSentEvent:
    """Write a job's event as one of the stream."""
    data = {**event.data, "at": event.at}
    return ServerSentEvent(event=event.kind, id=str(event.id), data=data)


def newest_point(services: Services, job: JobRecord) -> MetricRow | None:
    """Return the last point of a job's curve, None before the first."""
    if job.step <= 0:
        return None
    rows = metrics.list_metrics(services.store, job.id, after_step=job.step - 1, limit=1)
    return rows[-1] if rows else None
