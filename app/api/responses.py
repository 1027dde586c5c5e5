"""Outermost ASGI middleware: completes every response.

Adds security headers, the id of the request and the root path of ``Location``, turns an
unexpected error into a problem, and measures the time to the answer. ``HEAD`` is answered with
the headers of ``GET``, without a body, and a client that has the answer (``ETag``) with 304.
The log has a line for each request that changes something or is refused, and for each socket
that the server refuses or closes for a fault.
"""

import logging
import re
from functools import lru_cache
from random import Random
from time import perf_counter

import anyio
import anyio.lowlevel
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.metrics import UNROUTED, Metrics
from app.api.problems import problem
from app.api.security import headers_of, path_of
from app.logs import REQUEST_ID

logger = logging.getLogger(__name__)

PAGE_POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; style-src 'self' 'unsafe-inline'; "
    "script-src 'self'; connect-src 'self'; object-src 'none'; base-uri 'none'; "
    "form-action 'self'; frame-src 'self'; frame-ancestors 'self'"
)
HEADERS = {  # defaults
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "SAMEORIGIN",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": PAGE_POLICY,
    "Cache-Control": "no-cache",
}
_RAW = tuple((name.lower().encode(), value.encode()) for name, value in HEADERS.items())
ID_HEADER = b"x-request-id"
_OF_CONTENT = (b"content-length", b"content-type", b"content-encoding", b"content-disposition")
"""Headers that an answer without its content does not have."""
_ID = re.compile(rb"[A-Za-z0-9._:/+=-]{1,128}")
_RANDOM = Random()
_JOB = re.compile(r"/v1/jobs/([0-9a-f]{8}(?:-[0-9a-f]{4}){3}-[0-9a-f]{12})")
NORMAL_CLOSE = (1000, 1001)
"""Codes with which the server closes a socket at its end or that of the service."""
NOT_READY = 503
"""Status that monitors get again and again while the service starts."""
READS = ("GET", "HEAD", "OPTIONS")
DECIDING = "deciding"
"""Tag of the routes whose answers are not logged one by one."""


def id_of(scope: Scope) -> str:
    """Return the id of a request: the client's if well-formed, otherwise a new one."""
    for name, value in scope["headers"]:
        if name == ID_HEADER and _ID.fullmatch(value):
            return str(value, "ascii")
    return f"{_RANDOM.getrandbits(64):016x}"


class ResponseMiddleware:
    """ASGI middleware around all others."""

    def __init__(self, app: ASGIApp, *, metrics: Metrics) -> None:
        self.app = app
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on and complete its answer."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        REQUEST_ID.set(id_of(scope))
        if scope["type"] == "websocket":
            await self.app(scope, receive, _complete_socket(scope, send))
            return
        if scope["method"] != "HEAD":
            await self._answer(scope, receive, send)
            return
        with anyio.CancelScope() as answering:

            async def send_head(message: Message) -> None:
                await send(message)
                if message["type"] == "http.response.start":
                    await send({"type": "http.response.body", "body": b""})
                    answering.cancel()  # also ends a stream
                    await anyio.lowlevel.checkpoint()

            await self._answer({**scope, "method": "GET"}, receive, send_head)

    async def _answer(self, scope: Scope, receive: Receive, send: Send) -> None:
        started = unchanged = False
        root_path, begin = scope.get("root_path", ""), perf_counter()

        async def send_complete(message: Message) -> None:
            nonlocal started, unchanged
            if message["type"] == "http.response.start":
                started = True
                headers = message["headers"] = list(message["headers"])
                unchanged = message["status"] == 200 and _is_known(scope, headers)
                if unchanged:
                    message["status"] = 304
                    headers[:] = [pair for pair in headers if pair[0] not in _OF_CONTENT]
                self._count(scope, message["status"], headers, perf_counter() - begin)
                if message["status"] == 204:  # FastAPI states the type of its default answer
                    headers[:] = [pair for pair in headers if pair[0] != b"content-type"]
                given = tuple([name for name, _ in headers])
                headers += _missing(given)
                headers.append((ID_HEADER, (REQUEST_ID.get() or "").encode()))
                if b"location" in given:
                    _below_root_path(message, root_path)
            elif unchanged:
                message = {**message, "body": b""}
            await send(message)

        try:
            await self.app(scope, receive, send_complete)
        except Exception:
            logger.exception("%s %s could not be answered", scope["method"], path_of(scope))
            if started:
                raise
            detail = "an unexpected error; the server's log has the trace"
            await problem(500, detail, instance=scope["path"])(scope, receive, send_complete)

    def _count(
        self, scope: Scope, status: int, headers: list[tuple[bytes, bytes]], seconds: float
    ) -> None:
        """Count an answer; log it where it changes something or is refused."""
        route, method = scope.get("route"), scope["method"]
        self.metrics.observe(method, getattr(route, "path", UNROUTED), status, seconds)
        changes = method not in READS and DECIDING not in getattr(route, "tags", ())
        if (status >= 400 and status != NOT_READY) or changes:
            took = {"status": status, "duration_s": round(seconds, 6)}
            extra = took | _job_of(scope, headers)
            logger.info("%s %s", method, path_of(scope), extra=extra)


def _is_known(scope: Scope, headers: list[tuple[bytes, bytes]]) -> bool:
    """Return whether a client has an answer already, as ``If-None-Match`` states."""
    asked = headers_of(scope).get("if-none-match")
    if asked is None or scope["method"] != "GET":
        return False
    known = [one.strip().removeprefix("W/") for one in asked.split(",")]
    etags = [value.decode("latin-1") for name, value in headers if name == b"etag"]
    return any("*" in known or etag.removeprefix("W/") in known for etag in etags)


@lru_cache(maxsize=256)
def _missing(given: tuple[bytes, ...]) -> list[tuple[bytes, bytes]]:
    """Return the defaults of headers that are not among the given names, in lower case."""
    return [pair for pair in _RAW if pair[0] not in given]


def _below_root_path(message: Message, root_path: str) -> None:
    headers = MutableHeaders(scope=message)
    if headers["location"].startswith("/"):
        headers["Location"] = root_path + headers["location"]


def _job_of(scope: Scope, headers: list[tuple[bytes, bytes]]) -> dict[str, object]:
    """Return the job that a request names or created, as a field of its line in the log."""
    created = [value.decode("latin-1") for name, value in headers if name == b"location"]
    found = _JOB.search(" ".join([path_of(scope), *created]))
    return {"job_id": found[1]} if found else {}


def _complete_socket(scope: Scope, send: Send) -> Send:
    """Return ``send`` of a socket that adds the id of its request and logs its refusal."""
    accepted = False

    async def send_complete(message: Message) -> None:
        nonlocal accepted
        if message["type"] == "websocket.accept":
            accepted = True
            message["headers"] = [
                *message["headers"],
                (ID_HEADER, (REQUEST_ID.get() or "").encode()),
            ]
        elif message["type"] == "websocket.close":
            code = message.get("code", NORMAL_CLOSE[0])
            if not accepted or code not in NORMAL_CLOSE:
                how = {"code": code} if accepted else {"status": 403}
                extra = how | {"reason": message.get("reason") or ""}
                logger.info("WS %s", path_of(scope), extra=extra)
        await send(message)

    return send_complete
