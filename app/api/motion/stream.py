"""One motion socket: requests with a deadline, of which the newest is answered.

Three tasks: one receives messages and notes their times, one answers, one closes the socket
when it is idle or the server stops. Decisions of all sockets take turns, in order of arrival at
the turn; the event loop reads messages between any two of them, so that the request that is
answered is the newest one and its waiting time is known. Cells and policies are read before
the turn: the database delays no other socket.
"""

import asyncio
import json
import logging
import time
from collections import deque
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import anyio
from pydantic import ValidationError
from pydantic_core import to_json
from starlette.websockets import WebSocket, WebSocketDisconnect

from app.api.motion.decision import NamedObjects, answer, objects_of
from app.api.motion.load import SocketRate
from app.api.problems import (
    ProblemResponse,
    member_problem,
    problem,
    service_problem,
    validation_problem,
)
from app.api.schemas.motion import LeftOut, MotionRequest, StreamUse
from app.api.services import Services
from app.api.sockets import MAX_MESSAGE, POLICY
from app.api.texts import fault_in_json
from app.api.validation import member
from app.errors import ServiceError

logger = logging.getLogger(__name__)

PATH = "/v1/motion/stream"
MAX_WAITING = 64
"""Largest number of requests that wait where each is answered; then none is received."""
MAX_STAMP, MAX_TIME = 64, 2**63
"""Longest text and greatest number of a stamp in a problem."""
CHECK_S = 0.2
"""Period at which a socket checks whether it is idle or the server stops [s]."""
SHARES: tuple[tuple[LeftOut, float], ...] = (("search", 0.25), ("rollout", 0.5))
"""What is left out once a request has waited for more than this share of its deadline."""
GOING_AWAY = 1001

Which = Literal["newest", "each"]
Names = tuple[str, str | None]
"""The cell and the checkpoint that a request names."""


@dataclass(frozen=True)
class PendingMessage:
    """A message that waits for its answer."""

    text: str | None
    """The message; None: it is no text."""
    at: float
    """Time of its arrival on the clock ``time.perf_counter`` [s]."""
    instance: str
    """Path of its socket."""

    @cached_property
    def content(self) -> tuple[MotionRequest | ProblemResponse, dict[str, object]]:
        """Its request, or the problem of a message that is none, and its stamp."""
        body: object = None
        try:
            refused, body = _malformed(self.text, self.instance)
            return refused or MotionRequest.model_validate(body), _stamp_of(body)
        except Exception as error:
            return _problem(error, self.instance), _stamp_of(body)

    @property
    def names(self) -> Names | None:
        """What its request names; None without a request."""
        asked, _ = self.content
        return (asked.cell, asked.checkpoint) if isinstance(asked, MotionRequest) else None


class MotionSocket:
    """An open socket.

    Args:
        client: The socket, not accepted yet.
        which: Whether each request is answered or the newest.
        deadline_s: Time from the arrival of a request to its answer [s].
    """

    def __init__(
        self, client: WebSocket, services: Services, which: Which, deadline_s: float
    ) -> None:
        self._client, self._services, self._deadline_s = client, services, deadline_s
        self._which, self._superseded = which, 0
        self._load, self._rate = services.motion_load, SocketRate()
        self._waiting: deque[PendingMessage] = deque()
        self._arrived, self._taken = asyncio.Event(), asyncio.Event()
        self._last_s = time.monotonic()
        self._close: tuple[int, str] | None = None
        self._read: dict[Names, NamedObjects | Exception] = {}

    async def serve(self) -> None:
        """Answer requests until the client leaves, the socket is idle or the server stops."""
        self._load.add(self._rate)
        try:
            await self._serve()
        finally:
            self._load.remove(self._rate)
        if self._close is not None:
            await self._client.close(*self._close)

    async def _serve(self) -> None:
        async with anyio.create_task_group() as tasks:

            async def until_end(part: Callable[[], Awaitable[None]]) -> None:
                try:
                    await part()
                except WebSocketDisconnect:
                    logger.debug("a motion socket was closed by its client")
                tasks.cancel_scope.cancel()

            for part in (self._receive, self._answer, self._until_idle_or_stopped):
                tasks.start_soon(until_end, part)

    async def _receive(self) -> None:
        await self._client.accept()
        while True:
            message = await self._client.receive()
            if message["type"] == "websocket.disconnect":
                return
            self._last_s = time.monotonic()
            if self._which == "newest" and self._waiting:
                self._waiting.clear()
                self._superseded += 1
            instance: str = self._client.scope["path"]
            now = time.perf_counter()
            self._waiting.append(PendingMessage(message.get("text"), now, instance))
            self._arrived.set()
            while len(self._waiting) >= MAX_WAITING:
                self._taken.clear()
                await self._taken.wait()

    async def _until_idle_or_stopped(self) -> None:
        """Wait until the socket is to be closed."""
        idle_s = self._load.idle_s
        while not self._services.stopping.is_set():
            if time.monotonic() - self._last_s > idle_s:
                self._close = POLICY, f"no request for {idle_s:g} s"
                return
            await asyncio.sleep(CHECK_S)
        self._close = GOING_AWAY, "the server stops"

    async def _answer(self) -> None:
        while True:
            await self._arrived.wait()
            begin = time.perf_counter()
            names = self._unread()
            parsed_s = time.perf_counter() - begin
            if names is not None:
                self._read[names] = await self._objects_of(names)
            async with self._load.turn:
                await asyncio.sleep(0)  # messages are received between two decisions
                begin = time.perf_counter()
                if self._unread() is not None:  # a newer request, which names others
                    continue
                request = self._waiting.popleft()
                if not self._waiting:
                    self._arrived.clear()
                self._taken.set()
                text = await self._reply(request, begin)
                whole = begin - request.at <= SHARES[0][1] * self._deadline_s
                spent_s = parsed_s + time.perf_counter() - begin
                self._load.note(self._rate, spent_s, whole=whole)
            self._read.clear()
            await self._client.send_text(text)

    def _unread(self) -> Names | None:
        """Return what the next request names, None where it was read or there is no request."""
        names = self._waiting[0].names
        return None if names is None or names in self._read else names

    async def _objects_of(self, names: Names) -> NamedObjects | Exception:
        """Return what a request names, or the error that the answer states."""
        if len(self._read) >= MAX_WAITING:
            self._read.clear()
        try:
            return await objects_of(*names, self._services)
        except Exception as error:
            return error

    async def _reply(self, request: PendingMessage, begin: float) -> str:
        """Return the answer to a message as JSON: a :class:`MotionAnswer` or a problem."""
        waited_s, superseded = begin - request.at, self._superseded
        self._superseded = 0
        left_out = [name for name, share in SHARES if waited_s > share * self._deadline_s]

        def use(left_out: list[LeftOut], status: int) -> StreamUse:
            spent_s = time.perf_counter() - request.at
            missed = spent_s > self._deadline_s
            self._services.metrics.count_message(
                PATH, status, waited_s, spent_s, missed=missed, left=superseded
            )
            return StreamUse(
                waited_ms=1e3 * waited_s,
                missed_deadline=missed,
                superseded=superseded,
                left_out=left_out,
            )

        asked, stamp = request.content
        if isinstance(asked, MotionRequest):
            # A rollout that was asked for is not left out; without one there is nothing to.
            if asked.rollout is not None:
                left_out = []
            try:
                objects = self._read[asked.cell, asked.checkpoint]
                if isinstance(objects, Exception):
                    raise objects
                found = await answer(asked, objects, self._services, left_out)
                found["stream"] = use(left_out, 200)
                return str(to_json(found, inf_nan_mode="null"), "utf-8")
            except Exception as error:
                asked = _problem(error, request.instance)
        content: dict[str, object] = json.loads(bytes(asked.body))
        return json.dumps(
            {**content, "stream": use([], asked.status_code).model_dump(), **stamp}
        )


def _malformed(text: str | None, instance: str) -> tuple[ProblemResponse | None, object]:
    """Return the problem of a message that is no JSON, or None, and its request or data.

    Raises:
        json.JSONDecodeError: It is no JSON.
    """
    if text is None or len(text) > MAX_MESSAGE:
        rule = f"must be JSON text of at most {MAX_MESSAGE} characters"
        if text is None:
            binary = member("body", "<bytes>", rule)
            return member_problem(400, "malformed-json", binary, instance), None
        long = member("body", f"{len(text)} characters", rule)
        return member_problem(413, "body-too-large", long, instance), None
    fault, body = fault_in_json(text.encode()), None
    if fault is None:
        try:
            return None, MotionRequest.model_validate_json(text)
        except ValidationError:
            return None, json.loads(text)
    with suppress(ValueError, RecursionError):
        body = json.loads(text)
    return member_problem(422, "invalid-input", fault, instance), body


def _problem(error: Exception, instance: str) -> ProblemResponse:
    """Return the problem of a request that cannot be answered."""
    if isinstance(error, ServiceError):
        return service_problem(error, instance)
    if isinstance(error, ValidationError):
        wrong = [
            {**dict(one), "loc": ("body", *one["loc"])}
            for one in error.errors(include_url=False)
        ]
        return validation_problem(wrong, [MotionRequest], instance)
    if isinstance(error, json.JSONDecodeError):
        malformed = {"type": "json_invalid", "loc": ("body", error.pos), "msg": ""}
        context = {"error": error.msg}
        return validation_problem([{**malformed, "ctx": context}], [MotionRequest], instance)
    logger.error("a message on %s could not be answered", instance, exc_info=error)
    return problem(
        500, "an unexpected error; the server's log has the trace", instance=instance
    )


def _stamp_of(body: object) -> dict[str, object]:
    """Return the stamp of a request, which identifies a problem on a socket."""
    stamp = body.get("stamp") if isinstance(body, dict) else getattr(body, "stamp", None)
    is_text = isinstance(stamp, str) and len(stamp) <= MAX_STAMP
    is_time = isinstance(stamp, int | float) and -MAX_TIME < stamp < MAX_TIME
    return {"stamp": stamp} if is_text or is_time else {}
