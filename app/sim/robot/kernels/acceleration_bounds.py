"""Bounds of quadratic joint trajectories for one control period, compiled.

During one period of length ``dt`` a joint follows ``q(x) = q + qd x + c x^2`` (docs/method.md
2.2). The admissible coefficients are an interval ``[c_min, c_max]``: ``c_max`` is the least of
the upper bounds, ``c_min`` the greatest of the lower ones. With the acceleration limit ``A``,
the speed limit ``V`` and the limits ``q_min, q_max``:

*Both variants*::

    |c| <= A/2                                         acceleration, constant in the period
    (-V - qd)/(2 dt) <= c <= (V - qd)/(2 dt)           speed at the end, linear in between

*Viable* (ours, the default): full braking after the period still stops the joint in time. With
the state ``q', v'`` after the period, ``v'^2/(2A) + v' dt/2 <= q_max - q'`` for ``v' >= 0``,
mirrored below. With ``v' = qd + 2 c dt`` and ``q' = q + (qd + v') dt/2`` this is a quadratic in
``v'``::

    v'_max = -A dt + sqrt((A dt)^2 + 2 A (q_max - q) - A dt qd)
    c <= (v'_max - qd)/(2 dt)

and mirrored, with ``q - q_min`` and ``-qd`` in place of ``q_max - q`` and ``qd``.

Full braking from a viable state satisfies these bounds, so the interval is never empty and no
limit is ever exceeded, also inside the period: a joint that reverses inside a period covers
less than ``qd dt/2`` beyond ``q``, which viability keeps free.

*One-step* (the thesis'): only the limits of this period::

    c <= (q_max - qd dt - q)/dt^2                      position at the end, or in its place
    c <= -qd^2/(4 (q_max - q))                         at the turning point x* = -qd/(2c),
                                                       where q_max - q < qd dt/2 and qd > 0
    c >= (q_min - qd dt - q)/dt^2                      mirrored
    c >= qd^2/(4 (q - q_min))                          where q - q_min < -qd dt/2 and qd < 0

The interval may be empty one period later: a joint at full speed close to its limit cannot
stop any more. The thesis ends such an episode as *unfeasible*.

Source: thesis eq. (4.17)-(4.23).
Deviates: misprints are corrected (docs/method.md 5); the tests show that limits are exceeded
otherwise. At the turning point (4.17), (4.21) and (4.22) have the numerator ``q^2 - 2 qd^2`` in
place of ``-qd^2``, and take the upper bound for a lower one and the reverse. (4.22) swaps max
and min and drops the condition of the turning point.
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.robot.kernels.joints import AxisLimits, JointLimits, JointState


@kernel(error_model="numpy")
def greatest_end_speed(clearance: float, qd: float, acc: float, dt: float) -> float:
    """Return the greatest speed toward a limit that is viable after one period [rad/s].

    Args:
        clearance: Distance to the limit [rad].
        qd: Speed toward the limit now [rad/s].
        acc: Acceleration limit [rad/s^2].
        dt: Period [s].
    """
    root = acc * dt * acc * dt + 2.0 * acc * clearance - acc * dt * qd
    return math.sqrt(max(root, 0.0)) - acc * dt


@kernel(error_model="numpy")
def coefficient_interval(q: float, qd: float, limits: AxisLimits) -> tuple[float, float]:
    """Return the least and the greatest viable coefficient [rad/s^2].

    The interval is never empty for a viable state. It may be for any other state, for example
    a measured one that exceeds a limit; the caller brakes then.

    Args:
        q: Joint position [rad].
        qd: Joint speed [rad/s].
        limits: Limits of the joint.
    """
    acc, dt = limits.qdd_max, limits.dt
    high = min(limits.qd_max, greatest_end_speed(limits.q_max - q, qd, acc, dt))
    low = max(-limits.qd_max, -greatest_end_speed(q - limits.q_min, -qd, acc, dt))
    c_max = min(0.5 * acc, (high - qd) / (2.0 * dt))
    c_min = max(-0.5 * acc, (low - qd) / (2.0 * dt))
    return c_min, c_max


@kernel(error_model="numpy")
def one_step_position_bound(clearance: float, qd: float, dt: float) -> float:
    """Return the greatest coefficient toward a limit that keeps it for one period [rad/s^2].

    Args:
        clearance: Distance to the limit [rad].
        qd: Speed toward the limit now [rad/s].
        dt: Period [s].
    """
    if qd > 0.0 and clearance < 0.5 * qd * dt:
        return -qd * qd / (4.0 * clearance) if clearance > 0.0 else -math.inf
    return (clearance - qd * dt) / (dt * dt)


@kernel(error_model="numpy")
def one_step_interval(q: float, qd: float, limits: AxisLimits) -> tuple[float, float]:
    """Return the thesis' least and greatest coefficient [rad/s^2]; empty is *unfeasible*.

    Args:
        q: Joint position [rad].
        qd: Joint speed [rad/s].
        limits: Limits of the joint.

    Source: thesis eq. (4.17)-(4.22), corrected (docs/method.md 2.2).
    """
    acc, dt = limits.qdd_max, limits.dt
    end = min(0.5 * acc, (limits.qd_max - qd) / (2.0 * dt))
    c_max = min(end, one_step_position_bound(limits.q_max - q, qd, dt))
    start = max(-0.5 * acc, (-limits.qd_max - qd) / (2.0 * dt))
    c_min = max(start, -one_step_position_bound(q - limits.q_min, -qd, dt))
    return c_min, c_max


@kernel(error_model="numpy")
def brake(qd: float, acc: float, dt: float) -> float:
    """Return the coefficient that comes nearest to rest, by acceleration alone [rad/s^2]."""
    return min(0.5 * acc, max(-0.5 * acc, -qd / (2.0 * dt)))


@kernel(error_model="numpy")
def coefficient_of(act: float, c_min: float, c_max: float) -> float:
    """Return the coefficient that an action in [-1, 1] picks from an interval (4.23)."""
    return 0.5 * (c_max + c_min) + act * 0.5 * (c_max - c_min)


@kernel(error_model="numpy", inline="always")
def viable_coefficient_for_speed(
    q: float, qd: float, qd_target: float, limits: AxisLimits, per_2dt: float
) -> tuple[float, bool]:
    """Return the viable coefficient that ends nearest to a target speed.

    The ends of the interval are computed only where they matter: a position limit binds only
    where the target speed fails ``(v' + A dt)^2 <= (A dt)^2 + 2 A (q_max - q) - A dt qd``, and
    only then is the square root taken.

    Args:
        q: Joint position [rad].
        qd: Joint speed [rad/s].
        qd_target: Target speed at the end of the period [rad/s].
        limits: Limits of the joint.
        per_2dt: ``1/(2 dt)`` [1/s]; an argument, so that it is computed once for all joints.

    Returns:
        The coefficient [rad/s^2] and whether the interval is empty; the joint then brakes.
    """
    acc = limits.qdd_max
    step = acc * limits.dt
    top, bottom = min(limits.qd_max, qd + step), max(-limits.qd_max, qd - step)
    v = min(top, max(bottom, qd_target))
    up = step * step + 2.0 * acc * (limits.q_max - q) - step * qd
    down = step * step + 2.0 * acc * (q - limits.q_min) + step * qd
    to_max, to_min = max(v + step, 0.0), max(step - v, 0.0)
    if (to_max * to_max > up) | (to_min * to_min > down) | (bottom > top):
        return _bounded_coefficient(qd, v, step, bottom, top, up, down, per_2dt)
    return min(0.5 * acc, max(-0.5 * acc, (v - qd) * per_2dt)), False


@kernel(error_model="numpy")
def _bounded_coefficient(
    qd: float,
    v: float,
    step: float,
    bottom: float,
    top: float,
    up: float,
    down: float,
    per_2dt: float,
) -> tuple[float, bool]:
    """Return the coefficient where a position limit binds, and whether none is admissible.

    Args:
        qd: Joint speed [rad/s].
        v: Wanted speed after the period, admissible but for position [rad/s].
        step: Greatest change of speed in one period [rad/s].
        bottom: Least speed that speed and acceleration limits admit [rad/s].
        top: Greatest such speed [rad/s].
        up: Radicand of the greatest viable speed [rad^2/s^2].
        down: Radicand of the least viable speed [rad^2/s^2].
        per_2dt: ``1/(2 dt)`` [1/s].
    """
    top = min(top, math.sqrt(max(up, 0.0)) - step)
    bottom = max(bottom, step - math.sqrt(max(down, 0.0)))
    empty = bottom > top
    v = 0.0 if empty else min(top, max(bottom, v))
    dv = min(step, max(-step, v - qd))
    return dv * per_2dt, empty


@kernel(error_model="numpy")
def coefficient_for_speed(q: float, qd: float, qd_target: float, limits: AxisLimits) -> float:
    """Return the viable coefficient that ends nearest to a target speed [rad/s^2].

    Args:
        q: Joint position [rad].
        qd: Joint speed [rad/s].
        qd_target: Target speed at the end of the period [rad/s].
        limits: Limits of the joint.
    """
    return viable_coefficient_for_speed(q, qd, qd_target, limits, 0.5 / limits.dt)[0]


@kernel(error_model="numpy")
def advance_to_speeds(
    limits: JointLimits, dt: float, start: JointState, qd_target: Vec, c: Vec, end: JointState
) -> None:
    """Move all joints through one period toward target speeds.

    Args:
        dt: Period [s].
        start: State at the start; accelerations are not read.
        qd_target: Target speeds at the end of the period [rad/s], shape (6,).
        c: Filled with the coefficients [rad/s^2], shape (6,).
        end: Filled with the state after the period.
    """
    q, qd = start.q, start.qd
    for j in range(q.shape[0]):
        axis = AxisLimits(
            limits.q_min[j],
            limits.q_max[j],
            limits.qd_max[j],
            limits.qdd_max[j],
            limits.jerk_max[j],
            dt,
        )
        c_j = coefficient_for_speed(q[j], qd[j], qd_target[j], axis)
        c[j], end.qdd[j] = c_j, 2.0 * c_j
        end.q[j] = q[j] + qd[j] * dt + c_j * dt * dt
        end.qd[j] = qd[j] + 2.0 * c_j * dt
