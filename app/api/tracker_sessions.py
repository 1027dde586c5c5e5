"""Sessions of trackers: the estimators of people, kept between frames.

The number of sessions is limited, and an unused one is deleted. Each session has its own lock,
so that the frames of one camera are in order and cameras do not wait for each other.

The age of a tracker's observations counts from the arrival of its newest frame
(:mod:`app.sim.perception.stamp_timeline`), on a clock that includes the time of a suspended
machine.
"""

import secrets
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from app.errors import Conflict, NotFound
from app.sim.core.arrays import Vec
from app.sim.perception.multi_person_tracker import MultiPersonTracker, UnassignedDetection
from app.sim.perception.person_estimator import STALE_S, Flag, PersonEstimate
from app.sim.perception.stamp_timeline import StampTimeline

MAX_SESSIONS = 32
"""Largest number of trackers."""
IDLE_S = 300.0
"""Time after which an unused tracker is deleted [s]."""


def service_clock() -> float:
    """Return the time of the service's clock [s].

    It is monotonic and, on Linux, includes the time for which the machine was suspended.
    """
    if hasattr(time, "CLOCK_BOOTTIME"):
        return time.clock_gettime(time.CLOCK_BOOTTIME)
    return time.monotonic()


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackedPeople:
    """State of a tracker's people at one time."""

    t: float | None
    """The time, on the tracker's clock [s]; None before the first frame."""
    estimates: tuple[PersonEstimate, ...]
    """Estimate of each track, predicted for the time."""
    observed: tuple[PersonEstimate | None, ...]
    """Estimate of each track at the last frame with its person; None without such a frame."""
    observed_age_s: tuple[float, ...]
    """Age of each observation; without one, the time since the newest frame, or since the
    tracker was opened [s]."""
    unassigned: tuple[UnassignedDetection, ...]
    """People of the newest frame without a track, nearest first."""


@dataclass(slots=True, kw_only=True)
class TrackerSession:
    """One tracker with the estimator of its people."""

    id: str
    """Its id in URLs."""
    cell: str
    """Name of its work cell."""
    n_people: int
    """Largest number of tracks."""
    estimator: MultiPersonTracker
    """Estimates its people, on the timeline."""
    timeline: StampTimeline
    """Maps its stamps to time."""
    clock: Callable[[], float]
    """The service's clock [s]."""
    n_frames: int = 0
    """Number of accepted frames."""
    used_at: float = 0.0
    """Time of the last use, on the service's clock [s]."""
    lock: threading.Lock = field(default_factory=threading.Lock)
    """Held while its estimator works."""

    @property
    def t(self) -> float | None:
        """Stamp of its newest frame [s]; None before the first."""
        return self.timeline.stamp

    def take(
        self, t: float, arrived: float, people: Sequence[Vec], confidences: Sequence[Vec]
    ) -> TrackedPeople:
        """Update the estimates with a frame and return them for its time.

        Args:
            t: Stamp of the frame, tracker's clock [s].
            arrived: Time of its arrival, service's clock [s].
            people: Key-points of each person [m], shape (25, 3) each, NaN where missing.
            confidences: Confidence of each key-point, shape (25,) each.

        Raises:
            ClockJump: ``t`` does not continue the frames before; the frame is refused.
            InvalidInput: See :meth:`MultiPersonTracker.update`; the frame is refused.
        """
        with self.lock:
            at = self.timeline.offer(t, arrived)
            estimates = self.estimator.update(at, people, confidences)
            self.timeline.accept(t, at, arrived)
            self.n_frames += 1
            return self._tracked(estimates, 0.0)

    def since_frame_s(self) -> float:
        """Return the time since its newest frame, or since it was opened without one [s]."""
        return self.timeline.ahead(self.clock())

    def people(self, t: float | None = None) -> TrackedPeople:
        """Return the estimates for the present.

        Args:
            t: Present on the tracker's clock [s]; used where it gives a greater age than the
                arrival of the newest frame.
        """
        with self.lock:
            since = self.timeline.ahead(self.clock(), t)
            return self._tracked(self.estimator.at((self.timeline.time or 0.0) + since), since)

    def _tracked(
        self, estimates: tuple[PersonEstimate, ...], since_frame_s: float
    ) -> TrackedPeople:
        """Return the state at a time after the newest frame."""
        newest, observed = self.timeline.stamp, tuple(self.estimator.observed)
        at = (self.timeline.time or 0.0) + since_frame_s
        ages = [
            since_frame_s if one is None else at - one.t + one.carried_s for one in observed
        ]
        return TrackedPeople(
            t=None if newest is None else newest + since_frame_s,
            estimates=self._flagged(estimates, since_frame_s),
            observed=observed,
            observed_age_s=tuple(ages),
            unassigned=self.estimator.unassigned,
        )

    def _flagged(
        self, estimates: tuple[PersonEstimate, ...], since_frame_s: float
    ) -> tuple[PersonEstimate, ...]:
        """Return estimates with flags for a silent tracker and a jump of its clock.

        The absence of a person is only known while frames arrive.
        """
        added: list[Flag] = []
        if self.timeline.out_of_step or self.timeline.jumped:
            added.append("clock-jump")
        silent = since_frame_s > STALE_S
        if self.timeline.out_of_step or self.timeline.stamp is None or silent:
            added.append("stale")
        if not added:
            return estimates
        return tuple(
            replace(one, flags=tuple(dict.fromkeys((*one.flags, *added)))) for one in estimates
        )


class TrackerSessions:
    """The open sessions; safe to use from any thread.

    Args:
        clock: Returns the time [s]; must be monotonic.
    """

    def __init__(self, clock: Callable[[], float] = service_clock) -> None:
        self.clock = clock
        self._lock = threading.Lock()
        self._sessions: dict[str, TrackerSession] = {}

    def open(self, cell: str, n_people: int, size: Vec, floor_z: float) -> TrackerSession:
        """Return a new session.

        Args:
            n_people: Largest number of tracks.
            size: Body lengths [m], shape (12,).
            floor_z: Height of the cell's floor [m].

        Raises:
            Conflict: The limit is reached.
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
                    f"{MAX_SESSIONS} trackers are open, the limit: delete one, or wait; an "
                    f"unused one is deleted after {IDLE_S:g} s"
                )
            session.used_at = self.clock()
            self._sessions[session.id] = session
        return session

    def get(self, session_id: str) -> TrackerSession:
        """Return a session and count it as used.

        Raises:
            NotFound: There is no such session, or it was deleted as unused.
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
