"""Proxy for the 3D viewer of a world, on the service's port.

The viewer (viser 1.1.1) has no access control and listens on a Unix socket of this process's
user. The proxy stands behind :mod:`app.api.security` and limits types and sizes of frames. The
viewer's page gets a style sheet and a script that hide the library's notices and restart a
broken scene.
"""

import asyncio
import gzip
import hashlib
import logging
import math
from functools import lru_cache
from importlib import resources
from typing import Annotated

import msgspec
from fastapi import APIRouter, Header
from starlette.concurrency import run_in_threadpool
from starlette.responses import RedirectResponse, Response
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState
from websockets.asyncio.client import ClientConnection, unix_connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Subprotocol

from app.api.compression import accepts_gzip
from app.api.services import MAX_VIEWERS, LiveWorld, ServicesDep, services_of
from app.api.sockets import MAX_MESSAGE, TOO_LARGE, refuse
from app.errors import ServiceError

logger = logging.getLogger(__name__)
router = APIRouter(include_in_schema=False)

TYPES = {
    "GuiUpdateMessage",
    "SceneNodeClickMessage",
    "SceneNodeDragMessage",
    "ScenePointerMessage",
    "TransformControlsDragEndMessage",
    "TransformControlsDragStartMessage",
    "TransformControlsUpdateMessage",
    "ViewerCameraMessage",
}
"""Allowed messages of a browser: no uploads, no requests for a public tunnel."""
VECTORS = {
    "wxyz": 4,
    "position": 3,
    "look_at": 3,
    "up_direction": 3,
    "start_position": 3,
    "end_position": 3,
    "ray_origin": 3,
    "ray_direction": 3,
    "start_screen_pos": 2,
    "end_screen_pos": 2,
}
"""Numbers of each vector of a message, which the viewer stores as they come."""
OPTIONAL = {"ray_origin", "ray_direction"}
"""Vectors that may be null: a rectangle that is drawn in the scene has no ray."""
SMALL_BYTES = 1024
"""Largest frame decoded on the event loop [bytes]; larger ones are decoded in a thread."""
# The viewer's page is one inline script that unpacks itself, and its WebAssembly loader
# evaluates text; both are restricted to the viewer's frame and to this server.
POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; font-src 'self' data:; "
    "style-src 'self' 'unsafe-inline'; worker-src 'self' blob: data:; "
    "script-src 'self' 'unsafe-inline' 'unsafe-eval' blob: data:; "
    "connect-src 'self' blob: data:; object-src 'none'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'self'"
)


@router.get("/viewer/{world_id}")
async def add_slash(world_id: str, services: ServicesDep) -> RedirectResponse:
    """Redirect to the address with a trailing slash, for relative names."""
    services.world(world_id)
    return RedirectResponse(f"/viewer/{world_id}/")


@router.get("/viewer/{world_id}/")
async def page(
    world_id: str,
    services: ServicesDep,
    accept_encoding: Annotated[str, Header()] = "",
) -> Response:
    """Return the viewer's page."""
    services.world(world_id)
    plain, packed, etag = await run_in_threadpool(viewer_page)
    headers = {
        "ETag": etag,
        "Content-Security-Policy": POLICY,
        "Cache-Control": "no-cache",
        "Vary": "Accept-Encoding",
    }
    if accepts_gzip(accept_encoding):
        return Response(
            packed, media_type="text/html", headers=headers | {"Content-Encoding": "gzip"}
        )
    return Response(plain, media_type="text/html", headers=headers)


@lru_cache(maxsize=1)
def viewer_page() -> tuple[bytes, bytes, str]:
    """Return the viewer's page with our style and script: plain, compressed, and its ETag."""
    content = (resources.files("viser") / "client" / "build" / "index.html").read_bytes()
    extra = (resources.files("app.api.routes") / "viewer_extra.html").read_bytes()
    plain = content.replace(b"<script", extra + b"<script", 1)
    return plain, gzip.compress(plain, 6), f'"{hashlib.sha256(plain).hexdigest()[:32]}"'


@router.websocket("/viewer/{world_id}")
@router.websocket("/viewer/{world_id}/")
async def socket(client: WebSocket, world_id: str) -> None:
    """Pass frames between a browser and the viewer until one side closes."""
    services = services_of(client)
    try:
        world = services.world(world_id)
    except ServiceError as error:
        logger.info("viewer socket refused: %s", error)
        await refuse(client, "no such world yet")
        return
    if not services.viewers.acquire(blocking=False):
        await refuse(client, f"{MAX_VIEWERS} viewers are open already: close one of them")
        return
    try:
        await connect_viewer(client, world)
    finally:
        services.viewers.release()


async def connect_viewer(client: WebSocket, world: LiveWorld) -> None:
    """Connect to the viewer's socket and pass frames."""
    offered = [Subprotocol(one) for one in client.scope.get("subprotocols", [])]
    try:
        viewer = await unix_connect(
            str(world.viewer_address),
            subprotocols=offered or None,
            max_size=None,
            compression=None,
            ping_interval=None,
        )
    except (OSError, RuntimeError) as error:
        logger.warning("the viewer does not answer: %s", error)
        await refuse(client, "the viewer does not answer")
        return
    async with viewer:
        await client.accept(viewer.subprotocol)
        await pass_frames(client, viewer)


async def pass_frames(client: WebSocket, viewer: ClientConnection) -> None:
    """Pass frames in both directions; when one side ends, end the other."""
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
    """Pass allowed frames of the browser on; close the connection at one that is too large."""
    while True:
        message = await client.receive()
        if message["type"] == "websocket.disconnect":
            return
        frame: bytes = message.get("bytes") or b""
        if len(frame or message.get("text") or "") > MAX_MESSAGE:
            await client.close(TOO_LARGE, f"a frame has at most {MAX_MESSAGE} bytes")
            return
        small = len(frame) <= SMALL_BYTES
        allowed = is_allowed(frame) if small else await asyncio.to_thread(is_allowed, frame)
        if allowed:
            await viewer.send(frame)
        else:
            logger.warning("dropped a forbidden frame of a browser")


async def to_client(client: WebSocket, viewer: ClientConnection) -> None:
    """Pass the viewer's frames on, at the pace of the browser."""
    async for frame in viewer:
        await client.send_bytes(frame if isinstance(frame, bytes) else frame.encode())


def is_allowed(frame: bytes) -> bool:
    """Return whether a browser's frame may reach the viewer.

    A frame is one msgpack map with the name of the message in ``type``. It is decoded as the
    viewer does, so that both see the same ``type``. Its vectors have finite numbers.
    """
    try:
        message = msgspec.msgpack.decode(frame)
    except (msgspec.DecodeError, ValueError, RecursionError):
        return False
    kind = message.get("type") if isinstance(message, dict) else None
    if not isinstance(kind, str) or kind not in TYPES:
        return False
    given = (
        (message[name], size)
        for name, size in VECTORS.items()
        if name in message and not (message[name] is None and name in OPTIONAL)
    )
    return all(_is_vector(value, size) for value, size in given)


def _is_vector(value: object, size: int) -> bool:
    """Return whether a value is a list of finite numbers of a given length."""
    return (
        isinstance(value, list)
        and len(value) == size
        and all(type(one) in (int, float) and math.isfinite(one) for one in value)
    )
