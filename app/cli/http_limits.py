"""Limits of HTTP connections: size of the request head, time, progress, number of clients.

uvicorn's parser (httptools 0.9) accepts a head of any size, waits for it without limit and
joins fragments of a header at quadratic cost. This protocol enforces limits before the
application and its access control. WebSocket handshakes are parsed here, too.
"""

import asyncio
from collections.abc import Callable

from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol

from app.api.problems import problem
from app.api.responses import HEADERS
from app.cli.joined_head import JoinedHead

HEAD_BYTES = 32 * 1024
"""Limit of a request's head: URL and headers, trailers included [bytes]."""
HEAD_S = 10.0
"""Time limit from a connection, or the first byte of a further request, to its head [s]."""
BODY_S = 10.0
"""Period in which a body must progress by BODY_BYTES or end [s]."""
BODY_BYTES = 5000
"""Minimum progress of a body in BODY_S [bytes]."""
BODY_TOTAL_S = 300.0
"""Time limit of a whole body; the largest file needs 0.9 Mbit/s [s]."""
UNREAD_BYTES = 1 << 20
"""Limit of the data read after an answer or a refusal [bytes]."""
DRAIN_S = 60.0
"""Time limit for a client that reads nothing of its answer [s]."""
LINGER_S = 2.0
"""Time for a client to read a refusal [s]."""
MAX_PIPELINED = 32
"""Limit of pipelined requests of a connection."""
MAX_CONNECTIONS = 512
"""Limit of open connections, WebSockets included."""


class LimitedHttp(HttpToolsProtocol):
    """uvicorn's HTTP/1.1 protocol with limits; one object per connection."""

    _timer: asyncio.TimerHandle | None = None
    _drain_timer: asyncio.TimerHandle | None = None
    _begun = False
    """Whether a request is being received."""
    _in_body = False
    """Whether the head of this request is complete."""
    _ended = False
    """Whether further requests are ignored."""
    _head = 0
    """Length of the parsed part of the head [bytes]."""
    _pending = 0
    """Data since the last complete header or part of a body [bytes]."""
    _body_since = 0.0
    """Time at which the body began [s]."""
    _progress = 0
    """Data of the body since the timer was set [bytes]."""
    _unread = 0
    """Data after the answer or the refusal [bytes]."""
    _refusal = (400, "bad-request", "the request is not valid HTTP/1.1")

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Accept a client; over the limit, close the client with the longest idle time."""
        super().connection_made(transport)
        self._idle_since = self.loop.time()
        self._set_timer(HEAD_S, self._head_is_late)
        if len(self.connections) > MAX_CONNECTIONS:
            every = [one for one in self.connections if isinstance(one, LimitedHttp)]
            oldest = min(filter(LimitedHttp._is_idle, every), key=lambda one: one._idle_since)
            oldest._make_room()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the timers."""
        self._stop_timer()
        self.resume_writing()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Parse data within the limits."""
        if self._ended:
            self._unread += len(data)
            if self._unread > UNREAD_BYTES:
                self.flow.pause_reading()
            return
        self._pending += len(data)
        super().data_received(data)
        if self._ended:
            return
        if self._head + self._pending > HEAD_BYTES:
            self._refuse(*_HEAD_TOO_LARGE)
        elif self._timer is None and self._in_body:
            self._progress = 0
            self._set_timer(BODY_S, self._body_is_due)
        elif self._timer is None and (self._begun or self._pending):
            self._set_timer(HEAD_S, self._head_is_late)

    def on_message_begin(self) -> None:
        """Reset the counters."""
        self._begun, self._head, self._pending, self._unread = True, 0, 0, 0
        super().on_message_begin()

    def on_url(self, url: bytes) -> None:
        """Count a part of the URL."""
        self._count(len(url))
        super().on_url(url)

    def on_header(self, name: bytes, value: bytes) -> None:
        """Count a header with its punctuation."""
        self._count(len(name) + len(value) + 4)
        super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """Start the request, within the limit of pipelined ones."""
        self._stop_timer()
        if len(self.pipeline) >= MAX_PIPELINED:
            self._refusal = 503, "too-many-requests-at-once", "too many pipelined requests"
            raise ValueError(self._refusal)
        super().on_headers_complete()
        if self.cycle and not isinstance(self.cycle.transport, JoinedHead):
            has_body = self.scope["method"] != "HEAD"
            self.cycle.transport = JoinedHead(self.transport, has_body=has_body)
        self._in_body, self._body_since = True, self.loop.time()

    def on_body(self, body: bytes) -> None:
        """Count the progress of the body."""
        self._pending = 0
        self._progress += len(body)
        super().on_body(body)
        if self.cycle.response_complete:
            self._unread += len(body)
            if self._unread > UNREAD_BYTES:
                raise ValueError("the request was answered, its body has no reader")

    def on_message_complete(self) -> None:
        """Wait for the next request."""
        self._stop_timer()
        self._begun = self._in_body = False
        self._head = self._pending = 0
        super().on_message_complete()

    def on_response_complete(self) -> None:
        """Count the time without a request from here."""
        self._idle_since = self.loop.time()
        super().on_response_complete()

    def handle_websocket_upgrade(self) -> None:
        """Pass the connection to the WebSocket protocol, which has its own limits.

        A handshake whose headers it cannot decode must leave no protocol behind: nothing would
        remove it from the open connections.
        """
        self._stop_timer()
        self._ended = True
        if self.scope["method"] != "GET":
            self._end_with(400, "bad-request", "a WebSocket handshake is a GET request")
            return
        before = set(self.connections)
        try:
            super().handle_websocket_upgrade()
        except ValueError:
            self.connections.intersection_update(before)
            self.connections.add(self)
            detail = "the headers of a WebSocket handshake must be ASCII"
            self._end_with(400, "bad-request", detail)
            return
        if not getattr(self.transport.get_protocol(), "handshake_initiated", True):
            detail = "the headers of the handshake are too long or too many"
            self._end_with(431, "head-too-large", detail)

    def pause_writing(self) -> None:
        """Start the time limit of a client that does not read."""
        super().pause_writing()
        self._drain_timer = self.loop.call_later(DRAIN_S, self.transport.abort)

    def resume_writing(self) -> None:
        """Stop the time limit of a client that does not read."""
        super().resume_writing()
        if self._drain_timer is not None:
            self._drain_timer.cancel()
            self._drain_timer = None

    def send_400_response(self, msg: str) -> None:
        """Answer an error of the parser, or of a limit in its callbacks."""
        self._refuse(*self._refusal)

    def _end_with(self, status: int, kind: str, detail: str) -> None:
        """Answer with a problem and close the connection."""
        self.transport.write(_refusal(status, kind, detail))
        self.transport.close()

    def _is_idle(self) -> bool:
        answered = self.cycle is None or self.cycle.response_complete
        return answered and not self.transport.is_closing()

    def _make_room(self) -> None:
        self._ended = True
        if self.cycle is None:
            detail = f"the server has {MAX_CONNECTIONS} connections, the limit"
            self.transport.write(_refusal(503, "too-many-connections", detail))
        self.transport.close()

    def _count(self, n_bytes: int) -> None:
        self._head += n_bytes
        self._pending = 0
        if self._head > HEAD_BYTES:
            self._refusal = _HEAD_TOO_LARGE
            raise ValueError(_HEAD_TOO_LARGE)

    def _head_is_late(self) -> None:
        if self._begun or self._pending:
            detail = f"the head of the request was not complete after {HEAD_S:g} s"
            self._refuse(408, "request-too-slow", detail)
        else:
            self.transport.close()

    def _body_is_due(self) -> None:
        is_ours = self.flow.read_paused or self.cycle.waiting_for_100_continue
        is_late = self.loop.time() - self._body_since > BODY_TOTAL_S
        if is_ours or (self._progress >= BODY_BYTES and not is_late):
            self._progress = 0
            self._set_timer(BODY_S, self._body_is_due)
            return
        detail = f"the body progressed by less than {BODY_BYTES} bytes in {BODY_S:g} s"
        if is_late:
            detail = f"the body was not complete after {BODY_TOTAL_S:g} s"
        self._refuse(408, "request-too-slow", detail)

    def _refuse(self, status: int, kind: str, detail: str) -> None:
        """End the connection with a problem, or after the answer that is being sent."""
        self._ended = True
        self._unset_keepalive_if_required()
        self._stop_timer()
        if self.transport.is_closing():
            return
        cycle = self.cycle if self.cycle and not self.cycle.response_complete else None
        if cycle is not None and not self._in_body:
            cycle.keep_alive = False  # the connection ends with this earlier answer
            self.flow.pause_reading()
            return
        if self.pipeline:  # this request is behind others and is not answered
            self.transport.close()
            return
        if cycle is not None:
            cycle.disconnected = True
            cycle.message_event.set()
        if not self._in_body or (cycle is not None and not cycle.response_started):
            self.transport.write(_refusal(status, kind, detail))
        self.flow.resume_reading()
        self.transport.write_eof()
        self._set_timer(LINGER_S, self.transport.close)

    def _set_timer(self, seconds: float, call: Callable[[], None]) -> None:
        self._stop_timer()
        self._timer = self.loop.call_later(seconds, call)

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


_HEAD_TOO_LARGE = (
    431,
    "head-too-large",
    f"URL and headers of the request exceed {HEAD_BYTES} bytes",
)


def _refusal(status: int, kind: str, detail: str) -> bytes:
    """Return an HTTP/1.1 response that ends the connection."""
    answer = problem(status, detail, kind=kind, headers={**HEADERS, "Connection": "close"})
    lines = [STATUS_LINE[status]]
    for name, value in answer.raw_headers:
        lines += [name, b": ", value, b"\r\n"]
    return b"".join([*lines, b"\r\n", bytes(answer.body)])
