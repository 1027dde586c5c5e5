"""Outermost ASGI layer: completes every answer.

Adds security headers and the root path of ``Location``, turns an unexpected error into a
problem, and answers ``HEAD`` with the headers of ``GET``, without a body.
"""

import logging

import anyio
import anyio.lowlevel
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.api.problems import problem
from app.api.security import path_of

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


class Answers:
    """ASGI layer around all others.

    Args:
        app: The inner layers.
    """

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on and complete its answer."""
        if scope["type"] != "http":
            await self.app(scope, receive, send)
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
        started, root_path = False, scope.get("root_path", "")

        async def send_complete(message: Message) -> None:
            nonlocal started
            if message["type"] == "http.response.start":
                started = True
                headers = message["headers"] = list(message["headers"])
                if message["status"] == 204:  # FastAPI states the type of its default answer
                    headers[:] = [pair for pair in headers if pair[0] != b"content-type"]
                given = {name.lower() for name, _ in headers}
                headers += [pair for pair in _RAW if pair[0] not in given]
                if b"location" in given:
                    _below_root_path(message, root_path)
            await send(message)

        try:
            await self.app(scope, receive, send_complete)
        except Exception:
            path = path_of(scope)
            logger.exception("%s %s could not be answered", scope["method"], path)
            if started:
                raise
            detail = "an unexpected error; the server's log has the trace"
            await problem(500, detail, instance=path)(scope, receive, send_complete)


def _below_root_path(message: Message, root_path: str) -> None:
    headers = MutableHeaders(scope=message)
    if headers["location"].startswith("/"):
        headers["Location"] = root_path + headers["location"]
