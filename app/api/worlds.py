"""Live worlds: their state, their stream, and what may be done to them."""

import asyncio
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Depends
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from app.api.schemas.live_sorting import SetSorter
from app.api.schemas.worlds import (
    MAX_CHOICES,
    CommandAccepted,
    CommandCreate,
    SetCandidates,
    SetMotion,
    SetPolicy,
    StartCase,
    ToggleCandidate,
    WorldCell,
    WorldLight,
    WorldList,
    WorldPublic,
    WorldSummary,
)
from app.api.services import LiveWorld, Services, ServicesDep
from app.api.world_policies import (
    may_move,
    mover_for,
    pilot_for,
    pilot_of,
    require_mover,
    require_sorter,
    sorter_for,
)
from app.errors import InvalidInput, NotReady
from app.live.factory import lacks_for_live
from app.live.reach.commands import SetPilot, is_reaching
from app.live.reach.interfaces import ReachPilot
from app.sim.cells.cell import Cell
from app.sim.mocap.importer import Motion
from app.sim.pick.cases import cases_of
from app.sim.pick.task_policy import TaskPolicy
from app.sim.sorting.sorting_values import SortingValues

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
    return WorldList(items=[WorldSummary.from_domain(one) for one in snapshots])


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
    _check_names(body, world.cell)
    if isinstance(body, SetPolicy) and is_reaching(world.cell):
        pilot = None
        if body.checkpoint is not None:
            pilot = await run_in_threadpool(pilot_of, body.checkpoint, world.cell, services)
        number = world.handle.submit(SetPilot(pilot=pilot))
    elif isinstance(body, SetPolicy):
        policy = None
        if body.checkpoint is not None:
            policy = await run_in_threadpool(services.policies.load, body.checkpoint)
            if policy.cell != snapshot.cell and not may_move(policy, world.cell, services):
                rule = f"must decide in the cell {snapshot.cell}, not in {policy.cell}"
                raise InvalidInput("checkpoint", body.checkpoint, rule)
            require_mover(policy, world.cell, services)
        number = world.handle.submit(body.to_domain(policy))
    elif isinstance(body, SetSorter):
        sorter = None
        if body.checkpoint is not None:
            sorter = await run_in_threadpool(services.sorters.load, body.checkpoint)
            require_sorter(sorter, world.cell)
        number = world.handle.submit(body.to_domain(sorter))
    elif isinstance(body, SetMotion):
        runs = await run_in_threadpool(_runs_of, body.name, services)
        number = world.handle.submit(body.to_domain(runs))
    else:
        number = world.handle.submit(body.to_domain())
    return CommandAccepted(tag=body.tag, number=number, tick=snapshot.tick)


@router.get(
    "/{world_id}/events",
    response_class=EventSourceResponse,
    summary="Stream a live world, ten times a second",
)
async def stream(world: WorldDep, services: ServicesDep) -> AsyncIterator[ServerSentEvent]:
    """Send a light snapshot whenever the world has changed, until the client leaves."""
    last, world_id = None, world.handle.id
    while not services.stopping.is_set():
        snapshot = world.handle.snapshot()
        if services.worlds.get(world_id) is not world:
            yield ServerSentEvent(event="end", data={"reason": "the world was started anew"})
            return
        if snapshot is not last:
            last = snapshot
            light = WorldLight.from_domain(snapshot)
            yield ServerSentEvent(event="snapshot", id=str(snapshot.tick), data=light)
        await asyncio.sleep(STREAM_PERIOD_S)


@router.put("/{world_id}/cell", summary="Start a live world anew in another cell")
def set_cell(world_id: str, body: WorldCell, services: ServicesDep) -> WorldSummary:
    """Stop the world and start it in a cell to pick and place, sort or reach in; streams end.

    The policy is the one that is named, else the one that ships with the cell, else the newest
    that was trained in it, else none: the robot rests. In a sorting cell the shipped policy may
    act where the cell differs from its own in nothing but stations; the sorter is the one that
    is named, else the one that ships with the cell, else the exact planner. In a cell with
    goals to reach and no policy the robot goes straight to them.
    """
    services.world(world_id)
    cell = services.cells.get(body.cell)
    if (lack := lacks_for_live(cell)) is not None:
        raise InvalidInput("cell", cell.name, f"cannot be shown live: it {lack}")
    if is_reaching(cell):
        if body.sorter is not None:
            require_sorter(services.sorters.load(body.sorter), cell)
        reference = body.checkpoint
        pilot = pilot_of(reference, cell, services) if reference else pilot_for(cell, services)
        return _replace_world(world_id, cell, None, None, pilot, services)
    if body.checkpoint is None:
        policy = mover_for(cell, services)
    else:
        policy = services.policies.load(body.checkpoint)
        require_mover(policy, cell, services)
    if body.sorter is None:
        sorter = sorter_for(cell, services)
    else:
        sorter = services.sorters.load(body.sorter)
        require_sorter(sorter, cell)
    return _replace_world(world_id, cell, policy, sorter, None, services)


def _replace_world(
    world_id: str,
    cell: Cell,
    policy: TaskPolicy | None,
    sorter: SortingValues | None,
    pilot: ReachPilot | None,
    services: Services,
) -> WorldSummary:
    """Start the world of an id anew, and stop the one that was there."""
    with services.replacing:
        if services.stopping.is_set():
            raise NotReady("stopping")
        new = services.start_world(world_id, cell, policy, sorter, pilot)
        old, services.worlds[world_id] = services.worlds[world_id], new
    old.stop()
    return WorldSummary.from_domain(new.handle.snapshot())


def _runs_of(name: str, services: Services) -> tuple[Motion, ...]:
    """Return the clean runs of a stored motion."""
    if name not in (known := services.motions.names()):
        raise InvalidInput("name", name, "is no stored motion", known[:MAX_CHOICES])
    return services.motions.get(name)


def _check_names(body: CommandCreate, cell: Cell) -> None:
    stations = cell.station_ids
    if isinstance(body, ToggleCandidate) and body.id not in stations:
        raise InvalidInput("id", body.id, "is no station of this cell", stations)
    if isinstance(body, SetCandidates):
        for index, name in enumerate(body.ids):
            if name not in stations:
                rule = "is no station of this cell"
                raise InvalidInput(f"ids[{index}]", name, rule, stations)
    cases = tuple(case.id for case in cases_of(cell))
    if isinstance(body, StartCase) and body.id not in cases:
        raise InvalidInput("id", body.id, "is no case study of this cell", cases)
