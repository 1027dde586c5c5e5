"""viser's server behind a Unix socket, unreachable for browsers and other users.

viser (1.1.1) listens on a TCP port and checks neither token nor ``Origin`` nor ``Host``: any
page in a browser of this machine could open that port and drag a person of the live cell. Here
it listens on a Unix socket in a directory of mode 0700 instead. Only processes of the same user
can connect, browsers cannot address a Unix socket, and the only access is the proxy in
:mod:`app.api.routes.viewer`, behind the service's own checks.

viser has no option for the socket. ``serve`` of :mod:`websockets.asyncio.server`, which viser
looks up at its start, is therefore replaced during its constructor; calls for another host are
unchanged. The message that asks for a public tunnel has no handler.
"""

import asyncio
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import viser
import viser._messages
import viser.infra
import websockets.asyncio.server

from app.temporary_folder import TemporaryFolder

_starting = threading.Lock()
CURRENT_S = 2.0
"""Longest time for which a connecting viewer waits for the present scene [s]."""


class ViewerServer(viser.ViserServer):
    """A viser server that listens on a Unix socket; ``stop`` removes the socket.

    Raises:
        OSError: The socket cannot be made.
    """

    def __init__(self) -> None:
        self._folder = TemporaryFolder("tandem-viewer-")
        self.address = self._folder.path / "viewer"
        """Path of the socket."""
        try:
            with _listening_on(self.address):
                super().__init__(host=str(self.address), port=0, verbose=False)
        except BaseException:
            self._folder.close()
            raise
        buffer = self._websock_server._broadcast_buffer
        buffer.message_event = _LoopEvent(buffer.event_loop)
        self.is_current = threading.Event()
        """Whether the scene is the present one; a connecting viewer waits until it is."""
        self.is_current.set()
        self._websock_server.on_client_connect(self._wait_until_current)
        for request in (viser._messages.ShareUrlRequest, viser._messages.ShareUrlDisconnect):
            self._websock_server.unregister_handler(request)

    @property
    def has_viewers(self) -> bool:
        """Whether a viewer is connected or connecting."""
        return bool(self._websock_server._client_state_from_id)

    async def _wait_until_current(self, _: viser.infra.WebsockClientConnection) -> None:
        """Delay the first message to a viewer until the scene is the present one."""
        if not self.is_current.is_set():
            await asyncio.to_thread(self.is_current.wait, CURRENT_S)

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Refuse: a public tunnel would bypass the checks of the service."""
        return None

    def stop(self) -> None:
        """End the server and remove its socket."""
        super().stop()
        self._folder.close()


class _LoopEvent(asyncio.Event):
    """An event that a thread may set: it wakes waiters on its loop only.

    viser (1.1.1) sets it from the thread that draws, and once more on the loop. The first call
    changes the waiters beside the loop, which may iterate over them at that moment.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        super().__init__()
        self._owner = loop

    def set(self) -> None:
        """Set the event; on another thread, leave the waiters to the call on the loop."""
        try:
            is_on_loop = asyncio.get_running_loop() is self._owner
        except RuntimeError:
            is_on_loop = False
        if is_on_loop:
            self._value = False  # asyncio wakes nobody where it is set already
            super().set()
        else:
            self._value = True


@contextmanager
def _listening_on(address: Path) -> Iterator[None]:
    """Let the viser server that starts in this block listen on ``address``.

    Raises:
        OSError: The socket cannot be made.
    """
    listener = socket.socket(socket.AF_UNIX)
    try:
        listener.bind(str(address))
    except OSError:
        listener.close()
        raise
    with _starting:
        original = websockets.asyncio.server.serve

        def serve(handler: Any, host: Any = None, port: Any = None, **options: Any) -> Any:
            if host != str(address):
                return original(handler, host, port, **options)
            # Both ends live in this process: a ping could only find that it was paused.
            options |= {"sock": listener, "ping_interval": None}
            return websockets.asyncio.server.unix_serve(handler, **options)

        websockets.asyncio.server.serve = serve  # type: ignore[assignment,misc]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = original  # type: ignore[misc]
