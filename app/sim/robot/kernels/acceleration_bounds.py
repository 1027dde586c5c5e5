"""Bounded polynomial actions of degree 2 for one joint (METHOD 2.2), compiled.

During one period of length ``dt`` a joint follows ``q(x) = q + qd x + c x^2``. The admissible
coefficients are an interval ``[c_min, c_max]``: ``c_max`` is the least of the upper bounds,
``c_min`` the greatest of the lower ones. With the acceleration limit ``A``, the speed limit
``V`` and the limits ``q_min, q_max``:

*Both variants*::

    |c| <= A/2                                         acceleration, constant in the period
    (-V - qd)/(2 dt) <= c <= (V - qd)/(2 dt)           speed at the end, linear in between

*Viable* (ours, the default): after the period, in the state ``q', v'``, full braking still
stops the joint in time: ``v'^2/(2A) + v' dt/2 <= q_max - q'`` for ``v' >= 0``, mirrored below.
With ``v' = qd + 2 c dt`` and ``q' = q + (qd + v') dt/2`` this is a quadratic in ``v'``::

    v'_max = -A dt + sqrt((A dt)^2 + 2 A (q_max - q) - A dt qd)
    c <= (v'_max - qd)/(2 dt)

and mirrored, with ``q - q_min`` and ``-qd`` in place of ``q_max - q`` and ``qd``.

From a viable state full braking satisfies it, so the interval is never empty and no limit is
ever exceeded, inside the period too: a joint that turns round inside a period has covered less
than ``qd dt/2`` beyond ``q``, which viability keeps free.

*One step* (the source's): only the limits of this very period::

    c <= (q_max - qd dt - q)/dt^2                      position at the end, or in its place
    c <= -qd^2/(4 (q_max - q))                         at the turning point x* = -qd/(2c),
                                                       where q_max - q < qd dt/2 and qd > 0
    c >= (q_min - qd dt - q)/dt^2                      mirrored
    c >= qd^2/(4 (q - q_min))                          where q - q_min < -qd dt/2 and qd < 0

The interval may then be empty one period later: a joint at full speed before its limit can no
longer stop. The source ends such an episode as *unfeasible*.

Source: thesis eq. (4.17)-(4.23).
Deviates: three misprints are mended; as printed, each exceeds limits (see the tests).
(4.17) and (4.21) have ``q^2 - 2 qd^2`` in place of ``qd^2`` at the turning point; (4.21) and
(4.22) swap max and min: the greatest of the upper bounds and the least of the lower ones.
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel


@kernel(error_model="numpy")
def greatest_end_speed(room: float, qd: float, acc: float, dt: float) -> float:
    """Return the greatest speed toward a limit that is viable after one period [rad/s].

    Args:
        room: Distance to the limit [rad].
        qd: Speed toward the limit now [rad/s].
        acc: Acceleration limit [rad/s^2].
        dt: Period [s].
    """
    root = acc * dt * acc * dt + 2.0 * acc * room - acc * dt * qd
    return math.sqrt(max(root, 0.0)) - acc * dt


@kernel(error_model="numpy")
def coefficient_interval(
    q: float, qd: float, q_min: float, q_max: float, qd_max: float, acc: float, dt: float
) -> tuple[float, float]:
    """Return the least and the greatest viable coefficient [rad/s^2].

    From a viable state the interval is never empty. From any other state (limits already
    exceeded, say, by a state that came from outside) it may be; the caller brakes then.

    Args:
        q: Joint position [rad].
        qd: Joint speed [rad/s].
        q_min: Lower position limit [rad].
        q_max: Upper position limit [rad].
        qd_max: Speed limit [rad/s].
        acc: Acceleration limit [rad/s^2].
        dt: Period [s].
    """
    high = min(qd_max, greatest_end_speed(q_max - q, qd, acc, dt))
    low = max(-qd_max, -greatest_end_speed(q - q_min, -qd, acc, dt))
    c_max = min(0.5 * acc, (high - qd) / (2.0 * dt))
    c_min = max(-0.5 * acc, (low - qd) / (2.0 * dt))
    return c_min, c_max


@kernel(error_model="numpy")
def myopic_position_bound(room: float, qd: float, dt: float) -> float:
    """Return the greatest coefficient toward a limit that keeps it for one period [rad/s^2].

    Args:
        room: Distance to the limit [rad].
        qd: Speed toward the limit now [rad/s].
        dt: Period [s].
    """
    if qd > 0.0 and room < 0.5 * qd * dt:
        return -qd * qd / (4.0 * room) if room > 0.0 else -math.inf
    return (room - qd * dt) / (dt * dt)


@kernel(error_model="numpy")
def myopic_interval(
    q: float, qd: float, q_min: float, q_max: float, qd_max: float, acc: float, dt: float
) -> tuple[float, float]:
    """Return the source's least and greatest coefficient [rad/s^2]; empty is *unfeasible*.

    Args:
        q: Joint position [rad].
        qd: Joint speed [rad/s].
        q_min: Lower position limit [rad].
        q_max: Upper position limit [rad].
        qd_max: Speed limit [rad/s].
        acc: Acceleration limit [rad/s^2].
        dt: Period [s].

    Source: thesis eq. (4.17)-(4.22), mended (METHOD 2.2).
    """
    end = min(0.5 * acc, (qd_max - qd) / (2.0 * dt))
    c_max = min(end, myopic_position_bound(q_max - q, qd, dt))
    start = max(-0.5 * acc, (-qd_max - qd) / (2.0 * dt))
    c_min = max(start, -myopic_position_bound(q - q_min, -qd, dt))
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
    q: float,
    qd: float,
    qd_target: float,
    q_min: float,
    q_max: float,
    qd_max: float,
    acc: float,
    dt: float,
    per_2dt: float,
) -> tuple[float, bool]:
    """Return the viable coefficient that ends nearest to a wanted speed.

    The interval's ends are not computed unless they matter: a position limit binds only where
    the wanted speed fails ``(v' + A dt)^2 <= (A dt)^2 + 2 A (q_max - q) - A dt qd``, and only
    then is the square root taken.

    Args:
        q: Joint position [rad].
        qd: Joint speed [rad/s].
        qd_target: Wanted speed at the end of the period [rad/s].
        q_min: Lower position limit [rad].
        q_max: Upper position limit [rad].
        qd_max: Speed limit [rad/s].
        acc: Acceleration limit [rad/s^2].
        dt: Period [s].
        per_2dt: ``1/(2 dt)`` [1/s]; an argument, so that it is divided once for all joints.

    Returns:
        The coefficient [rad/s^2] and whether the interval is empty; it brakes then.
    """
    step = acc * dt
    top, bottom = min(qd_max, qd + step), max(-qd_max, qd - step)
    v = min(top, max(bottom, qd_target))
    up = step * step + 2.0 * acc * (q_max - q) - step * qd
    down = step * step + 2.0 * acc * (q - q_min) + step * qd
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
def coefficient_for_speed(
    q: float,
    qd: float,
    qd_target: float,
    q_min: float,
    q_max: float,
    qd_max: float,
    acc: float,
    dt: float,
) -> float:
    """Return the viable coefficient that ends nearest to a wanted speed [rad/s^2].

    Args:
        q: Joint position [rad].
        qd: Joint speed [rad/s].
        qd_target: Wanted speed at the end of the period [rad/s].
        q_min: Lower position limit [rad].
        q_max: Upper position limit [rad].
        qd_max: Speed limit [rad/s].
        acc: Acceleration limit [rad/s^2].
        dt: Period [s].
    """
    return viable_coefficient_for_speed(
        q, qd, qd_target, q_min, q_max, qd_max, acc, dt, 0.5 / dt
    )[0]


@kernel(error_model="numpy")
def advance(
    q: Vec,
    qd: Vec,
    qd_target: Vec,
    q_min: Vec,
    q_max: Vec,
    qd_max: Vec,
    acc: Vec,
    dt: float,
    c_out: Vec,
    q_out: Vec,
    qd_out: Vec,
) -> None:
    """Move all joints through one period toward wanted speeds.

    Args:
        q: Joint positions [rad], shape (n,).
        qd: Joint speeds [rad/s], shape (n,).
        qd_target: Wanted speeds at the end of the period [rad/s], shape (n,).
        q_min: Lower position limits [rad], shape (n,).
        q_max: Upper position limits [rad], shape (n,).
        qd_max: Speed limits [rad/s], shape (n,).
        acc: Acceleration limits [rad/s^2], shape (n,).
        dt: Period [s].
        c_out: Filled with the coefficients [rad/s^2], shape (n,).
        q_out: Filled with the positions after the period [rad], shape (n,).
        qd_out: Filled with the speeds after the period [rad/s], shape (n,).
    """
    for j in range(q.shape[0]):
        c = coefficient_for_speed(
            q[j], qd[j], qd_target[j], q_min[j], q_max[j], qd_max[j], acc[j], dt
        )
        c_out[j] = c
        q_out[j] = q[j] + qd[j] * dt + c * dt * dt
        qd_out[j] = qd[j] + 2.0 * c * dt
