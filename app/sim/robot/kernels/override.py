"""A piece of motion run slower along its own path, compiled (METHOD 2.7).

A period's piece is a path ``q(s) = q + qd s + c s^2 + d s^3``, ``0 <= s <= dt``, which the
commanded motion runs at the rate ``ds/dt = 1``. Scaled by an override ``o`` the rate falls
steadily from 1, so that the motion goes on at the speed it has, to ``o`` at the end of the
period::

    s(t) = t - k t^2/2,   rate(t) = 1 - k t,   k = (1 - o)/dt

A stop is the same clock on a straight path (``c = d = 0``) with ``k = 1/T`` and
``T = max_j |qd_j|/A_j``: all joints brake in proportion and rest together at ``q + qd T/2``.
Seen from any later moment of a stop the rest of it is again the straight stop from there.

*Limits.* ``0 <= s <= dt`` and ``rate <= 1``, so positions stay on the commanded piece and no
joint is faster than on it. Since ``rate^2 = 1 - 2 k s``, the acceleration is a parabola in s::

    q'' rate^2 - k q' = (2c - k qd) + (6d - 6 k c) s - 15 k d s^2

whose greatest value on an interval is at its ends or its vertex: exact, no sampling. A path
that already brakes as hard as it may cannot be run slower; then only the stop is left.
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel

TOLERANCE = 1e-9
"""Excess over a limit that is taken for rounding [rad, rad/s, rad/s^2]."""
LEAST_OVERRIDE = 1.0 / 16.0
"""Least override of a piece; anything slower is the stop."""
_HALVINGS = 12
"""Steps of the search for the least override that acceleration limits admit."""


@kernel(error_model="numpy")
def clock(drop: float, t: float) -> tuple[float, float]:
    """Return how far along its path a motion is [s], and its rate.

    Args:
        drop: What the rate loses per second, k above [1/s].
        t: Time since the start [s]; once at rest the motion stays there.
    """
    if drop * t >= 1.0:
        return 0.5 / drop, 0.0
    return t - 0.5 * drop * t * t, 1.0 - drop * t


@kernel(error_model="numpy")
def motion_at(
    q: Vec, qd: Vec, c: Vec, d: Vec, drop: float, t: float, q_out: Vec, qd_out: Vec
) -> None:
    """Write joints and speeds of a scaled motion at time ``t`` [s].

    Args:
        q: Joint positions at the start [rad], shape (6,).
        qd: Joint speeds at the start [rad/s], shape (6,).
        c: Second coefficients of the path [rad/s^2], shape (6,).
        d: Third coefficients of the path [rad/s^3], shape (6,).
        drop: What the rate loses per second [1/s].
        t: Time since the start [s].
        q_out: Filled with positions [rad], shape (6,).
        qd_out: Filled with speeds [rad/s], shape (6,).
    """
    s, rate = clock(drop, t)
    for j in range(q.shape[0]):
        q_out[j] = q[j] + s * (qd[j] + s * (c[j] + s * d[j]))
        qd_out[j] = rate * (qd[j] + s * (2.0 * c[j] + 3.0 * s * d[j]))


@kernel(error_model="numpy")
def acceleration_peak(qd: float, c: float, d: float, drop: float, s_end: float) -> float:
    """Return the greatest acceleration of one joint of a scaled piece [rad/s^2]."""
    a, b, e = 2.0 * c - drop * qd, 6.0 * d - 6.0 * drop * c, -15.0 * drop * d
    peak = max(abs(a), abs(a + s_end * (b + s_end * e)))
    if e != 0.0:
        vertex = -0.5 * b / e
        if 0.0 < vertex < s_end:
            peak = max(peak, abs(a + 0.5 * b * vertex))
    return peak


@kernel(error_model="numpy")
def keeps_acceleration(
    qd: Vec, c: Vec, d: Vec, qdd_max: Vec, override: float, dt: float
) -> bool:
    """Whether a piece scaled to ``override`` keeps every joint's acceleration limit."""
    drop = (1.0 - override) / dt
    s_end = 0.5 * (1.0 + override) * dt
    for j in range(qd.shape[0]):
        if not acceleration_peak(qd[j], c[j], d[j], drop, s_end) <= qdd_max[j] + TOLERANCE:
            return False
    return True


@kernel(error_model="numpy")
def lowest_override(qd: Vec, c: Vec, d: Vec, qdd_max: Vec, dt: float) -> float:
    """Return the least override, to 1/4096, that acceleration limits admit; 1 if no other."""
    if keeps_acceleration(qd, c, d, qdd_max, LEAST_OVERRIDE, dt):
        return LEAST_OVERRIDE
    low, high = LEAST_OVERRIDE, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if keeps_acceleration(qd, c, d, qdd_max, middle, dt):
            high = middle
        else:
            low = middle
    return high


@kernel(error_model="numpy")
def stop_time(qd: Vec, qdd_max: Vec) -> float:
    """Return the time a straight stop takes [s]: that of the joint that needs longest."""
    longest = 0.0
    for j in range(qd.shape[0]):
        longest = max(longest, abs(qd[j]) / qdd_max[j])
    return longest


@kernel(error_model="numpy")
def _inside(q: float, qd: float, c: float, d: float, s: float, low: float, high: float) -> bool:
    """Whether one joint is inside its limits at ``s``."""
    at = q + s * (qd + s * (c + s * d))
    return low - TOLERANCE <= at <= high + TOLERANCE


@kernel(error_model="numpy")
def _turns_inside(
    q: float, qd: float, c: float, d: float, dt: float, low: float, high: float
) -> bool:
    """Whether one joint is inside its limits wherever it turns round within the piece."""
    if d == 0.0:
        s = -0.5 * qd / c if c != 0.0 else -1.0
        return not 0.0 < s < dt or _inside(q, qd, c, d, s, low, high)
    root = c * c - 3.0 * d * qd
    if root <= 0.0:
        return True
    for sign in (-1.0, 1.0):
        s = (-c + sign * math.sqrt(root)) / (3.0 * d)
        if 0.0 < s < dt and not _inside(q, qd, c, d, s, low, high):
            return False
    return True


@kernel(error_model="numpy")
def joint_keeps_limits(
    q: float, qd: float, c: float, d: float, dt: float,
    q_min: float, q_max: float, qd_max: float, qdd_max: float,
) -> bool:  # fmt: skip
    """Whether one joint's commanded piece keeps position, speed and acceleration limits.

    Args:
        q: Position at the start [rad].
        qd: Speed at the start [rad/s].
        c: Second coefficient [rad/s^2].
        d: Third coefficient [rad/s^3].
        dt: Period [s].
        q_min: Lower position limit [rad].
        q_max: Upper position limit [rad].
        qd_max: Speed limit [rad/s].
        qdd_max: Acceleration limit [rad/s^2].
    """
    if not max(abs(2.0 * c), abs(2.0 * c + 6.0 * d * dt)) <= qdd_max + TOLERANCE:
        return False
    fastest = max(abs(qd), abs(qd + dt * (2.0 * c + 3.0 * d * dt)))
    if abs(c) < abs(3.0 * d * dt):
        fastest = max(fastest, abs(qd - c * c / (3.0 * d)))
    if not fastest <= qd_max + TOLERANCE:
        return False
    if q - fastest * dt > q_min and q + fastest * dt < q_max:
        return True
    return (
        _inside(q, qd, c, d, dt, q_min, q_max)
        and _inside(q, qd, c, d, 0.0, q_min, q_max)
        and _turns_inside(q, qd, c, d, dt, q_min, q_max)
    )
