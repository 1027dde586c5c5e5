"""Trackers that are being listened to: their estimators, kept between frames.

A session is opened, fed frame by frame and closed; one that nobody uses ends by itself. There
is room for a stated number of them. A session's estimates are made under its own lock, so that
frames of one camera come in order and different cameras do not wait for each other.
"""

import secrets
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from app.errors import Conflict, InvalidInput, NotFound
from app.sim.people_estimate import PeopleEstimator
from app.sim.person_estimate import PersonEstimate
from app.sim.ports import Vec

MAX_SESSIONS = 32
"""Most trackers at once."""
IDLE_S = 300.0
"""Time after which a tracker that nobody used ends [s]."""
MAX_SILENCE_S = 3600.0
"""How far beyond the newest frame an estimate may be asked for [s]."""


@dataclass(slots=True, kw_only=True)
class TrackerSession:
    """One tracker: what it has told so far."""

    id: str
    """Its name in URLs."""
    cell: str
    """Name of the work cell it watches."""
    n_people: int
    """Most people it follows."""
    estimator: PeopleEstimator
    """What is known of them."""
    t: float | None = None
    """Time of its newest frame [s]."""
    n_frames: int = 0
    """Frames taken in."""
    used_at: float = 0.0
    """When it was last used, on the service's clock [s]."""
    lock: threading.Lock = field(default_factory=threading.Lock)
    """Held while its estimator works."""

    def take(
        self, t: float, people: Sequence[Vec], confidences: Sequence[Vec]
    ) -> tuple[PersonEstimate, ...]:
        """Take one frame of all people in.

        Raises:
            InvalidInput: See :meth:`PeopleEstimator.update`; nothing is taken in then.
        """
        with self.lock:
            estimates = self.estimator.update(t, people, confidences)
            self.t, self.n_frames = t, self.n_frames + 1
            return estimates

    def estimates(self, t: float | None) -> tuple[float, tuple[PersonEstimate, ...]]:
        """Return what is known at ``t``, by default at the newest frame, and that time [s].

        Raises:
            InvalidInput: There is no frame yet, or ``t`` is before the newest or long after.
        """
        with self.lock:
            newest = self.t
            if newest is None:
                raise InvalidInput("tracker", self.id, "must have had a frame before")
            at = newest if t is None else t
            if not newest <= at <= newest + MAX_SILENCE_S:
                rule = (
                    f"must lie within {MAX_SILENCE_S:g} s after the newest frame, {newest:g} s"
                )
                raise InvalidInput("t", at, rule)
            return at, self.estimator.at(at)


class TrackerSessions:
    """The sessions that are open; safe to use from any thread.

    Args:
        clock: Tells the time [s], by default one that never goes back.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._lock = threading.Lock()
        self._sessions: dict[str, TrackerSession] = {}

    def open(
        self, cell: str, n_people: int, size: Vec, floor_z: float | None = None
    ) -> TrackerSession:
        """Return a new session.

        Args:
            cell: Name of the work cell.
            n_people: Most people at once.
            size: Size of these people [m], shape (12,).
            floor_z: Height of the cell's floor [m]; None: heights over it are not judged.

        Raises:
            Conflict: There are as many as there may be.
        """
        session = TrackerSession(
            id=secrets.token_hex(8),
            cell=cell,
            n_people=n_people,
            estimator=PeopleEstimator(n_people, size, floor_z=floor_z),
        )
        with self._lock:
            self._forget_idle()
            if len(self._sessions) >= MAX_SESSIONS:
                raise Conflict(
                    f"{MAX_SESSIONS} trackers are open, the most there may be: delete one, or "
                    f"wait: one that nobody uses ends after {IDLE_S:g} s"
                )
            session.used_at = self._clock()
            self._sessions[session.id] = session
        return session

    def get(self, session_id: str) -> TrackerSession:
        """Return a session and count it as used.

        Raises:
            NotFound: There is no such session, or it ended unused.
        """
        with self._lock:
            self._forget_idle()
            session = self._sessions.get(session_id)
            if session is None:
                raise NotFound("tracker", session_id)
            session.used_at = self._clock()
            return session

    def close(self, session_id: str) -> None:
        """End a session.

        Raises:
            NotFound: There is no such session.
        """
        with self._lock:
            if self._sessions.pop(session_id, None) is None:
                raise NotFound("tracker", session_id)

    def all(self) -> list[TrackerSession]:
        """Return the open sessions, oldest first."""
        with self._lock:
            self._forget_idle()
            return list(self._sessions.values())

    def _forget_idle(self) -> None:
        now = self._clock()
        for session in list(self._sessions.values()):
            if now - session.used_at > IDLE_S:
                del self._sessions[session.id]
