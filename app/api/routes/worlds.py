"""Live worlds: state, stream and commands."""

import asyncio
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Body, Depends
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from app.api import following
from app.api.description import MISMATCH
from app.api.schemas.examples import COMMANDS, named
from app.api.schemas.worlds import (
    CommandAccepted,
    FollowPublic,
    FollowRequest,
    WorldCell,
    WorldList,
    WorldState,
    WorldSummary,
    state_of,
    stream_json,
)
from app.api.services import LiveWorld, Services, ServicesDep
from app.api.world_policies import (
    named_reach_policy,
    reach_policy_for,
    require_sorting_policy,
    require_task_policy,
    sorting_policy_for,
    submit_loaded,
    task_policy_for,
)
from app.errors import CheckpointMismatch, InvalidInput, NotReady
from app.live.command_checks import CommandMessage
from app.live.commands import LoadingCommand
from app.live.factory import lacks_for_live
from app.live.reach.commands import is_reaching
from app.live.reach.interfaces import LiveReachPolicy
from app.sim.cells.cell import Cell
from app.sim.pick.task_policy import TaskPolicy
from app.sim.sorting.sorting_values import SortingValues
from app.store.jobs import find_job

STREAM_PERIOD_S = 0.1

router = APIRouter(prefix="/v1/worlds", tags=["worlds"])


async def live_world(world_id: str, services: ServicesDep) -> LiveWorld:
    """Return the world that the path names; an unknown one is refused before a stream."""
    return services.world(world_id)


WorldDep = Annotated[LiveWorld, Depends(live_world)]


@router.get("", summary="List the live worlds")
async def list_worlds(services: ServicesDep) -> WorldList:
    """Return every live world; none while the service warms up."""
    unstored = services.checkpoints.unstored
    return WorldList(
        items=[
            WorldSummary.from_domain(
                world.handle.snapshot(),
                services.follows.of(world_id),
                sorted(unstored & world.handle.acting),
            )
            for world_id, world in services.worlds.items()
        ]
    )


@router.get("/{world_id}", summary="One live world, with the state a decision needs")
async def get_world(world: WorldDep) -> WorldState:
    """Return the last snapshot.

    Its ``state`` can be posted to /v1/task-selection as it is; null without candidates. While
    the status is ``moving``, in pick cells also ``picking``, the answer has the same choice and
    values.
    """
    return state_of(world.handle.snapshot())


@router.post(
    "/{world_id}/commands", status_code=202, summary="Change a live world", responses=MISMATCH
)
async def command_world(
    world: WorldDep,
    body: Annotated[CommandMessage, Body(openapi_examples=named(COMMANDS))],
    services: ServicesDep,
) -> CommandAccepted:
    """Queue one command; the world applies it before its next tick."""
    handle = world.handle
    tick, choices = handle.snapshot().tick, handle.choices
    if isinstance(body, LoadingCommand):
        number = await run_in_threadpool(submit_loaded, body, world, services)
    else:
        number = handle.submit(body)
    if handle.choices != choices:
        await run_in_threadpool(following.deploy_newest, services)
    return CommandAccepted(tag=body.tag, number=number, tick=tick)


@router.get(
    "/{world_id}/events",
    response_class=EventSourceResponse,
    summary="Stream a live world, ten times a second",
)
async def stream_world(
    world: WorldDep, services: ServicesDep
) -> AsyncIterator[ServerSentEvent]:
    """Send a light snapshot whenever the world has changed, until the client leaves."""
    last, world_id = None, world.handle.id
    while not services.stopping.is_set():
        snapshot = world.handle.snapshot()
        if services.worlds.get(world_id) is not world:
            yield ServerSentEvent(event="end", data={"reason": "the world was started again"})
            return
        if snapshot is not last:
            last = snapshot
            yield ServerSentEvent(
                event="snapshot", id=str(snapshot.tick), raw_data=stream_json(snapshot)
            )
        await asyncio.sleep(STREAM_PERIOD_S)


@router.put(
    "/{world_id}/cell", summary="Start a live world again in another cell", responses=MISMATCH
)
def set_world_cell(world_id: str, body: WorldCell, services: ServicesDep) -> WorldSummary:
    """Stop the world and start it in a cell to pick and place, sort or reach in; streams end.

    The policy is the named one, else the shipped one of the cell, else the newest trained in
    it, else none: the robot is idle. In a sorting cell the shipped policy may act where the
    cell differs from its own only in stations; the sorting policy is the named one, else the
    shipped one of the cell, else the exact planner. In a reach cell without a policy the robot
    moves straight to its goals.
    """
    services.world(world_id)
    with services.replacing:
        if services.stopping.is_set():
            raise NotReady("stopping")
        cell = services.named_cell(body.cell)
        if (lack := lacks_for_live(cell)) is not None:
            raise InvalidInput("cell", cell.name, f"cannot be shown live: it {lack}")

        def replace(new: LiveWorld) -> tuple[LiveWorld, LiveWorld]:
            old, services.worlds[world_id] = services.worlds[world_id], new
            return old, new

        old, new = services.retention.deploy(
            lambda: services.start_world(world_id, cell, *_policies_of(body, cell, services)),
            replace,
            lambda unused: unused.stop(),
        )
    old.stop()
    return WorldSummary.from_domain(new.handle.snapshot())


def _policies_of(
    body: WorldCell, cell: Cell, services: Services
) -> tuple[TaskPolicy | None, SortingValues | None, LiveReachPolicy | None]:
    """Return the policies that a world starts with: selecting tasks, sorting, reaching."""
    if body.sorting_policy is None:
        sorting_policy = sorting_policy_for(cell, services)
    else:
        sorting_policy = _named_sorting_policy(body.sorting_policy, services)
        require_sorting_policy(sorting_policy, cell, "sorting_policy")
    if is_reaching(cell):
        if body.checkpoint is None:
            return None, None, reach_policy_for(cell, services)
        return None, None, named_reach_policy(body.checkpoint, cell, services)
    if body.checkpoint is None:
        return task_policy_for(cell, services), sorting_policy, None
    policy = services.task_policies.load(body.checkpoint)
    require_task_policy(policy, cell, services)
    return policy, sorting_policy, None


def _named_sorting_policy(name: str, services: Services) -> SortingValues:
    """Return the sorting policy of that name; errors name the field of the request."""
    try:
        return services.sorting_policies.load(name)
    except InvalidInput as error:
        raise InvalidInput("sorting_policy", error.value, error.rule, error.choices) from None
    except CheckpointMismatch as error:
        raise CheckpointMismatch(
            error.field, error.expected, error.actual, member="sorting_policy"
        ) from None


@router.put(
    "/{world_id}/follow", summary="Let a live world follow a training", responses=MISMATCH
)
def follow_training(world_id: str, body: FollowRequest, services: ServicesDep) -> FollowPublic:
    """Let the newest checkpoint of a training act, now and whenever one is stored.

    It ends with the job, whose last checkpoint then acts, with another cell, and with a delete.
    """
    services.world(world_id)
    if (job := find_job(services.store, body.job)) is None:
        raise InvalidInput("job", body.job, "is the id of no job")
    return following.start(world_id, job, services)


@router.delete("/{world_id}/follow", status_code=204, summary="Follow a training no longer")
def stop_following(world_id: str, services: ServicesDep) -> None:
    """Keep the policy that acts; without a followed training this changes nothing."""
    services.world(world_id)
    with services.follows.lock:
        services.follows.by_world.pop(world_id, None)
