"""Live worlds: their state, their stream, and what may be done to them."""

import asyncio
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Depends
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from app.api.schemas.worlds import (
    CommandAccepted,
    CommandCreate,
    SetCandidates,
    SetPolicy,
    StartCase,
    ToggleCandidate,
    WorldLight,
    WorldList,
    WorldPublic,
    WorldSummary,
)
from app.api.services import LiveWorld, ServicesDep
from app.errors import InvalidInput
from app.sim.cases import CASES
from app.sim.cells import load_cell

STREAM_PERIOD_S = 0.1

router = APIRouter(prefix="/v1/worlds", tags=["worlds"])


async def live_world(world_id: str, services: ServicesDep) -> LiveWorld:
    """Return the world that the path names; before a stream begins its answer."""
    return services.world(world_id)


WorldDep = Annotated[LiveWorld, Depends(live_world)]


@router.get("", summary="List the live worlds")
async def list_all(services: ServicesDep) -> WorldList:
    """Return every live world; none while the service warms up."""
    snapshots = [world.handle.snapshot() for world in services.worlds.values()]
    return WorldList(
        items=[
            WorldSummary(
                id=one.id,
                cell=one.cell,
                viewer=f"/viewer/{one.id}/",
                checkpoint=one.checkpoint,
            )
            for one in snapshots
        ]
    )


@router.get("/{world_id}", summary="One live world, with the state a decision needs")
async def get_one(world: WorldDep) -> WorldPublic:
    """Return the last snapshot; its ``state`` can be posted to /v1/task-selection as it is."""
    return WorldPublic.from_domain(world.handle.snapshot())


@router.post("/{world_id}/commands", status_code=202, summary="Change a live world")
async def command(
    world: WorldDep, body: CommandCreate, services: ServicesDep
) -> CommandAccepted:
    """Queue one command; the world applies it before its next tick."""
    snapshot = world.handle.snapshot()
    _check_names(body, snapshot.cell)
    if isinstance(body, SetPolicy):
        policy = None
        if body.checkpoint is not None:
            policy = await run_in_threadpool(services.policies.load, body.checkpoint)
            if policy.cell != snapshot.cell:
                rule = f"must decide in the cell {snapshot.cell}, not in {policy.cell}"
                raise InvalidInput("checkpoint", body.checkpoint, rule)
        world.handle.submit(body.to_domain(policy))
    else:
        world.handle.submit(body.to_domain())
    return CommandAccepted(tag=body.tag, tick=snapshot.tick)


@router.get(
    "/{world_id}/events",
    response_class=EventSourceResponse,
    summary="Stream a live world, ten times a second",
)
async def stream(world: WorldDep, services: ServicesDep) -> AsyncIterator[ServerSentEvent]:
    """Send a light snapshot whenever the world has changed, until the client leaves."""
    last = None
    while not services.stopping.is_set():
        snapshot = world.handle.snapshot()
        if snapshot is not last:
            last = snapshot
            light = WorldLight.from_domain(snapshot)
            yield ServerSentEvent(event="snapshot", id=str(snapshot.tick), data=light)
        await asyncio.sleep(STREAM_PERIOD_S)


def _check_names(body: CommandCreate, cell_name: str) -> None:
    stations = load_cell(cell_name).station_ids
    if isinstance(body, ToggleCandidate) and body.id not in stations:
        raise InvalidInput("id", body.id, "is no station of this cell", stations)
    if isinstance(body, SetCandidates):
        for index, name in enumerate(body.ids):
            if name not in stations:
                rule = "is no station of this cell"
                raise InvalidInput(f"ids[{index}]", name, rule, stations)
    cases = tuple(case.id for case in CASES)
    if isinstance(body, StartCase) and body.id not in cases:
        raise InvalidInput("id", body.id, "is no case study of this cell", cases)
