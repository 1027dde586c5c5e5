"""The 3D viewer of a world, through this service's own port.

The viewer (viser 1.1.1) listens on loopback without any check of who talks to it, and any of
its clients may ask it to open a public tunnel. So nothing reaches it but through here: behind
:mod:`app.api.security`, with that request dropped. Its page is served with one style sheet and
script of ours that hide the library's own notices, which mean nothing to a visitor.
"""

import asyncio
import gzip
import http.client
import logging
from functools import lru_cache
from importlib import resources
from typing import Annotated

import msgspec
from fastapi import APIRouter, Header
from starlette.concurrency import run_in_threadpool
from starlette.responses import RedirectResponse, Response
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from app.api.services import ServicesDep, services_of
from app.errors import NotReady, ServiceError

logger = logging.getLogger(__name__)
router = APIRouter(include_in_schema=False)

DROPPED_PREFIX = "ShareUrl"
FETCH_TIMEOUT_S = 5.0
# The viewer's page is one inline script that unpacks itself, and the glue of its WebAssembly
# builds functions from text; both stay inside its own frame and talk to this server only.
POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; font-src 'self' data:; "
    "style-src 'self' 'unsafe-inline'; worker-src 'self' blob: data:; "
    "script-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; "
    "connect-src 'self' blob: data:; object-src 'none'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'self'"
)


@router.get("/viewer/{world_id}")
async def add_slash(world_id: str, services: ServicesDep) -> RedirectResponse:
    """Send a browser on to the address with the slash that relative names need."""
    services.world(world_id)
    return RedirectResponse(f"/viewer/{world_id}/")


@router.get("/viewer/{world_id}/")
async def page(
    world_id: str,
    services: ServicesDep,
    accept_encoding: Annotated[str, Header()] = "",
) -> Response:
    """Return the viewer's one page."""
    port = services.world(world_id).viewer_port
    plain, packed = await run_in_threadpool(viewer_page, port)
    headers = {
        "Content-Security-Policy": POLICY,
        "Cache-Control": "no-cache",
        "Vary": "Accept-Encoding",
    }
    if "gzip" in accept_encoding:
        return Response(
            packed, media_type="text/html", headers=headers | {"Content-Encoding": "gzip"}
        )
    return Response(plain, media_type="text/html", headers=headers)


@lru_cache(maxsize=8)
def viewer_page(port: int) -> tuple[bytes, bytes]:
    """Fetch the viewer's page, add our style and script; plain and gzip-packed.

    Raises:
        NotReady: The viewer does not answer.
    """
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=FETCH_TIMEOUT_S)
    try:
        connection.request("GET", "/")
        answer = connection.getresponse()
        content = answer.read()
    except OSError as error:
        raise NotReady(f"the 3D viewer does not answer: {error}") from error
    finally:
        connection.close()
    if answer.status != 200:
        raise NotReady(f"the 3D viewer answers with status {answer.status}")
    extra = (resources.files("app.api") / "viewer_extra.html").read_bytes()
    plain = content.replace(b"</head>", extra + b"</head>", 1)
    return plain, gzip.compress(plain, 6)


@router.websocket("/viewer/{world_id}")
@router.websocket("/viewer/{world_id}/")
async def socket(client: WebSocket, world_id: str) -> None:
    """Pass frames between a browser and the viewer until one of them leaves."""
    try:
        port = services_of(client).world(world_id).viewer_port
    except ServiceError as error:
        logger.info("viewer socket refused: %s", error)
        await client.close(1013, "no such world yet")
        return
    offered = [Subprotocol(one) for one in client.scope.get("subprotocols", [])]
    try:
        viewer = await connect(
            f"ws://127.0.0.1:{port}/",
            subprotocols=offered or None,
            max_size=None,
            compression=None,
            proxy=None,
            ping_interval=None,
        )
    except (OSError, TimeoutError) as error:
        logger.warning("the viewer on port %d does not answer: %s", port, error)
        await client.close(1013, "the viewer does not answer")
        return
    async with viewer:
        await client.accept(viewer.subprotocol)
        await pass_frames(client, viewer)


async def pass_frames(client: WebSocket, viewer: ClientConnection) -> None:
    """Pass frames both ways; when one side ends, end the other."""
    tasks = {
        asyncio.create_task(to_viewer(client, viewer)),
        asyncio.create_task(to_client(client, viewer)),
    }
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        ends = await asyncio.gather(*tasks, return_exceptions=True)
    for end in ends:
        expected = (asyncio.CancelledError, ConnectionClosed, WebSocketDisconnect)
        if isinstance(end, BaseException) and not isinstance(end, expected):
            logger.error("viewer socket broke off", exc_info=end)
    if client.client_state is WebSocketState.CONNECTED:
        try:
            await client.close(viewer.close_code or 1001)
        except RuntimeError:
            logger.debug("the browser had left already")


async def to_viewer(client: WebSocket, viewer: ClientConnection) -> None:
    """Pass on what the browser sends, but for what it must not ask."""
    while True:
        message = await client.receive()
        if message["type"] == "websocket.disconnect":
            return
        frame = message.get("bytes")
        if frame is not None and is_allowed(frame):
            await viewer.send(frame)
        else:
            logger.warning("dropped a frame from a browser that the viewer must not get")


async def to_client(client: WebSocket, viewer: ClientConnection) -> None:
    """Pass on what the viewer sends; waits for a slow browser."""
    async for frame in viewer:
        await client.send_bytes(frame if isinstance(frame, bytes) else frame.encode())


def is_allowed(frame: bytes) -> bool:
    """Whether a browser's frame may reach the viewer.

    A frame is one msgpack map whose ``type`` names the message. It is read by the decoder that
    the viewer uses, so that both see the same ``type``.
    """
    try:
        message = msgspec.msgpack.decode(frame)
    except (msgspec.DecodeError, ValueError, RecursionError):
        return False
    if not isinstance(message, dict):
        return False
    kind = message.get("type")
    return isinstance(kind, str) and not kind.startswith(DROPPED_PREFIX)
