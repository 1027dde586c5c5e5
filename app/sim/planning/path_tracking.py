"""Path following: tracks a timed path from the robot's actual position, period by period.

Without a safety layer, the target speeds of each period are those of the next knot, and the
motion is the timed path to rounding. A safety layer may scale a period or stop (docs/method.md
2.7); the follower then finds the robot's place on the path and continues from there at the
greatest rate ``o`` in [0, 1] of the path's own speed that the acceleration limits allow:

    qd_wanted = o' p'(s') + GAIN (p(s') - q - (qd + o' p'(s')) dt / 2) / dt,
    s' = s + (o + o') dt / 2,

with ``o`` the current rate. A timed path can be followed at any rate below 1, since speeds
scale with o and accelerations with o^2; the second term corrects the error of a period that
spans two segments, a few milliradians at most. The bounded actions
(``robot/kernels/acceleration_bounds.py``) keep the limits in any case.
"""

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.planning.time_parameterization import TimedPath, stop_periods
from app.sim.robot.kernels.arm import Arm

GAIN = 0.3
"""Share of the position error that is corrected per period; ours."""
RATES = np.linspace(0.0, 1.0, 41)
"""Rates tried."""
ON_PLAN = 1e-7
"""Differences in position [rad] and speed [rad/s] below which the robot is at a knot."""


class PathFollower:
    """The follower of one timed path."""

    def __init__(self, timed: TimedPath, arm: Arm) -> None:
        self.timed, self._limits = timed, arm.limits
        self.place = 0.0
        """Place of the robot on the path, as the path's own time [s]."""
        self._expected = 0.0
        self.error_rad = 0.0
        """Distance of the robot from the path, greatest joint [rad]."""

    @property
    def remaining(self) -> float:
        """Rest of the path, in its own time [s]."""
        return max(0.0, self.timed.duration - self.place)

    @property
    def period(self) -> int:
        """Period of the path at the robot's place."""
        return min(int(self.place / self.timed.dt + 1e-6), self.timed.n_periods)

    def locate(self, q: Vec) -> None:
        """Find the place of joint positions ``q`` [rad], shape (6,), on the path.

        It is at most one period after the last place.
        """
        at = np.abs(q - self.timed.at(self._expected)[0]).max()
        if at <= ON_PLAN:
            self.place, self.error_rad = self._expected, float(at)
            return
        low, high = self.place, min(self.place + self.timed.dt, self.timed.duration)
        for _ in range(3):
            times = np.linspace(low, high, 11)
            misses = [float(np.linalg.norm(q - self.timed.at(t)[0])) for t in times]
            k = int(np.argmin(misses))
            low, high = times[max(k - 1, 0)], times[min(k + 1, 10)]
        self.place = float(times[k])
        self.error_rad = float(np.abs(q - self.timed.at(self.place)[0]).max())

    def target_speeds(self, q: Vec, qd: Vec, brake: bool = False) -> Vec:
        """Return the target joint speeds after this period [rad/s], shape (6,).

        Args:
            q: Joint positions [rad], shape (6,), as given to :meth:`locate`.
            qd: Joint speeds [rad/s], shape (6,).
            brake: Whether to come to rest along the path as soon as the limits allow.
        """
        timed, dt = self.timed, self.timed.dt
        k = round(self.place / dt)
        exact = abs(self.place - k * dt) <= 1e-9 and self.error_rad <= ON_PLAN
        if exact and not brake and k < timed.n_periods:
            if np.abs(qd - timed.qd[k]).max() <= ON_PLAN:
                self._expected = (k + 1) * dt
                return np.array(timed.qd[k + 1])
        rate = self._rate(qd, brake)
        options, ends = [], []
        for after in RATES if brake else RATES[::-1]:
            end = min(self.place + 0.5 * (rate + after) * dt, timed.duration)
            point, speed = timed.at(end)
            speed = after * speed
            miss = point - q - 0.5 * (qd + speed) * dt
            options.append(speed + GAIN * miss / dt)
            ends.append(end)
        wanted = np.array(options)
        excess = np.maximum(
            np.max(np.abs(wanted - qd) / (self._limits.qdd_max * dt), axis=1),
            np.max(np.abs(wanted) / self._limits.qd_max, axis=1),
        )
        fits = np.flatnonzero(excess <= 1.0 + 1e-9)
        choice = int(fits[0]) if len(fits) else int(np.argmin(excess))
        self._expected = ends[choice]
        return np.asarray(wanted[choice])

    def _rate(self, qd: Vec, brake: bool) -> float:
        """Return the robot's speed along the path relative to the path's own."""
        speed = self.timed.at(self.place)[1]
        square = float(speed @ speed)
        if square < 1e-12:
            return 0.0 if brake else 1.0
        return min(1.0, max(0.0, float(speed @ qd) / square))


def straight_stop(qd: Vec, arm: Arm) -> Vec:
    """Return the joint speeds after one period of a straight stop [rad/s], shape (6,)."""
    n = stop_periods(qd, arm)
    return np.asarray(qd * (1.0 - 1.0 / n)) if n > 1 else np.zeros(6)
