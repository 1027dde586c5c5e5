"""Task selection by the critic's values (thesis chapter 5).

Source: docs/method.md 3.1.
"""

from functools import partial

from fastapi import APIRouter
from starlette.concurrency import run_in_threadpool

from app.api.description import MISMATCH
from app.api.known_people import is_slow_conversion, people_for_policy
from app.api.schemas.numbers import Data
from app.api.schemas.task_selection import TaskSelection, TaskSelectionRequest
from app.api.services import ServicesDep
from app.api.world_policies import require_policy_for_decision

MAX_INLINE_CANDIDATES = 32
"""Larger requests are processed on a thread, so that the event loop is not blocked."""

router = APIRouter(prefix="/v1/task-selection", tags=["deciding"])


@router.post(
    "",
    summary="Choose what the robot does next",
    responses=MISMATCH,
    response_model=TaskSelection,
)
async def select_task(request: TaskSelectionRequest, services: ServicesDep) -> Data:
    """Return the selected candidate, every candidate's value and the policy's action."""
    # A few candidates take about a millisecond, less than a change of thread.
    services.readiness.require()
    cell = await services.known_cell(request.cell)
    q, qd, candidates = request.to_domain()
    policy = await services.task_policies.get(request.checkpoint)
    await require_policy_for_decision(policy, cell, services)
    decide = partial(
        policy.decide,
        q,
        qd,
        candidates=candidates,
        previous=request.previous,
        progress=request.progress,
        time_left_s=request.time_left_s,
        objective=request.objective,
    )

    def answer() -> Data:
        people = people_for_policy(request.people, cell, services.trackers, q)
        span = services.span("decision")
        with span, request.robot.faults_in_place():
            decision = people.in_request(decide(people.people))
        services.metrics.count_outside(
            router.prefix, decision.outside, *decision.outside_candidates
        )
        uses = people.uses(decision.nearest_person)
        return TaskSelection.data_of(decision, candidates, uses, request.stamp)

    long = len(candidates) > MAX_INLINE_CANDIDATES or is_slow_conversion(request.people)
    return await run_in_threadpool(answer) if long else answer()
