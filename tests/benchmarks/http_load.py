"""Load over HTTP/1.1: clients that each post one request again as soon as it is answered.

The generator must cost less than what it measures: one asyncio protocol per client on uvloop,
answers parsed by httptools, the request prepared once.
"""

import asyncio
import json
import time
from dataclasses import dataclass
from typing import cast
from urllib.parse import urlsplit

import httptools
import numpy as np
import uvloop

from app.sim.core.arrays import Vec


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """One request, sent again and again."""

    path: str
    """Path of the route."""
    body: object = None
    """JSON data to post; None: the request is a ``GET``."""

    def encoded(self, host: str) -> bytes:
        """Return the bytes of the request.

        Args:
            host: Value of the header ``Host``.
        """
        if self.body is None:
            return f"GET {self.path} HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()
        body = json.dumps(self.body).encode()
        head = (
            f"POST {self.path} HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\n"
            f"Content-Length: {len(body)}\r\n\r\n"
        )
        return head.encode() + body


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """Outcome of a load."""

    times_ms: Vec
    """Time from each request to the end of its answer [ms], shape (n,)."""
    per_second: float
    """Answers per second of all clients."""


class Client(asyncio.Protocol):
    """A client on one connection; its first request, which waits to be accepted, is not timed.

    Args:
        request: Bytes of the request.
        times_ms: Gets the time of each answer [ms].
    """

    def __init__(self, request: bytes, times_ms: list[float]) -> None:
        self._request, self._times_ms = request, times_ms
        self._until: float | None = None
        self._parser = httptools.HttpResponseParser(self)
        self._body = b""
        self.ready = asyncio.get_running_loop().create_future()
        """Set once the first answer has come, or the connection has ended."""
        self.done = asyncio.get_running_loop().create_future()
        """Set once the last answer has come; an exception where one is no 200."""
        self.closed = asyncio.get_running_loop().create_future()
        """Set once the connection is closed."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Send the first request."""
        self._transport = cast(asyncio.Transport, transport)
        self._send()

    def data_received(self, data: bytes) -> None:
        """Take a part of an answer."""
        self._parser.feed_data(data)

    def on_body(self, body: bytes) -> None:
        """Keep the body of an error, to print it."""
        if self._parser.get_status_code() != 200:
            self._body += body

    def on_message_complete(self) -> None:
        """Note the time of an answer and send the next request."""
        now = time.perf_counter()
        status = self._parser.get_status_code()
        if status != 200:
            self._end(RuntimeError(f"status {status}: {self._body.decode()}"))
            return
        if self._until is None:
            self.ready.set_result(None)
            return
        self._times_ms.append(1e3 * (now - self._sent))
        if now < self._until:
            self._send()
        else:
            self._end(None)

    def connection_lost(self, exc: Exception | None) -> None:
        """Fail where the server closed the connection."""
        self._end(exc or ConnectionError("the server closed the connection"))
        self.closed.set_result(None)

    def start(self, until: float) -> None:
        """Send timed requests until a time on the clock ``time.perf_counter`` [s]."""
        self._until = until
        if not self.done.done():
            self._send()

    def _send(self) -> None:
        self._sent = time.perf_counter()
        self._transport.write(self._request)

    def _end(self, error: Exception | None) -> None:
        if self.done.done():
            return
        if not self.ready.done():
            self.ready.set_result(None)
        if error is None:
            self.done.set_result(None)
        else:
            self.done.set_exception(error)
        self._transport.close()


def load(address: str, request: Request, *, clients: int, seconds: float) -> Load:
    """Return the answers to a number of clients.

    Args:
        address: Address of the server.
        request: What each client sends.
        clients: Number of clients.
        seconds: Time for which requests are sent [s].

    Raises:
        RuntimeError: An answer is not 200.
        OSError: A connection broke off.
    """
    return uvloop.run(_load(address, request, clients, seconds))


async def _load(address: str, request: Request, clients: int, seconds: float) -> Load:
    parts, times_ms = urlsplit(address), list[float]()
    content = request.encoded(parts.netloc)
    opened = [
        asyncio.get_running_loop().create_connection(
            lambda: Client(content, times_ms), parts.hostname, parts.port
        )
        for _ in range(clients)
    ]
    connected = await asyncio.gather(*opened)
    await asyncio.gather(*(one.ready for _, one in connected))
    begin = time.perf_counter()
    for _, one in connected:
        one.start(begin + seconds)
    ends = await asyncio.gather(*(one.done for _, one in connected), return_exceptions=True)
    spent = time.perf_counter() - begin
    await asyncio.gather(*(one.closed for _, one in connected))
    for end in ends:
        if end is not None:
            raise end
    return Load(times_ms=np.array(times_ms), per_second=len(times_ms) / spent)
