"""Trackers of key-points, listened to frame by frame (METHOD 2.8)."""

from typing import Annotated

from fastapi import APIRouter, Query, Response
from starlette.concurrency import run_in_threadpool

from app.api.schemas.trackers import (
    EstimatesPublic,
    FrameCreate,
    TrackerCreate,
    TrackerList,
    TrackerPublic,
)
from app.api.services import ServicesDep
from app.api.task_selection import known_cell

router = APIRouter(prefix="/v1/trackers", tags=["trackers"])


@router.post("", status_code=201, summary="Listen to a tracker")
async def create(
    body: TrackerCreate, services: ServicesDep, response: Response
) -> TrackerPublic:
    """Open a tracker; its people can then be named in /v1/task-selection."""
    services.readiness.require()
    cell = await known_cell(body.cell, services)
    size = cell.body if body.body is None else body.body.size(cell)
    session = services.trackers.open(cell.name, body.n_people, size, cell.floor_z)
    response.headers["Location"] = f"/v1/trackers/{session.id}"
    return TrackerPublic.from_domain(session)


@router.get("", summary="List the trackers")
async def list_all(services: ServicesDep) -> TrackerList:
    """Return every tracker that is listened to."""
    return TrackerList(
        items=[TrackerPublic.from_domain(one) for one in services.trackers.all()]
    )


@router.post("/{tracker_id}/frames", summary="Hand one frame over")
async def take_frame(
    tracker_id: str, body: FrameCreate, services: ServicesDep
) -> EstimatesPublic:
    """Take one frame of all people in and return what is known of each at its time.

    Who is who is found out from where people were, so their order means nothing; what is
    missing, held, exchanged or not credible is named, and so are people who are not followed.
    A frame whose stamp does not continue the frames before is not taken (409); the third such
    frame in a row is, as a change of the tracker's clock.
    """
    arrived = services.trackers.clock()
    session = services.trackers.get(tracker_id)
    seen = [one.points() for one in body.people]
    points, trust = [one[0] for one in seen], [one[1] for one in seen]
    known = await run_in_threadpool(session.take, body.t, arrived, points, trust)
    return EstimatesPublic.from_domain(tracker_id, known)


@router.get("/{tracker_id}", summary="What is known of a tracker's people")
async def get_one(
    tracker_id: str,
    services: ServicesDep,
    t: Annotated[
        float | None,
        Query(
            allow_inf_nan=False,
            description="the present on the tracker's clock [s]: it counts where it makes the "
            "people older than the arrival of the newest frame does",
        ),
    ] = None,
) -> EstimatesPublic:
    """Return the estimates of all people at present.

    Ages count from the arrival of the newest frame.
    """
    session = services.trackers.get(tracker_id)
    known = await run_in_threadpool(session.people, t)
    return EstimatesPublic.from_domain(tracker_id, known)


@router.delete("/{tracker_id}", status_code=204, summary="Listen to a tracker no longer")
async def remove(tracker_id: str, services: ServicesDep) -> None:
    """Forget a tracker and what it told."""
    services.trackers.close(tracker_id)
