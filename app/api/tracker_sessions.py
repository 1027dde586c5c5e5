"""Sessions of trackers: the estimators of their people, kept between frames.

A session is opened, fed frame by frame and closed; an unused one ends by itself. Their number
is limited. A session's estimates are made under its own lock, so that frames of one camera come
in order and different cameras do not wait for each other.

The age of what a tracker reports counts from the arrival of its newest frame
(:mod:`app.sim.perception.stamp_timeline`), on a clock that goes on while the machine is
suspended.
"""

import secrets
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from app.errors import Conflict, NotFound
from app.sim.core.arrays import Vec
from app.sim.perception.multi_person_tracker import MultiPersonTracker, Unfollowed
from app.sim.perception.person_estimator import Flag, PersonEstimate
from app.sim.perception.stamp_timeline import StampTimeline

MAX_SESSIONS = 32
"""Most trackers at once."""
IDLE_S = 300.0
"""Time after which a tracker that nobody used ends [s]."""


def service_clock() -> float:
    """Return the time of the service's clock [s].

    It never runs backwards, and on Linux it counts the time for which the machine was
    suspended: people have moved on meanwhile.
    """
    if hasattr(time, "CLOCK_BOOTTIME"):
        return time.clock_gettime(time.CLOCK_BOOTTIME)
    return time.monotonic()


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackedPeople:
    """A tracker's people at one moment."""

    t: float | None
    """The moment, on the tracker's clock [s]; None before the first frame."""
    since_frame_s: float
    """Time since the newest frame, or since the tracker was opened where none has come [s]."""
    estimates: tuple[PersonEstimate, ...]
    """Estimate of each track, predicted for the moment."""
    observed: tuple[PersonEstimate | None, ...]
    """Estimate of each track at the last frame that showed its person; None: no frame did."""
    observed_age_s: tuple[float, ...]
    """Age of each observation at the moment [s]; without one, ``since_frame_s``."""
    unfollowed: tuple[Unfollowed, ...]
    """People in the newest frame who are not followed, nearest first."""


@dataclass(slots=True, kw_only=True)
class TrackerSession:
    """One tracker: what it has told so far."""

    id: str
    """Its name in URLs."""
    cell: str
    """Name of the work cell it watches."""
    n_people: int
    """Most people it follows."""
    estimator: MultiPersonTracker
    """Estimates its people, on the timeline."""
    timeline: StampTimeline
    """Maps its stamps to time."""
    clock: Callable[[], float]
    """The service's clock [s]."""
    n_frames: int = 0
    """Frames taken."""
    used_at: float = 0.0
    """When it was last used, on the service's clock [s]."""
    lock: threading.Lock = field(default_factory=threading.Lock)
    """Held while its estimator works."""

    @property
    def t(self) -> float | None:
        """Stamp of its newest frame [s]; None before the first."""
        return self.timeline.stamp

    def take(
        self, t: float, arrived: float, people: Sequence[Vec], confidences: Sequence[Vec]
    ) -> TrackedPeople:
        """Take one frame of all people and return what is known at its time.

        Args:
            t: When the frame was taken, tracker's clock [s].
            arrived: When it arrived, service's clock [s].
            people: Key-points of each person [m], shape (25, 3) each, NaN where missing.
            confidences: Trust in them, shape (25,) each.

        Raises:
            ClockJump: ``t`` does not continue the frames before; the frame is not taken.
            InvalidInput: See :meth:`MultiPersonTracker.update`; the frame is not taken.
        """
        with self.lock:
            at = self.timeline.offer(t, arrived)
            estimates = self.estimator.update(at, people, confidences)
            self.timeline.accept(t, at, arrived)
            self.n_frames += 1
            return self._tracked(estimates, 0.0)

    def people(self, t: float | None = None) -> TrackedPeople:
        """Return what is known of its people now.

        Args:
            t: The present on the tracker's clock, as the caller has it [s]. It counts where it
                makes people older than the arrival of the newest frame does.
        """
        with self.lock:
            since = self.timeline.ahead(self.clock(), t)
            return self._tracked(self.estimator.at((self.timeline.time or 0.0) + since), since)

    def _tracked(
        self, estimates: tuple[PersonEstimate, ...], since_frame_s: float
    ) -> TrackedPeople:
        """Return estimates for a moment after the newest frame, with all that is known then."""
        newest, observed = self.timeline.stamp, tuple(self.estimator.observed)
        at = (self.timeline.time or 0.0) + since_frame_s
        ages = [
            since_frame_s if one is None else at - one.t + one.carried_s for one in observed
        ]
        return TrackedPeople(
            t=None if newest is None else newest + since_frame_s,
            since_frame_s=since_frame_s,
            estimates=self._flagged(estimates, since_frame_s),
            observed=observed,
            observed_age_s=tuple(ages),
            unfollowed=self.estimator.unfollowed,
        )

    def _flagged(
        self, estimates: tuple[PersonEstimate, ...], since_frame_s: float
    ) -> tuple[PersonEstimate, ...]:
        """Return estimates that also name the silence of the tracker and a jump of its clock.

        A person who was never seen is only known to be absent while frames arrive.
        """
        added: list[Flag] = []
        if self.timeline.out_of_step or self.timeline.jumped:
            added.append("clock-jump")
        silent = since_frame_s > self.estimator.settings.stale_s
        if self.timeline.out_of_step or self.timeline.stamp is None or silent:
            added.append("stale")
        if not added:
            return estimates
        return tuple(
            replace(one, flags=tuple(dict.fromkeys((*one.flags, *added)))) for one in estimates
        )


class TrackerSessions:
    """The sessions that are open; safe to use from any thread.

    Args:
        clock: Returns the time [s]; must never run backwards.
    """

    def __init__(self, clock: Callable[[], float] = service_clock) -> None:
        self.clock = clock
        self._lock = threading.Lock()
        self._sessions: dict[str, TrackerSession] = {}

    def open(self, cell: str, n_people: int, size: Vec, floor_z: float) -> TrackerSession:
        """Return a new session.

        Args:
            cell: Name of the work cell.
            n_people: Most people at once.
            size: Size of these people [m], shape (12,).
            floor_z: Height of the cell's floor [m].

        Raises:
            Conflict: There are as many as there may be.
        """
        session = TrackerSession(
            id=secrets.token_hex(8),
            cell=cell,
            n_people=n_people,
            estimator=MultiPersonTracker(n_people, size, floor_z=floor_z),
            timeline=StampTimeline(self.clock()),
            clock=self.clock,
        )
        with self._lock:
            self._forget_idle()
            if len(self._sessions) >= MAX_SESSIONS:
                raise Conflict(
                    f"{MAX_SESSIONS} trackers are open, the most there may be: delete one, or "
                    f"wait: one that nobody uses ends after {IDLE_S:g} s"
                )
            session.used_at = self.clock()
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
            session.used_at = self.clock()
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
        now = self.clock()
        for session in list(self._sessions.values()):
            if now - session.used_at > IDLE_S:
                del self._sessions[session.id]
