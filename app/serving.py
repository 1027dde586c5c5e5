"""Running the application on uvicorn: one process, one worker, a quick end.

One worker, because the live world and its viewer live in this process. Frames of the viewer go
uncompressed: compressing them costs more than it saves.
"""

import socket
from collections.abc import Awaitable, Callable
from types import FrameType

import torch
import uvicorn
from fastapi import FastAPI

from app.http_limits import LimitedHttp
from app.listening import address_of
from app.main import create_app
from app.settings import Settings

GRACE_S = 3
"""How long open requests may go on once the server stops [s]."""

MAX_FRAME_BYTES = 16 * 1024 * 1024
"""Largest frame a socket takes in: a picture of the viewer's canvas; see ``app.api.viewer``."""

Say = Callable[[str], None]


class Server(uvicorn.Server):
    """uvicorn's server, which tells open streams to end before it waits for them."""

    def __init__(self, config: uvicorn.Config, app: FastAPI) -> None:
        super().__init__(config)
        self._app = app

    def handle_exit(self, sig: int, frame: FrameType | None) -> None:
        """End the streams, then go the usual way."""
        services = getattr(self._app.state, "services", None)
        if services is not None:
            services.stopping.set()
        super().handle_exit(sig, frame)


def server_of(
    app: FastAPI, tell: Callable[[], Awaitable[None]] | None = None, *, root_path: str = ""
) -> Server:
    """Return the server that runs an application.

    Args:
        app: The application.
        tell: Called once a second.
        root_path: Path under which a reverse proxy shows the service and which it removes.
    """
    config = uvicorn.Config(
        app,
        http=LimitedHttp,
        root_path=root_path,
        log_config=None,
        access_log=False,
        ws_per_message_deflate=False,
        ws_max_size=MAX_FRAME_BYTES,
        timeout_graceful_shutdown=GRACE_S,
        callback_notify=tell,
        timeout_notify=0,
        server_header=False,
    )
    return Server(config, app)


def serve(settings: Settings, sock: socket.socket, say: Say) -> None:
    """Run the service until it is told to stop.

    Args:
        settings: Where and how it runs.
        sock: Listening socket.
        say: Told the address once it can decide, or why it cannot.
    """
    say(f"Tandem starts: {address_of(sock)}")
    torch.set_num_threads(1)  # a decision is small; the other cores belong to the jobs
    app = create_app(settings)
    told: list[str] = []

    async def tell() -> None:
        services = getattr(app.state, "services", None)
        if services is None or told or services.stopping.is_set():
            return
        if services.readiness.ready:
            told.append(f"Tandem is ready: {address_of(sock)}")
        elif services.readiness.failed:
            told.append(f"Tandem cannot decide: {services.readiness.reason}")
        for line in told:
            say(line)

    server_of(app, tell, root_path=settings.root_path).run(sockets=[sock])
