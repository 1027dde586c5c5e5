"""Choice and risk over a grid of positions of a person.

Source: docs/method.md 3.1.
"""

from fastapi import APIRouter
from starlette.concurrency import run_in_threadpool

from app.api.description import MISMATCH
from app.api.known_people import is_slow_conversion, people_for_policy
from app.api.schemas.risk_map import RiskMapAnswer, RiskMapRequest
from app.api.services import ServicesDep
from app.api.world_policies import require_policy_for_decision
from app.errors import InvalidInput
from app.sim.pick.task_policy import MovedPerson

MAX_INLINE_ROWS = 48
"""Larger maps are made on a thread: positions times candidates."""

router = APIRouter(prefix="/v1/risk-map", tags=["deciding"])


@router.post("", summary="Map choice and risk over positions of a person", responses=MISMATCH)
async def map_risk(request: RiskMapRequest, services: ServicesDep) -> RiskMapAnswer:
    """Return the choice, its value and its probabilities at every position of a person.

    At each position the answer is that of `/v1/task-selection` beside the person there.
    """
    services.readiness.require()
    cell = await services.known_cell(request.cell)
    q, qd, candidates = request.to_domain()
    policy = await services.task_policies.get(request.checkpoint)
    await require_policy_for_decision(policy, cell, services)

    def answer() -> RiskMapAnswer:
        people = people_for_policy(request.people, cell, services.trackers, q)
        which = request.grid.person
        if which not in people.places:
            rule = "must be the index of one of the four people nearest to the robot"
            raise InvalidInput("grid.person", which, rule, [str(i) for i in people.places])
        index = people.places.index(which)
        person, size = people.people[index], people.people[index].size
        grid = request.grid.to_domain()
        postures, reached = grid.postures(person, cell.body if size is None else size)
        moved = MovedPerson(index=index, q=postures)
        with request.robot.faults_in_place():
            found = policy.risk_map(
                q, qd, people.people, candidates, moved, terms=request.terms
            )
            chosen = policy.decide(
                q, qd, people.people, candidates, time_left_s=request.time_left_s
            )
        decision = people.in_request(chosen)
        uses = people.uses(decision.nearest_person)
        return RiskMapAnswer.from_domain(found, reached, request, uses, decision)

    n_rows = request.grid.nx * request.grid.ny * len(candidates)
    long = n_rows > MAX_INLINE_ROWS or is_slow_conversion(request.people)
    return await run_in_threadpool(answer) if long else answer()
