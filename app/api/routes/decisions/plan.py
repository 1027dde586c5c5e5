"""Next move of a sorting task with its motion, by the pick policy's critic.

Source: docs/method.md 3.1.
"""

from dataclasses import replace

from fastapi import APIRouter
from starlette.concurrency import run_in_threadpool

from app.api.description import MISMATCH
from app.api.known_people import is_slow_conversion, people_for_policy
from app.api.schemas.plan import PlanAnswer, PlanRequest
from app.api.services import ServicesDep
from app.api.world_policies import require_policy_for_decision
from app.policies.inference.sorting_plan import SortingPlanner
from app.sim.sorting.batch import fail_of
from app.sim.sorting.decision import is_slow_decision
from app.sim.sorting.names import names_of

router = APIRouter(prefix="/v1/plan", tags=["deciding"])


@router.post(
    "", summary="Choose the next move of a sorting task and its motion", responses=MISMATCH
)
async def plan_move(request: PlanRequest, services: ServicesDep) -> PlanAnswer:
    """Return the next move, its motion and all moves that were compared.

    The exact planner lists the near-optimal moves, which need at most 0.25 expected attempts
    more than the best one; the pick policy selects one of them, beside the people as they are.
    """
    services.readiness.require()
    cell = await services.known_cell(request.cell)
    names, fail = names_of(cell), fail_of(cell)
    policy = await services.task_policies.get(request.checkpoint)
    await require_policy_for_decision(policy, cell, services)

    def answer() -> PlanAnswer:
        q = request.robot.joints(request.robot.q)
        people = people_for_policy(request.people, cell, services.trackers, q)
        query = request.to_domain(names, fail, people.people)
        with request.robot.faults_in_place():
            found = SortingPlanner(policy, cell).plan(query)
        if found.decision is not None:
            decision = people.in_request(found.decision)
            services.metrics.count_outside(router.prefix, decision.outside)
            found = replace(found, decision=decision)
        uses = people.uses(None if found.decision is None else found.decision.nearest_person)
        return PlanAnswer.from_domain(found, query, request, names, uses)

    long = is_slow_decision(names.shape) or is_slow_conversion(request.people)
    return await run_in_threadpool(answer) if long else answer()
