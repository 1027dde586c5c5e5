"""Monotonic timeline of a tracker's frames from their stamps and arrivals.

A tracker stamps frames by its own clock, which may be set, restart or send wrong values.
:class:`StampTimeline` maps stamps to a time that never decreases, under two rules:

- A frame continues the previous one if its stamp is later, by at most ``AHEAD_S`` more than the
  time between their arrivals. Other stamps are rejected, as the frame may be an old one that
  was delivered late. After ``N_RESYNC`` such frames in a row that continue each other, the
  clock has changed and the timeline continues with the new stamps.
- The time of the last detection of people is known from the arrival of that frame. A time from
  the caller can make them older, never younger.

Delays before the arrival belong to ``tracker_delay`` of the safety settings.
"""

import math

from app.errors import ClockJump

AHEAD_S = 2.0
"""How much more than the time between two arrivals the time between their stamps may be [s]:
a frame that was delayed, or a recording that is sent faster than it was made."""
N_RESYNC = 3
"""Frames in a row, consistent with each other, after which a changed clock is accepted."""


def _continues(stamp: float, now: float, before: tuple[float, float]) -> bool:
    """Whether a stamp is later than another one, given as stamp and arrival, and plausible."""
    return 0.0 < stamp - before[0] <= now - before[1] + AHEAD_S


class StampTimeline:
    """The timeline of one tracker; not thread-safe.

    Args:
        now: When the tracker was opened, on the service's clock [s].
    """

    def __init__(self, now: float) -> None:
        self.arrived = now
        """When the newest frame arrived, or the tracker was opened, service's clock [s]."""
        self.time: float | None = None
        """Time of the newest frame on this timeline [s]; None before the first."""
        self.stamp: float | None = None
        """Stamp of the newest frame, tracker's clock [s]; None before the first."""
        self.jumped = False
        """Whether the newest frame was the first one after a change of the clock."""
        self._pending: list[tuple[float, float]] = []

    @property
    def out_of_step(self) -> bool:
        """Whether frames have arrived since the newest one whose stamps do not continue it."""
        return bool(self._pending)

    def offer(self, stamp: float, now: float) -> float:
        """Return the time of a frame on this timeline [s], later than that of the newest.

        Args:
            stamp: When the frame was taken, tracker's clock [s]; finite.
            now: When it arrived, service's clock [s].

        Raises:
            ClockJump: The stamp does not continue the frames before; nothing may be taken.
        """
        if self.time is None or self.stamp is None:
            return stamp
        if _continues(stamp, now, (self.stamp, self.arrived)):
            return self.time + (stamp - self.stamp)
        if not (self._pending and _continues(stamp, now, self._pending[-1])):
            self._pending.clear()
        self._pending.append((stamp, now))
        if len(self._pending) < N_RESYNC:
            silence = now - self.arrived
            raise ClockJump(stamp, self.stamp, silence, len(self._pending), N_RESYNC)
        later = math.nextafter(self.time, math.inf)
        return max(later, self.time + (now - self.arrived))

    def accept(self, stamp: float, time: float, now: float) -> None:
        """Make a frame the newest one.

        Args:
            stamp: As offered [s].
            time: Time returned by :meth:`offer` [s].
            now: As offered [s].
        """
        self.jumped = len(self._pending) >= N_RESYNC
        self._pending.clear()
        self.stamp, self.time, self.arrived = stamp, time, now

    def ahead(self, now: float, stamp: float | None = None) -> float:
        """Return the time since the newest frame [s], at least 0.

        Args:
            now: Present time, service's clock [s].
            stamp: Present time, tracker's clock [s]; it counts if it is later. None: unknown.
        """
        known = max(0.0, now - self.arrived)
        if stamp is None or self.stamp is None:
            return known
        return max(known, stamp - self.stamp)
