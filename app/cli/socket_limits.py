"""Limits of WebSocket connections: time for a client that does not read.

uvicorn's protocol waits for a client to read without limit, also after it closed the
connection, and buffers an answer to each ping.
"""

import asyncio

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from app.cli import http_limits


class LimitedSocket(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket protocol with limits; one object per connection."""

    _drain_timer: asyncio.TimerHandle | None = None

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the timer."""
        self._stop_timer()
        super().connection_lost(exc)

    def pause_writing(self) -> None:
        """Start the time limit of a client that does not read."""
        super().pause_writing()
        self._end_in(http_limits.DRAIN_S)

    def resume_writing(self) -> None:
        """Stop the time limit of a client that does not read."""
        super().resume_writing()
        self._stop_timer()

    def handle_ping(self) -> None:
        """Answer a ping; one of a client that does not read is left unanswered."""
        if self.writable.is_set():
            super().handle_ping()
        else:
            self.conn.data_to_send()

    def keepalive_timeout(self) -> None:
        """Close the connection of a client that answers no ping, whether it reads or not."""
        super().keepalive_timeout()
        self._end_in(http_limits.LINGER_S)

    def _end_in(self, seconds: float) -> None:
        self._stop_timer()
        self._drain_timer = self.loop.call_later(seconds, self.transport.abort)

    def _stop_timer(self) -> None:
        if self._drain_timer is not None:
            self._drain_timer.cancel()
            self._drain_timer = None
