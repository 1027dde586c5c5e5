"""Trackers of key-points, updated frame by frame.

Source: docs/method.md 2.8.
"""

from typing import Annotated

from fastapi import APIRouter, Query, Response
from starlette.concurrency import run_in_threadpool

from app.api.description import CREATED
from app.api.schemas.numbers import Time
from app.api.schemas.trackers import (
    EstimatesPublic,
    FrameCreate,
    TrackerCreate,
    TrackerList,
    TrackerPublic,
)
from app.api.services import ServicesDep
from app.api.tracker_sessions import IDLE_S

router = APIRouter(prefix="/v1/trackers", tags=["trackers"])


@router.post(
    "",
    status_code=201,
    summary="Open a tracker",
    responses={201: CREATED, 409: {"description": "Too many trackers are open"}},
)
async def create_tracker(
    body: TrackerCreate, services: ServicesDep, response: Response
) -> TrackerPublic:
    """Open a tracker; requests of decisions can then name its people."""
    services.readiness.require()
    cell = await services.known_cell(body.cell)
    size = cell.body if body.body is None else body.body.size(cell)
    session = services.trackers.open(cell.name, body.n_people, size, cell.floor_z)
    response.headers["Location"] = f"/v1/trackers/{session.id}"
    return TrackerPublic.from_object(session, idle_limit_s=IDLE_S)


@router.get("", summary="List the trackers")
async def list_trackers(services: ServicesDep) -> TrackerList:
    """Return every open tracker."""
    return TrackerList(
        items=[
            TrackerPublic.from_object(one, idle_limit_s=IDLE_S)
            for one in services.trackers.all()
        ]
    )


@router.post(
    "/{tracker_id}/frames",
    summary="Submit a frame",
    responses={409: {"description": "The stamp does not continue those before"}},
)
async def submit_frame(
    tracker_id: str, body: FrameCreate, services: ServicesDep
) -> EstimatesPublic:
    """Take one frame of all people in and return what is known of each at its time.

    People are associated by position; their order has no meaning. The answer flags missing,
    held, exchanged and implausible data, and people who are not followed. A frame with a stamp
    that does not continue the frames before is refused (409); the third such frame in a row is
    accepted, as a change of the tracker's clock.
    """
    arrived = services.trackers.clock()
    session = services.trackers.get(tracker_id)
    seen = [one.points() for one in body.people]
    points, trust = [one[0] for one in seen], [one[1] for one in seen]
    known = await run_in_threadpool(session.take, body.t, arrived, points, trust)
    return EstimatesPublic.from_domain(tracker_id, known)


@router.get("/{tracker_id}", summary="Estimates of a tracker's people")
async def get_tracker(
    tracker_id: str,
    services: ServicesDep,
    t: Annotated[
        Time | None,
        Query(
            allow_inf_nan=False,
            description="present on the tracker's clock [s]; used where it gives a greater "
            "age than the arrival of the newest frame",
        ),
    ] = None,
) -> EstimatesPublic:
    """Return the estimates of all people at present.

    Ages count from the arrival of the newest frame.
    """
    session = services.trackers.get(tracker_id)
    known = await run_in_threadpool(session.people, t)
    return EstimatesPublic.from_domain(tracker_id, known)


@router.delete("/{tracker_id}", status_code=204, summary="Delete a tracker")
async def delete_tracker(tracker_id: str, services: ServicesDep) -> None:
    """Delete a tracker and its estimates."""
    services.trackers.close(tracker_id)
