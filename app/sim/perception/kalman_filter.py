"""Kalman filters of points with latency, noise and missing measurements.

Per point and axis the state is position and speed. The speed decays with a time constant, so
that an unseen point comes to rest, and is driven by white acceleration:

    p' = p + tau (1 - e) v,   v' = e v,   e = exp(-dt / tau),
    Q = a^2 [dt^4/4, dt^3/2; dt^3/2, dt^2].

The three axes of a point share one covariance. Gating rejects a measurement farther from the
prediction than ``GATE + MAX_SPEED dt``, with dt since the last measurement: the point then
counts as unseen, and restarts after the hold time.

Source: Bar-Shalom et al., Estimation with Applications to Tracking and Navigation (2001),
ch. 6; Singer (1970) for the decay, here of the speed.
"""

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec

NOISE = 0.02
"""Standard deviation of a measurement at confidence 1, per axis [m]."""
ACCELERATION = 2.5
"""Standard deviation of the driving acceleration, per axis [m/s^2]."""
MEMORY_S = 0.4
"""Time constant tau of the speed [s]."""
HOLD_S = 0.5
"""Time for which an unseen point is predicted [s]."""
GATE = 0.2
"""Distance from the prediction at which a measurement is rejected, without delay [m]."""
MAX_SPEED = 4.0
"""Speed that widens the gate with the time since the point was seen [m/s]."""


class PointFilter:
    """Filters of ``n`` points."""

    def __init__(self, n: int) -> None:
        self.t = -np.inf
        """Time of the last update [s]."""
        self.seen_at = np.full(n, -np.inf)
        """Time of the last measurement of each point [s], shape (n,)."""
        self._measured_at = np.full(n, -np.inf)
        self._p, self._v = np.full((n, 3), np.nan), np.zeros((n, 3))
        self._cov = np.zeros((n, 3))  # position, position-speed, speed

    def known(self, t: float) -> NDArray[np.bool_]:
        """Return whether points were measured within the hold time before ``t`` [s], (n,)."""
        return np.asarray(t - self.seen_at <= HOLD_S + 1e-9)

    def at(self, t: float) -> tuple[Vec, Vec]:
        """Return positions [m] and speeds [m/s] at ``t``, (n, 3) each; NaN where not known."""
        known = self.known(t)[:, None]
        if not known.any():
            return np.full_like(self._p, np.nan), np.full_like(self._p, np.nan)
        e, b = self._step(t)
        p, v = self._p + b * self._v, e * self._v
        return np.where(known, p, np.nan), np.where(known, v, np.nan)

    def _step(self, t: float) -> tuple[float, float]:
        e = float(np.exp(-max(t - self.t, 0.0) / MEMORY_S))
        return e, MEMORY_S * (1.0 - e)

    def gate(self, t: float, points: Vec) -> NDArray[np.bool_]:
        """Return whether measurements are too far from the prediction, shape (n,).

        The gate widens while a point is unseen, but not while its measurements are rejected.

        Args:
            t: Time [s].
            points: Measurements [m], shape (n, 3), NaN where missing.
        """
        away = np.linalg.norm(points - self.at(t)[0], axis=1)
        with np.errstate(invalid="ignore"):
            since = t - np.maximum(self._measured_at, self.seen_at)
            too_far = np.asarray(away > GATE + MAX_SPEED * since)
        self._measured_at[np.isfinite(points).all(axis=1)] = t
        return too_far

    def update(self, t: float, points: Vec, confidences: Vec) -> None:
        """Update with one frame.

        Args:
            t: Time of the frame [s], later than the last.
            points: Measurements [m], shape (n, 3), NaN where missing.
            confidences: Confidences in [0, 1], shape (n,); their squares divide the variance.
        """
        known = self.known(t)
        if known.any():
            self._predict(t)
        seen = np.isfinite(points).all(axis=1) & (confidences > 0.0)
        variance = (NOISE / np.maximum(confidences, 1e-3)) ** 2
        fresh = seen & ~known
        self._p[fresh], self._v[fresh] = points[fresh], 0.0
        self._cov[fresh], self._cov[fresh, 0] = (0.0, 0.0, 1.0), variance[fresh]
        more = seen & known
        pp, pv, vv = self._cov[more].T
        total = pp + variance[more]
        gain, gain_speed = pp / total, pv / total
        miss = points[more] - self._p[more]
        self._p[more] += gain[:, None] * miss
        self._v[more] += gain_speed[:, None] * miss
        self._cov[more] = np.column_stack(
            [(1.0 - gain) * pp, (1.0 - gain) * pv, vv - gain_speed * pv]
        )
        self.seen_at[seen], self.t = t, t

    def forget(self, members: list[int]) -> None:
        """Mark some points as never seen."""
        self.seen_at[members] = -np.inf

    def _predict(self, t: float) -> None:
        e, b = self._step(t)
        dt, a2 = t - self.t, ACCELERATION**2
        pp, pv, vv = self._cov.T
        self._p += b * self._v
        self._v *= e
        self._cov = np.column_stack(
            [
                pp + 2.0 * b * pv + b * b * vv + a2 * dt**4 / 4.0,
                e * (pv + b * vv) + a2 * dt**3 / 2.0,
                e * e * vv + a2 * dt**2,
            ]
        )
