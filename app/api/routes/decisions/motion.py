"""Motion decisions: the next trajectory segment toward a goal (thesis chapter 4).

``POST /v1/motion`` answers one state. The WebSocket ``/v1/motion/stream`` takes the same
requests as text messages, for loops at 50 Hz. An error is answered by a problem, and the socket
stays open.

Source: docs/method.md 2.
"""

import logging
from typing import Annotated

from fastapi import APIRouter, Query
from starlette.websockets import WebSocket

from app.api.description import MISMATCH
from app.api.motion.decision import answer, objects_of
from app.api.motion.stream import MotionSocket, Which
from app.api.schemas.motion import MotionAnswer, MotionRequest
from app.api.schemas.numbers import Data
from app.api.services import ServicesDep
from app.api.sockets import refuse

logger = logging.getLogger(__name__)

router = APIRouter(prefix="/v1/motion", tags=["deciding"])


@router.post(
    "",
    summary="Decide how the robot moves next",
    responses=MISMATCH,
    response_model=MotionAnswer,
)
async def decide_motion(request: MotionRequest, services: ServicesDep) -> Data:
    """Return the next trajectory segment, the speed override and its reason.

    Calls are independent: state, people and goal may change at any time. For loops,
    `/v1/motion/stream` takes the same requests over a WebSocket.
    """
    objects = await objects_of(request.cell, request.checkpoint, services)
    return await answer(request, objects, services)


@router.websocket("/stream")
async def stream(
    client: WebSocket,
    services: ServicesDep,
    which: Annotated[Which, Query(alias="answer")] = "newest",
    deadline_ms: Annotated[float, Query(gt=0.0, le=1e4, allow_inf_nan=False)] = 20.0,
) -> None:
    """Answer requests until the socket closes or the server stops.

    Each message is a request. With ``answer=newest`` only the newest one that waits is
    answered, with ``answer=each`` every one; an answer beyond the deadline says so.
    """
    if (reason := services.motion_load.refusal()) is not None:
        logger.warning("a motion socket was refused: %s", reason)
        await refuse(client, reason)
        return
    await MotionSocket(client, services, which, 1e-3 * deadline_ms).serve()
