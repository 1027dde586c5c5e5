"""Motion decisions: the next trajectory segment toward a goal (thesis chapter 4).

``POST /v1/motion`` answers one state. The WebSocket ``/v1/motion/stream`` takes the same
requests as text messages and answers them in order, for loops at 50 Hz. An error is answered by
a problem, and the socket stays open.

Source: docs/method.md 2.
"""

import asyncio
import json
import logging
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from fastapi import APIRouter
from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.websockets import WebSocket, WebSocketDisconnect

from app.api.description import MISMATCH
from app.api.known_people import known_people, nearest_places, renumbered, take_time
from app.api.problems import (
    member_problem,
    problem,
    service_problem,
    validation_problem,
)
from app.api.schemas.motion import MotionAnswer, MotionRequest, PersonMet
from app.api.services import MAX_STREAMS, Services, ServicesDep, services_of
from app.api.sockets import refuse
from app.api.texts import fault_in_json
from app.api.tracker_sessions import TrackerSessions
from app.errors import ServiceError
from app.policies.inference.motion_decision import MotionDecider
from app.sim.cells.cell import Cell, require_cell
from app.sim.safety.layer import safety_settings

logger = logging.getLogger(__name__)

PATH = "/v1/motion"
MAX_MESSAGE = 1 << 16
"""Longest message on a socket [characters]."""
MAX_STAMP, MAX_TIME = 64, 1e18
"""Longest text and greatest number of a stamp in a problem."""
CHECK_S = 0.2
"""Period at which an idle socket checks whether the server stops [s]."""

router = APIRouter(prefix=PATH, tags=["deciding"])


@router.post("", summary="Decide how the robot moves next", responses=MISMATCH)
async def decide_motion(request: MotionRequest, services: ServicesDep) -> MotionAnswer:
    """Return the next trajectory segment, the speed override and its reason.

    Calls are independent: state, people and goal may change at any time. For loops,
    `/v1/motion/stream` takes the same requests over a WebSocket.
    """
    return await answer(request, services)


async def answer(request: MotionRequest, services: Services) -> MotionAnswer:
    """Return the answer to one request.

    Raises:
        ServiceError: The request cannot be answered.
    """
    services.readiness.require()
    cell = await services.known_cell(request.cell)
    decider = await _decider(request.checkpoint, services)
    require_cell(cell, decider.actor.cell, decider.actor.cell_sha256)
    decided = partial(decide, request, cell, decider, services.trackers)
    # Without a rollout a decision takes less than a millisecond, on the event loop.
    if request.rollout is not False or take_time(request.people):
        found = await run_in_threadpool(decided)
    else:
        found = decided()
    services.count_outside(PATH, found.outside, found.state_outside)
    return found


async def _decider(name: str | None, services: Services) -> MotionDecider:
    """Return a reach policy by name, by default the shipped one.

    Raises:
        InvalidInput: No checkpoint has that name.
        CheckpointMismatch: It is no reach policy.
    """
    found = services.reach_policies.loaded(name)
    if found is None:
        found = await run_in_threadpool(services.reach_policies.load, name)
    return found


def decide(
    request: MotionRequest, cell: Cell, decider: MotionDecider, trackers: TrackerSessions
) -> MotionAnswer:
    """Return the answer to one request.

    Args:
        request: State, people and goal.
        cell: Its work cell.
        decider: The policy, trained in that cell.
        trackers: The open trackers.

    Raises:
        ServiceError: The request cannot be answered.
    """
    people = known_people(request.people, cell, trackers)
    as_seen = all(one.observed is one.person for one in people)
    present = {i: one.person for i, one in enumerate(people) if one.person is not None}
    last = {i: one.observed for i, one in enumerate(people) if one.observed is not None}
    q = request.robot.joints(request.robot.q)
    seen, monitored = (nearest_places(some, cell, q) for some in (present, last))
    question = request.to_domain(
        [present[i] for i in seen],
        None if as_seen else [last[i] for i in monitored],
        safety_settings(cell),
        max((one.age_s for one in people), default=0.0),
    )
    with request.robot.faults_in_place():
        decision = decider.decide(question)
    decision = replace(
        decision,
        seen=None if decision.seen is None else seen[decision.seen],
        terms_of=None if decision.terms_of is None else monitored[decision.terms_of],
        outside=renumbered(decision.outside, seen),
    )
    met = dict(zip(seen, decision.met, strict=True))
    uses = [
        PersonMet.from_use(
            one.use(i == decision.seen, i in last and i not in monitored), met.get(i)
        )
        for i, one in enumerate(people)
    ]
    return MotionAnswer.from_domain(decision, question, uses, cell.robot.dt, request.stamp)


@router.websocket("/stream")
async def stream(client: WebSocket) -> None:
    """Answer requests, one per message, until the socket closes or the server stops."""
    services = services_of(client)
    if not services.motion_streams.acquire(blocking=False):
        await refuse(
            client, f"{MAX_STREAMS} motion sockets are open already: close one of them"
        )
        return
    try:
        await client.accept()
        await _serve(client, services)
    except WebSocketDisconnect:
        logger.debug("a motion socket was closed by its client")
    finally:
        services.motion_streams.release()


async def _serve(client: WebSocket, services: Services) -> None:
    """Receive messages and answer them in order."""
    while not services.stopping.is_set():
        incoming = asyncio.ensure_future(client.receive())
        while not incoming.done() and not services.stopping.is_set():
            await asyncio.wait((incoming,), timeout=CHECK_S)
        if not incoming.done():
            incoming.cancel()
            break
        message = incoming.result()
        if message["type"] == "websocket.disconnect":
            return
        await client.send_text(await reply(message, services))
    await client.close(1001, "the server stops")


async def reply(message: Mapping[str, Any], services: Services) -> str:
    """Return the answer to one message as JSON: a :class:`MotionAnswer` or a problem.

    Args:
        message: The ASGI message.
        services: The parts of the service.
    """
    path, text = f"{PATH}/stream", message.get("text")
    stamp: dict[str, object] = {}
    try:
        if text is None or len(text) > MAX_MESSAGE:
            rule = f"a message must be JSON text of at most {MAX_MESSAGE} characters"
            refused = problem(413 if text else 400, rule, instance=path)
        else:
            body = json.loads(text)
            stamp = _stamp_of(body)
            if (fault := fault_in_json(text.encode())) is None:
                found = await answer(MotionRequest.model_validate(body), services)
                return found.model_dump_json()
            refused = member_problem(422, "invalid-input", fault, path)
    except ValidationError as error:
        wrong = [
            {**dict(one), "loc": ("body", *one["loc"])}
            for one in error.errors(include_url=False)
        ]
        refused = validation_problem(wrong, [MotionRequest], path)
    except (ValueError, RecursionError) as error:
        detail = f"a message must be JSON: {error}"
        refused = problem(400, detail, kind="malformed-json", instance=path)
    except ServiceError as error:
        refused = service_problem(error, path)
    except Exception:
        logger.exception("a message on %s could not be answered", path)
        detail = "an unexpected error; the server's log has the trace"
        refused = problem(500, detail, instance=path)
    content: dict[str, object] = json.loads(bytes(refused.body))
    return json.dumps(content | stamp)


def _stamp_of(body: object) -> dict[str, object]:
    """Return the stamp of a request, which identifies a problem on a socket."""
    stamp = body.get("stamp") if isinstance(body, dict) else None
    is_text = isinstance(stamp, str) and len(stamp) <= MAX_STAMP
    is_time = isinstance(stamp, int | float) and -MAX_TIME < stamp < MAX_TIME
    return {"stamp": stamp} if is_text or is_time else {}
