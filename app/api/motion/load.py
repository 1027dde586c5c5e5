"""Admission of motion sockets by the measured time of decisions.

Decisions of all sockets take turns on the event loop. A socket is admitted while the expected
share of the time for decisions stays below ``MAX_SHARE``: requests per second of the open
sockets times the mean time of a decision, measured on the clock, so that a busy machine admits
fewer.
"""

import asyncio
import time
from collections import deque
from dataclasses import dataclass, field

MAX_SHARE = 0.92
"""Largest share of the time for decisions at which a socket is admitted. Whole decisions are
counted, and a loaded server shortens them: two cores answer 16 sockets at 50 Hz within 20 ms in
99 % of the requests (``bench sockets``)."""
MAX_SOCKETS = 64
"""Largest number of open sockets."""
LOOP_HZ = 50.0
"""Rate assumed for a new socket [1/s]."""
NEW_S = 2.0
"""Time for which a socket counts as new [s]."""
FIRST_GUESS_S = 1e-3
"""Time of a decision before one was measured [s]."""
SMOOTHING = 0.02
"""Weight of the newest decision in the mean."""


@dataclass(slots=True, eq=False)
class SocketRate:
    """Decisions of one socket; times are those of ``time.monotonic`` [s]."""

    opened: float = field(default_factory=time.monotonic)
    """Time of its opening."""
    decided: deque[float] = field(default_factory=lambda: deque(maxlen=256))
    """Times of its last decisions."""

    def per_second(self, now: float) -> float:
        """Return its decisions of the last second; ``LOOP_HZ`` at least while it is new."""
        while self.decided and self.decided[0] < now - 1.0:
            self.decided.popleft()
        return max(len(self.decided), LOOP_HZ if now - self.opened < NEW_S else 0.0)


@dataclass(slots=True)
class MotionLoad:
    """Load by motion sockets; used on the event loop only."""

    idle_s: float = 60.0
    """Time without a request after which a socket is closed [s]."""
    decision_s: float = FIRST_GUESS_S
    """Mean time of a decision of which nothing was left out [s]."""
    turn: asyncio.Lock = field(default_factory=asyncio.Lock)
    """Held during a decision; others wait in order."""
    _open: set[SocketRate] = field(default_factory=set)

    def refusal(self) -> str | None:
        """Return why no further socket is admitted; None if one is."""
        if self.n_open >= MAX_SOCKETS:
            return f"{MAX_SOCKETS} motion sockets are open already: close one of them"
        share = self.share()
        if self._open and share + LOOP_HZ * self.decision_s > MAX_SHARE:
            return (
                f"motion sockets use {100 * share:.0f} % of the time for decisions "
                f"({self.n_open} are open); one more would exceed {100 * MAX_SHARE:.0f} %"
            )
        return None

    @property
    def n_open(self) -> int:
        """Number of open sockets."""
        return len(self._open)

    def share(self) -> float:
        """Return the expected share of the time that goes into decisions of the sockets."""
        now = time.monotonic()
        return self.decision_s * sum(one.per_second(now) for one in self._open)

    def add(self, socket: SocketRate) -> None:
        """Count a socket until :meth:`remove`."""
        self._open.add(socket)

    def remove(self, socket: SocketRate) -> None:
        """Count a socket no more."""
        self._open.discard(socket)

    def note(self, socket: SocketRate, seconds: float, *, whole: bool) -> None:
        """Count a decision of a socket.

        Args:
            seconds: Time of the decision on the clock [s].
            whole: Whether no part of it was left out; only such decisions enter the mean.
        """
        socket.decided.append(time.monotonic())
        if whole:
            self.decision_s += SMOOTHING * (seconds - self.decision_s)
