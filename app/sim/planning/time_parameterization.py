"""Time parameterization of a path of straight joint motions, in polynomial segments.

The time law is linear segments with parabolic blends (Craig, *Introduction to Robotics*,
section 7.3; LSPB) on the grid of the control period ``dt``: along segment i all joints move at
constant speed ``v_i = D_i / T_i``; about corner i the speeds change evenly from ``v_{i-1}`` to
``v_i`` during ``b_i`` whole periods; the constant part lasts ``m_i`` whole periods, so that
``T_i = (m_i + (b_i + b_{i+1}) / 2) dt``. Every period is therefore one polynomial of degree 2,
a bounded action (docs/method.md 2.2) like those of a policy. The ``b_i`` are the least with

    |v_i| <= qd_max   and   |v_i - v_{i-1}| <= qdd_max b_i dt   for every joint,

found by lengthening the blends that are too short. A blend leaves the path near its corner by
at most ``|v_i - v_{i-1}| b_i dt / 8``; if that is in contact, the motion stops at the corner. A
robot in motion begins with a blend: the first corner is the end of its straight stop. The less
deceleration the stop leaves for turning, the slower the first segment must be; where it alone
would take longer than to stop and start again, the robot stops first.

The result is not time-optimal: speeds are constant along a segment and durations whole periods,
which costs little on straight lines between few corners. TOPP-RA (toppra 0.6.10) has wheels for
x86-64 Linux only, requires Matplotlib, and keeps limits only at its grid points.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from app.errors import InvalidInput
from app.sim.collision.checker import Checker
from app.sim.core.arrays import Vec
from app.sim.robot.kernels.arm import Arm

SAME = 1e-9
"""Corners nearer than this are one [rad]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TimedPath:
    """A path in time: n periods, each a polynomial of degree 2 between its knots."""

    dt: float
    """Control period [s]."""
    q: Vec
    """Joint positions at the knots [rad], shape (n + 1, 6)."""
    qd: Vec
    """Joint speeds at the knots [rad/s], shape (n + 1, 6); the last are 0."""
    corner_rad: float
    """Largest distance of the motion from the path at corners, per joint [rad]."""

    @property
    def n_periods(self) -> int:
        """Number of periods."""
        return len(self.q) - 1

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return self.n_periods * self.dt

    def at(self, t: float) -> tuple[Vec, Vec]:
        """Return positions [rad] and speeds [rad/s] at time ``t`` [s], shape (6,) each.

        They are held beyond the ends.
        """
        if t >= self.duration:
            return self.q[-1], self.qd[-1]
        k = min(max(0, int(t / self.dt)), self.n_periods - 1)
        x = max(0.0, t - k * self.dt)
        double_c = (self.qd[k + 1] - self.qd[k]) / self.dt
        speed = self.qd[k] + double_c * x
        return self.q[k] + 0.5 * (self.qd[k] + speed) * x, speed


class Blends(NamedTuple):
    """Blends of a path of n segments."""

    periods: list[int]
    """Periods of the blend about each corner, n + 1."""
    speeds: Vec
    """Joint speeds after each corner [rad/s], shape (n + 1, 6)."""
    cruise: list[int]
    """Periods at these speeds, n + 1."""


def stop_periods(qd: Vec, arm: Arm) -> int:
    """Return the number of periods of a straight stop from speeds [rad/s], shape (6,).

    All joints slow down evenly and come to rest together.
    """
    return math.ceil(float(np.max(np.abs(qd) / (arm.limits.qdd_max * arm.dt))) - 1e-9)


def stopping_point(q: Vec, qd: Vec, arm: Arm) -> Vec:
    """Return the end of a straight stop from ``q`` [rad] and ``qd`` [rad/s] [rad], (6,)."""
    return np.asarray(q + 0.5 * stop_periods(qd, arm) * arm.dt * qd)


def time_path(
    path: Vec, arm: Arm, qd0: Vec | None = None, stops: frozenset[int] = frozenset()
) -> TimedPath:
    """Time a path within the arm's limits, from a state in motion or at rest to rest.

    Args:
        path: Configurations joined by straight motions [rad], shape (n, 6), n >= 1. For a
            start in motion the first one is :func:`stopping_point`.
        qd0: Joint speeds at the start [rad/s], shape (6,), inside the limits; at rest if None.
        stops: Corners (places in ``path``) to stop at; 0 means to brake before anything else,
            as it also does where turning at once would take longer.

    Raises:
        InvalidInput: The path is empty, or a number is NaN or infinite.
    """
    path = np.array(path, dtype=np.float64)
    if path.ndim != 2 or path.shape[1:] != (6,) or len(path) == 0:
        raise InvalidInput("path", path.shape, "must have shape (n, 6), n >= 1")
    qd0 = np.zeros(6) if qd0 is None else np.array(qd0, dtype=np.float64)
    if not (np.isfinite(path).all() and np.isfinite(qd0).all()):
        raise InvalidInput("path, qd0", [path.tolist(), qd0.tolist()], "must be finite")
    corners = [k for k in sorted(stops) if (0 if qd0.any() else 1) <= k < len(path) - 1]
    runs: list[TimedPath] = []
    for first, last in zip([0, *corners], [*corners, len(path) - 1], strict=True):
        runs += _runs(path[first : last + 1], arm, np.zeros(6) if runs else qd0)
    return TimedPath(
        dt=arm.dt,
        q=np.vstack([*(run.q[:-1] for run in runs[:-1]), runs[-1].q]),
        qd=np.vstack([*(run.qd[:-1] for run in runs[:-1]), runs[-1].qd]),
        corner_rad=max(run.corner_rad for run in runs),
    )


def time_free_path(checker: Checker, path: Vec, qd0: Vec | None = None) -> TimedPath | None:
    """Time a path so that the timed motion is free too, stopping at corners where it must.

    Args:
        checker: Arm, people and margins.
        path: A free path; see :func:`time_path`.
        qd0: Joint speeds at the start [rad/s], shape (6,); at rest if None.

    Returns:
        The shorter of the motions that turn at once and that brake first; None where even the
        straight stop is in contact.
    """
    moving = qd0 is not None and bool(np.any(qd0))
    best: TimedPath | None = None
    for first in (frozenset[int](), frozenset({0})) if moving else (frozenset[int](),):
        stops = first
        while True:
            timed = time_path(path, checker.arm, qd0, stops)
            k = checker.first_blocked(timed.q, timed.qd)
            if k == timed.n_periods:
                break
            nearest = int(np.argmin(np.abs(path - timed.q[k]).max(axis=1)))
            if nearest in stops or not 0 < nearest < len(path) - 1:
                break
            stops |= {nearest}
        if k == timed.n_periods and (best is None or timed.n_periods < best.n_periods):
            best = timed
    return best


def _runs(path: Vec, arm: Arm, qd0: Vec) -> list[TimedPath]:
    """Time a path without stops between its ends, or with one at the start."""
    apart = np.abs(np.diff(path, axis=0)).max(axis=1) > SAME
    path = np.vstack([path[:1], path[1:][apart]])
    segments = np.diff(path, axis=0)
    blends = _blends(segments, arm, qd0)
    if blends is not None:
        return [_run(path, arm, qd0, blends)]
    return [*_runs(path[:1], arm, qd0), *_runs(path, arm, np.zeros(6))]


def _run(path: Vec, arm: Arm, qd0: Vec, found: Blends) -> TimedPath:
    """Return the knots of a path with its blends."""
    blends, speeds, cruise = found
    q, qd = [path[0] - 0.5 * blends[0] * arm.dt * qd0], [qd0]
    corner = 0.0
    for i, corner_q in enumerate(path):
        before, after = (qd0 if i == 0 else speeds[i - 1]), speeds[i]
        reach = blends[i] * arm.dt
        for k in range(1, blends[i] + 1):
            x = k * arm.dt
            turn = (after - before) * (x * x / (2.0 * reach))
            q.append(corner_q + before * (x - 0.5 * reach) + turn)
            qd.append(before + (after - before) * (k / blends[i]))
        for k in range(1, cruise[i] + 1):
            q.append(corner_q + after * (0.5 * reach + k * arm.dt))
            qd.append(after)
        if 0 < i < len(path) - 1:
            corner = max(corner, float(np.abs(after - before).max()) * reach / 8.0)
    q[-1], qd[-1] = path[-1].copy(), np.zeros(6)
    return TimedPath(dt=arm.dt, q=np.array(q), qd=np.array(qd), corner_rad=corner)


def _blends(segments: Vec, arm: Arm, qd0: Vec) -> Blends | None:
    """Return the blends of a path.

    Args:
        segments: The segments [rad], shape (n, 6).
        qd0: Joint speeds before the first corner [rad/s], shape (6,).

    Returns:
        None where the first segment would take longer than a stop and the path from rest.
    """
    n, dt = len(segments), arm.dt
    least = np.max(np.abs(segments) / arm.limits.qd_max, axis=1, initial=0.0) / dt
    moving = stop_periods(qd0, arm)
    blends = np.array([moving if moving > 0 else min(n, 1), *[1] * n], dtype=np.float64)
    speeds, longest = np.zeros((n + 1, 6)), math.inf
    while True:
        ends = 0.5 * (blends[:-1] + blends[1:])
        cruise = np.maximum(0.0, np.ceil(least - ends - 1e-9))
        if n:
            speeds[:n] = segments / ((cruise + ends) * dt)[:, None]
        turns = np.diff(speeds, axis=0, prepend=qd0[None])
        short = np.max(np.abs(turns) / (arm.limits.qdd_max * dt), axis=1) - 1e-9 > blends
        if not short.any():
            break
        if moving > 0 and short[0]:  # where its corner lies fixes the first blend: go slower
            if longest == math.inf:
                longest = moving + _periods_from_rest(segments, arm)
            if cruise[0] > longest:
                return None
            least[0] = cruise[0] + ends[0] + 1.0
            short[0] = False
        blends[short] += 1.0
    return Blends([int(b) for b in blends], speeds, [*(int(m) for m in cruise), 0])


def _periods_from_rest(segments: Vec, arm: Arm) -> int:
    """Return the number of periods that a path takes from rest to rest."""
    found = _blends(segments, arm, np.zeros(6))
    assert found is not None  # only a start in motion slows the first segment down
    return sum(found.periods) + sum(found.cruise)
