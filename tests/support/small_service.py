"""A small application behind the service's guard: ``python -m tests.support.small_service``.

Runs until it is killed, in a process of its own, so that its memory can be measured. Prints its
address once it listens. ``HEAD_S`` and other limits in the environment replace the
limits of ``app/cli/http_limits.py``.
"""

import asyncio
import os
from collections.abc import AsyncIterator

from fastapi import FastAPI, Request
from starlette.responses import Response, StreamingResponse
from starlette.websockets import WebSocket

from app.api.bodies import BodyMiddleware
from app.api.problems import install
from app.api.security import AccessMiddleware
from app.cli import http_limits
from app.cli.preflight import address_of, listen
from app.cli.uvicorn_server import new_server

TOKEN = "a token of the tests"
LARGE = bytes(64 * 1024 * 1024)

app = FastAPI()
install(app)


@app.get("/name")
async def name(request: Request) -> dict[str, str]:
    """Answer with the query."""
    return dict(request.query_params)


@app.post("/length")
async def length(request: Request) -> dict[str, int]:
    """Answer with the length of the body [bytes]."""
    return {"length": len(await request.body())}


@app.get("/slow")
async def slow() -> StreamingResponse:
    """Answer in pieces over one second."""

    async def pieces() -> AsyncIterator[bytes]:
        for _ in range(10):
            await asyncio.sleep(0.1)
            yield b"piece "

    return StreamingResponse(pieces())


@app.get("/large")
async def large() -> Response:
    """Answer with more than any socket buffers."""
    return Response(LARGE)


@app.websocket("/echo")
async def echo(socket: WebSocket) -> None:
    """Send back each text."""
    await socket.accept()
    async for text in socket.iter_text():
        await socket.send_text(text)


@app.websocket("/flood")
async def flood(socket: WebSocket) -> None:
    """Send without end."""
    await socket.accept()
    while True:
        await socket.send_bytes(bytes(65536))


app.add_middleware(BodyMiddleware, files={"/length": 64 * 1024 * 1024})
app.add_middleware(AccessMiddleware, token=TOKEN, open_paths=())

if __name__ == "__main__":
    for name in ("HEAD_S", "BODY_S", "DRAIN_S", "LINGER_S", "BODY_BYTES", "BODY_TOTAL_S"):
        setattr(http_limits, name, float(os.environ.get(name, getattr(http_limits, name))))
    sock = listen("127.0.0.1", 0)
    print(address_of(sock), flush=True)
    new_server(app).run(sockets=[sock])
