"""Trajectory of one period executed at reduced speed along its own path, compiled.

The commanded trajectory of a period is a path ``q(s) = q + qd s + c s^2 + d s^3``,
``0 <= s <= dt``, executed at the path speed ``ds/dt = 1`` (docs/method.md 2.7). Scaled by an
override ``o`` the path speed decreases linearly from 1, the current speed, to ``o`` at the end
of the period::

    s(t) = t - k t^2/2,   s'(t) = 1 - k t,   k = (1 - o)/dt

A stop has the same time law on a straight path (``c = d = 0``) with ``k = 1/T`` and
``T = max_j |qd_j|/A_j``: all joints brake in proportion and come to rest together at
``q + qd T/2``. The remainder of a stop is, from any later moment, the straight stop from there.

*Limits.* ``0 <= s <= dt`` and ``s' <= 1``, so positions stay on the commanded path and no joint
is faster than commanded. Since ``s'^2 = 1 - 2 k s``, the acceleration is a parabola in s::

    q'' s'^2 - k q' = (2c - k qd) + (6d - 6 k c) s - 15 k d s^2

whose greatest absolute value on an interval is at its ends or its vertex: exact, no sampling. A
path that already brakes at the acceleration limit cannot be scaled; only the stop is left.
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.robot.kernels.joints import JointLimits, JointPath

TOLERANCE = 1e-9
"""Excess over a limit that counts as rounding [rad, rad/s, rad/s^2]."""
LEAST_OVERRIDE = 1.0 / 16.0
"""Least override of a trajectory; anything slower is the stop."""
_HALVINGS = 12
"""Steps of the search for the least override that acceleration limits admit."""


@kernel(error_model="numpy")
def path_parameter(deceleration: float, t: float) -> tuple[float, float]:
    """Return path parameter s [s] and path speed s' at a time.

    Args:
        deceleration: Decrease of the path speed, k above [1/s].
        t: Time since the start [s]; the motion stays at rest once it has stopped.
    """
    if deceleration * t >= 1.0:
        return 0.5 / deceleration, 0.0
    return t - 0.5 * deceleration * t * t, 1.0 - deceleration * t


@kernel(error_model="numpy")
def motion_at(path: JointPath, deceleration: float, t: float, q_out: Vec, qd_out: Vec) -> None:
    """Write joint positions and speeds of a scaled motion at a time.

    Args:
        deceleration: Decrease of the path speed [1/s].
        t: Time since the start [s].
        q_out: Filled with positions [rad], shape (6,).
        qd_out: Filled with speeds [rad/s], shape (6,).
    """
    s, speed = path_parameter(deceleration, t)
    q, qd, c, d = path
    for j in range(q.shape[0]):
        q_out[j] = q[j] + s * (qd[j] + s * (c[j] + s * d[j]))
        qd_out[j] = speed * (qd[j] + s * (2.0 * c[j] + 3.0 * s * d[j]))


@kernel(error_model="numpy")
def acceleration_peak(
    qd: float, c: float, d: float, deceleration: float, s_end: float
) -> float:
    """Return the greatest acceleration of one joint of a scaled path [rad/s^2]."""
    a, b = 2.0 * c - deceleration * qd, 6.0 * d - 6.0 * deceleration * c
    e = -15.0 * deceleration * d
    peak = max(abs(a), abs(a + s_end * (b + s_end * e)))
    if e != 0.0:
        vertex = -0.5 * b / e
        if 0.0 < vertex < s_end:
            peak = max(peak, abs(a + 0.5 * b * vertex))
    return peak


@kernel(error_model="numpy")
def keeps_acceleration(path: JointPath, qdd_max: Vec, override: float, dt: float) -> bool:
    """Return whether a path scaled to ``override`` keeps all acceleration limits."""
    deceleration = (1.0 - override) / dt
    s_end = 0.5 * (1.0 + override) * dt
    for j in range(path.qd.shape[0]):
        peak = acceleration_peak(path.qd[j], path.c[j], path.d[j], deceleration, s_end)
        if not peak <= qdd_max[j] + TOLERANCE:
            return False
    return True


@kernel(error_model="numpy")
def lowest_override(path: JointPath, qdd_max: Vec, dt: float) -> float:
    """Return the least override, to 1/4096, that acceleration limits admit; 1 if no other."""
    if keeps_acceleration(path, qdd_max, LEAST_OVERRIDE, dt):
        return LEAST_OVERRIDE
    low, high = LEAST_OVERRIDE, 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if keeps_acceleration(path, qdd_max, middle, dt):
            high = middle
        else:
            low = middle
    return high


@kernel(error_model="numpy")
def stop_time(qd: Vec, qdd_max: Vec) -> float:
    """Return the duration of a straight stop [s]: that of the joint that needs longest."""
    longest = 0.0
    for j in range(qd.shape[0]):
        longest = max(longest, abs(qd[j]) / qdd_max[j])
    return longest


@kernel(error_model="numpy")
def _inside(q: float, qd: float, c: float, d: float, s: float, low: float, high: float) -> bool:
    """Return whether one joint is inside its limits at ``s``."""
    at = q + s * (qd + s * (c + s * d))
    return low - TOLERANCE <= at <= high + TOLERANCE


@kernel(error_model="numpy")
def _turns_inside(
    q: float, qd: float, c: float, d: float, dt: float, low: float, high: float
) -> bool:
    """Return whether one joint is inside its limits where it reverses within the period."""
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
def joint_keeps_limits(j: int, path: JointPath, limits: JointLimits, dt: float) -> bool:
    """Return whether joint ``j`` keeps position, speed and acceleration limits on a path."""
    q, qd, c, d = path.q[j], path.qd[j], path.c[j], path.d[j]
    low, high = limits.q_min[j], limits.q_max[j]
    if not max(abs(2.0 * c), abs(2.0 * c + 6.0 * d * dt)) <= limits.qdd_max[j] + TOLERANCE:
        return False
    fastest = max(abs(qd), abs(qd + dt * (2.0 * c + 3.0 * d * dt)))
    if c * d < 0.0 and abs(c) < abs(3.0 * d * dt):  # the speed turns inside the segment
        fastest = max(fastest, abs(qd - c * c / (3.0 * d)))
    if not fastest <= limits.qd_max[j] + TOLERANCE:
        return False
    if q - fastest * dt > low and q + fastest * dt < high:
        return True
    return (
        _inside(q, qd, c, d, dt, low, high)
        and _inside(q, qd, c, d, 0.0, low, high)
        and _turns_inside(q, qd, c, d, dt, low, high)
    )


@kernel(error_model="numpy")
def keeps_limits(path: JointPath, limits: JointLimits, dt: float) -> bool:
    """Return whether all joints keep position, speed and acceleration limits on a path."""
    for j in range(6):
        if not joint_keeps_limits(j, path, limits, dt):
            return False
    return True
