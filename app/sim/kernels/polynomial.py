"""Bounded polynomial actions of degree 2, with viability (METHOD 2.2), compiled.

During one period a joint follows ``q(x) = q + qd x + c x^2``. The coefficient's interval
keeps acceleration and speed limits, and keeps the state *viable*: with ``A`` the acceleration
limit and ``q', v'`` the state after the period, ``v'^2/(2A) + v' dt/2 <= q_max - q'`` for
``v' >= 0``, mirrored below. With ``q' = q + (qd + v') dt/2`` the condition is a quadratic in
``v'``, whose root is the greatest admissible end speed:

    v'_max = -A dt + sqrt((A dt)^2 + 2 A (q_max - q) - A dt qd)

From a viable state full braking satisfies it, so the interval is never empty and no limit is
ever exceeded, inside the period too: a joint that turns round inside a period has covered less
than ``qd dt/2`` beyond ``q``, which viability keeps free.

Source: thesis eq. (4.17)-(4.23).
Deviates: (4.21) and (4.22) swap max and min and (4.17) misprints a factor; viability is ours:
the thesis ends an episode as *unfeasible* where this interval never empties.
"""

import math


from app.sim.kernels.compiled import kernel
from app.sim.ports import Vec


@kernel()
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


@kernel()
def coefficient_interval(
    q: float, qd: float, q_min: float, q_max: float, qd_max: float, acc: float, dt: float
) -> tuple[float, float]:
    """Return the least and the greatest admissible coefficient [rad/s^2].

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


@kernel()
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
    """Return the admissible coefficient that ends nearest to a wanted speed [rad/s^2].

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
    c_min, c_max = coefficient_interval(q, qd, q_min, q_max, qd_max, acc, dt)
    if c_min > c_max:  # not viable: brake as hard as the acceleration limit allows
        return min(0.5 * acc, max(-0.5 * acc, -qd / (2.0 * dt)))
    return min(c_max, max(c_min, (qd_target - qd) / (2.0 * dt)))


@kernel()
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
