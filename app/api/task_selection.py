"""The critic's choice among tasks, for other programs (thesis chapter 5, METHOD 3.1)."""

from functools import partial

from fastapi import APIRouter
from starlette.concurrency import run_in_threadpool

from app.api.schemas.task_selection import TaskSelection, TaskSelectionRequest
from app.api.services import ServicesDep
from app.errors import CheckpointMismatch

MAX_INLINE_CANDIDATES = 32
"""More than this many are decided on a thread, so that streams and other callers go on."""

router = APIRouter(prefix="/v1/task-selection", tags=["deciding"])


@router.post("", summary="Choose what the robot does next")
async def choose(request: TaskSelectionRequest, services: ServicesDep) -> TaskSelection:
    """Return the chosen candidate, every candidate's value and what the policy would do."""
    # A few candidates take about a millisecond: right here, since handing them to a thread
    # costs more than it saves.
    services.readiness.require()
    q, qd, people, candidates = request.to_domain()
    policy = services.policies.loaded(request.checkpoint)
    if policy is None:
        policy = await run_in_threadpool(services.policies.load, request.checkpoint)
    if policy.cell != request.cell:
        raise CheckpointMismatch("cell", request.cell, policy.cell)
    decide = partial(
        policy.decide,
        q,
        qd,
        people,
        candidates,
        previous=request.previous,
        time_left_s=request.time_left_s,
    )
    many = len(candidates) > MAX_INLINE_CANDIDATES
    decision = await run_in_threadpool(decide) if many else decide()
    return TaskSelection.from_domain(decision, candidates, request.stamp)
