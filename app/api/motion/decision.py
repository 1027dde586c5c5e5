"""Answers to motion requests, for the route and for sockets.

Source: docs/method.md 2.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from starlette.concurrency import run_in_threadpool

from app.api.known_people import (
    is_slow_conversion,
    people_for_policy,
    renumbered,
    require_all_tracked,
)
from app.api.schemas.motion import LeftOut, MotionAnswer, MotionRequest
from app.api.schemas.numbers import Data
from app.api.services import Services
from app.api.tracker_sessions import TrackerSessions
from app.policies.inference.motion_decision import MotionDecider
from app.sim.cells.cell import Cell, require_cell
from app.sim.safety.layer import safety_settings

PATH = "/v1/motion"
NO_WEIGHT = {"separation": None, "weight": 0.0}
"""Distance and weight of a person who is not used."""


class NamedObjects(NamedTuple):
    """Stored objects that a request names."""

    cell: Cell
    """The work cell."""
    decider: MotionDecider
    """The policy, which was trained in the cell."""


async def objects_of(cell: str, checkpoint: str | None, services: Services) -> NamedObjects:
    """Return the objects that a request names; those not in memory are read on a thread.

    Raises:
        ServiceError: The request cannot be answered.
    """
    services.readiness.require()
    known = await services.known_cell(cell)
    decider = await services.reach_policies.get(checkpoint)
    require_cell(known, decider.actor.cell, decider.actor.cell_sha256)
    return NamedObjects(known, decider)


async def answer(
    request: MotionRequest,
    objects: NamedObjects,
    services: Services,
    left_out: Sequence[LeftOut] = (),
) -> Data:
    """Return the data of the answer to one request, a :class:`MotionAnswer`.

    Args:
        objects: What the request names.
        left_out: Parts that a late request is answered without.

    Raises:
        ServiceError: The request cannot be answered.
    """

    def decided() -> Data:
        with services.span("decision"):
            return decide(request, *objects, services.trackers, left_out)

    # A decision takes less time than a change of thread usually does, on the event loop.
    found = (
        await run_in_threadpool(decided) if is_slow_conversion(request.people) else decided()
    )
    services.metrics.count_outside(PATH, found["outside"], found["state_outside"])
    return found


def decide(
    request: MotionRequest,
    cell: Cell,
    decider: MotionDecider,
    trackers: TrackerSessions,
    left_out: Sequence[LeftOut] = (),
) -> Data:
    """Return what :func:`answer` does, by a policy that was trained in the cell."""
    require_all_tracked(request.people, trackers)
    q = request.robot.joints(request.robot.q)
    # The policy observes the nearest, the safety layer all: a person farther away may be
    # the one who comes too near.
    people = people_for_policy(request.people, cell, trackers, q)
    known, seen = people.known, list(people.places)
    last = {i: one.observed for i, one in enumerate(known) if one.observed is not None}
    monitored = list(last)
    as_seen = seen == monitored and all(one.observed is one.person for one in known)
    query = request.to_domain(
        people.people,
        None if as_seen else list(last.values()),
        safety_settings(cell),
        max((one.age_s for one in known), default=0.0),
        max((one.displaced_m for one in known), default=0.0),
    )
    if "search" in left_out:
        query = replace(query, search=False)
    if "rollout" in left_out:
        query = replace(query, rollout=False)
    with request.robot.faults_in_place():
        decision = decider.decide(query)
    if not seen == monitored == list(range(len(known))):
        nearest = decision.nearest_person
        decision = decision._replace(
            nearest_person=None if nearest is None else seen[nearest],
            terms_of=None if decision.terms_of is None else monitored[decision.terms_of],
            outside=renumbered(decision.outside, seen),
        )
    weights = dict(zip(seen, decision.person_weights, strict=True))
    uses = [
        use | (weights[i]._asdict() if i in weights else NO_WEIGHT)
        for i, use in enumerate(people.uses(decision.nearest_person))
    ]
    return MotionAnswer.data_of(decision, query, uses, cell.robot.dt, request.stamp)
