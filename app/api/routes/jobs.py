"""Jobs: post, list, follow."""

import asyncio
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Body, Header, Query, Response
from fastapi.responses import PlainTextResponse
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from app.api.description import CREATED
from app.api.job_requests import (
    IdempotencyKey,
    JobDep,
    PageQuery,
    page_of_jobs,
    queued,
    require_named,
    shown,
)
from app.api.schemas.examples import JOBS, named
from app.api.schemas.jobs import JobList, JobPublic, MetricsPublic
from app.api.services import ServicesDep
from app.errors import InvalidInput
from app.policies.configs import presets
from app.store import events, jobs, metrics
from app.store.cursors import MAX_INTEGER
from app.store.records import JobKind, JobState
from jobs.executor import end_of_log
from jobs.spec import JobSpec

POLL_S = 0.3
"""How often an open stream looks for news [s]."""
LOG_BYTES, MAX_LOG_BYTES = 1 << 20, 1 << 24
"""Length of a log in an answer by default, and the greatest one [bytes]."""

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])


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
    idempotency_key: IdempotencyKey = None,
) -> JobPublic:
    """Queue a job of any kind; ``Location`` says where to follow it."""
    new = body.new_job()

    def check() -> None:
        require_named(body, new, services)

    return queued(new, services, response, idempotency_key, check)


@router.get("", summary="List the jobs", response_model=JobList)
async def list_jobs(
    services: ServicesDep,
    cursor: Annotated[str | None, Query(description="next_cursor of the page before")] = None,
    limit: Annotated[int, Query(ge=1, le=200, description="length of the page")] = 50,
    state: Annotated[JobState | None, Query(description="only jobs in this state")] = None,
    part_of: Annotated[
        str | None,
        Query(
            max_length=36,
            description="only the parts of the sweep or report with this id; `none`: only jobs "
            "that are part of no other",
        ),
    ] = None,
    kind: Annotated[JobKind | None, Query(description="only jobs of this kind")] = None,
    preset: Annotated[
        str | None, Query(description="only trainings and sweeps of this preset")
    ] = None,
) -> Response:
    """Return one page, newest first."""
    if preset is not None and preset not in presets.PRESETS:
        raise InvalidInput("preset", preset, "is not a preset", tuple(presets.PRESETS))
    query = PageQuery(cursor, limit, state, part_of, kind, preset)
    asked = query, services.supervisor.waiting
    content = await services.response_cache.find(asked, lambda: page_of_jobs(services, *asked))
    return Response(content, media_type="application/json")


@router.get("/{job_id}", summary="One job")
def get_job(job: JobDep, services: ServicesDep) -> JobPublic:
    """Return one job with the newest point of its curve."""
    return shown(job, services)


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


@router.get("/{job_id}/log", summary="A job's output", response_class=PlainTextResponse)
def get_job_log(
    job: JobDep,
    services: ServicesDep,
    tail: Annotated[
        int, Query(ge=1, le=MAX_LOG_BYTES, description="at most so many bytes, the last ones")
    ] = LOG_BYTES,
) -> PlainTextResponse:
    """Return the output of all attempts of a job, as far as this server has run them.

    Bytes that are no UTF-8 are replaced. It is empty before the first attempt, and for jobs
    that are made of others.
    """
    log = services.retention.log_of(job.id)
    return PlainTextResponse(end_of_log(log, tail))


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
    after = min(last_event_id or 0, job.last_event)  # less in a database that was restored
    while not services.stopping.is_set():
        news = await run_in_threadpool(events.list_events, services.store, job.id, after=after)
        for event in news:
            after = event.id
            data = {**event.data, "at": event.at}
            yield ServerSentEvent(event=event.kind, id=str(event.id), data=data)
        if not news:
            now = await run_in_threadpool(jobs.find_job, services.store, job.id)
            if now is None:
                yield ServerSentEvent(event="end", data={"state": "deleted"})
                return
            if now.is_final and now.last_event <= after:
                yield ServerSentEvent(event="end", data={"state": now.state})
                return
            await asyncio.sleep(POLL_S)
