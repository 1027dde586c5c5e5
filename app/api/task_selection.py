"""The critic's choice among tasks, for other programs (thesis chapter 5, METHOD 3.1)."""

from fastapi import APIRouter
from starlette.concurrency import run_in_threadpool

from app.api.schemas.task_selection import TaskSelection, TaskSelectionRequest
from app.api.services import ServicesDep
from app.errors import CheckpointMismatch

router = APIRouter(prefix="/v1/task-selection", tags=["deciding"])


@router.post("", summary="Choose what the robot does next")
async def choose(request: TaskSelectionRequest, services: ServicesDep) -> TaskSelection:
    """Return the chosen candidate, every candidate's value and what the policy would do.

    The decision takes well below a millisecond, so it runs right here and not on a thread;
    only a checkpoint that is asked for the first time is read on one.
    """
    services.readiness.require()
    q, qd, people, candidates = request.to_domain()
    policy = services.policies.loaded(request.checkpoint)
    if policy is None:
        policy = await run_in_threadpool(services.policies.load, request.checkpoint)
    if policy.cell != request.cell:
        raise CheckpointMismatch("cell", request.cell, policy.cell)
    decision = policy.decide(
        q,
        qd,
        people,
        candidates,
        previous=request.previous,
        time_left_s=request.time_left_s,
    )
    return TaskSelection.from_domain(decision, candidates, request.stamp)
