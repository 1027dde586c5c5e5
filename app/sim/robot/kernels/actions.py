"""What an action of a policy does to the joints in one period, compiled (METHOD 2.2).

One function for both degrees, both kinds of bounds and both meanings of an action. Every joint
follows ``q(x) = q + qd x + c x^2 + d x^3``, ``0 <= x <= dt``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.robot.kernels import acceleration_bounds as polynomial
from app.sim.robot.kernels import jerk_bounds as jerk
from app.sim.robot.kernels.jerk_bounds import Limits

Action = NDArray[np.floating]

VIABLE, MYOPIC = range(2)
"""Bounds: recursively feasible, or the source's for this period alone (degree 2)."""
SPEED, COEFFICIENT = range(2)
"""Meanings: a share of the speed limit to come near to, or a place in the interval (4.23)."""
N_JOINTS = 6
"""Joints of the robot; a constant, so that loops over them are unrolled."""
HOLD_GAIN = 2.0
"""Speed toward 0 of a joint that is held, per distance [1/s]."""


class ActionRule(NamedTuple):
    """How actions are read; ``app.sim.robot.actions`` makes it from names."""

    degree: int
    """2 (acceleration-limited) or 3 (jerk-limited)."""
    bounds: int
    """VIABLE or MYOPIC."""
    meaning: int
    """SPEED or COEFFICIENT."""


@kernel(error_model="numpy", inline="always")
def wanted_speed(j: int, q: float, qd_max: float, act: Action) -> float:
    """Return the speed wanted of a joint [rad/s]; joints without action are held at 0."""
    if j < act.shape[0]:
        return float(min(1.0, max(-1.0, act[j])) * qd_max)
    return float(min(qd_max, max(-qd_max, -HOLD_GAIN * q)))


@kernel(error_model="numpy")
def quadratic_by_interval(
    rule: ActionRule, qd_target: float, held: bool, q: float, qd: float, to: Limits
) -> tuple[float, bool]:
    """Return the coefficient of degree 2 that needs the whole interval.

    Args:
        rule: How actions are read.
        qd_target: Wanted speed [rad/s]; a share of it is the action.
        held: Whether the joint has no action and follows the speed in any case.
        q: Joint position [rad].
        qd: Joint speed [rad/s].
        to: Limits.

    Returns:
        The coefficient [rad/s^2] and whether the interval is empty; the joint brakes then.
    """
    acc, dt = to.qdd_max, to.dt
    if rule.bounds == MYOPIC:
        c_min, c_max = polynomial.myopic_interval(q, qd, to.q_min, to.q_max, to.qd_max, acc, dt)
    else:
        c_min, c_max = polynomial.coefficient_interval(
            q, qd, to.q_min, to.q_max, to.qd_max, acc, dt
        )
    if c_min > c_max:
        return polynomial.brake(qd, acc, dt), True
    if rule.meaning == COEFFICIENT and not held:
        return polynomial.coefficient_of(qd_target / to.qd_max, c_min, c_max), False
    return min(c_max, max(c_min, (qd_target - qd) / (2.0 * dt))), False


@kernel(error_model="numpy")
def other_piece(
    rule: ActionRule,
    qd_target: float,
    held: bool,
    q: float,
    qd: float,
    qdd: float,
    to: Limits,
) -> tuple[float, float, bool]:
    """Return ``c`` and ``d`` of a joint's piece for every rule but the default.

    Scalars in, scalars out: the loop of :func:`advance` stays small for the default.

    Args:
        rule: How actions are read.
        qd_target: Wanted speed [rad/s]; a share of it is the action.
        held: Whether the joint has no action and follows the speed in any case.
        q: Joint position [rad].
        qd: Joint speed [rad/s].
        qdd: Joint acceleration [rad/s^2].
        to: Limits.

    Returns:
        Coefficients [rad/s^2, rad/s^3] and whether the interval is empty.
    """
    if rule.degree == 2:
        c, empty = quadratic_by_interval(rule, qd_target, held, q, qd, to)
        return c, 0.0, empty
    if rule.meaning == COEFFICIENT and not held:
        low, high, empty = jerk.jerk_interval(q, qd, qdd, to)
        j = polynomial.coefficient_of(qd_target / to.qd_max, low, high)
    else:
        j, empty = jerk.jerk_for_speed(q, qd, qdd, qd_target, to)
    return 0.5 * qdd, j / 6.0, empty


@kernel(error_model="numpy", forceinline=True)
def advance(
    rule: ActionRule,
    q: Vec,
    qd: Vec,
    qdd: Vec,
    act: Action,
    q_min: Vec,
    q_max: Vec,
    qd_max: Vec,
    qdd_max: Vec,
    jerk_max: Vec,
    dt: float,
    c: Vec,
    d: Vec,
    q_out: Vec,
    qd_out: Vec,
    qdd_out: Vec,
) -> bool:
    """Move all joints through one period by an action.

    Args:
        rule: How actions are read.
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).
        qdd: Joint accelerations [rad/s^2], shape (6,); read by degree 3 alone.
        act: Actions, clipped to [-1, 1], shape (n,), n <= 6; further joints are held at 0.
        q_min: Lower position limits [rad], shape (6,).
        q_max: Upper position limits [rad], shape (6,).
        qd_max: Speed limits [rad/s], shape (6,).
        qdd_max: Acceleration limits [rad/s^2], shape (6,).
        jerk_max: Jerk limits [rad/s^3], shape (6,); read by degree 3 alone.
        dt: Period [s].
        c: Filled with the coefficients of x^2 [rad/s^2], shape (6,).
        d: Filled with the coefficients of x^3 [rad/s^3], shape (6,); 0 for degree 2.
        q_out: Filled with positions after the period [rad], shape (6,); may be ``q``.
        qd_out: Filled with speeds after the period [rad/s], shape (6,); may be ``qd``.
        qdd_out: Filled with accelerations at its end [rad/s^2], shape (6,); may be ``qdd``.

    Returns:
        Whether a joint's interval was empty: *unfeasible*; that joint brakes. Viable bounds
        never are, but from a state that was not viable already.
    """
    per_2dt, empty = 0.5 / dt, False
    plain = (rule.degree == 2) & (rule.bounds == VIABLE) & (rule.meaning == SPEED)
    for j in range(N_JOINTS):
        q_j, qd_j, d_j = q[j], qd[j], 0.0
        target = wanted_speed(j, q_j, qd_max[j], act)
        if plain:
            c_j, none = polynomial.viable_coefficient_for_speed(
                q_j, qd_j, target, q_min[j], q_max[j], qd_max[j], qdd_max[j], dt, per_2dt
            )
        else:
            held = j >= act.shape[0]
            to = Limits(q_min[j], q_max[j], qd_max[j], qdd_max[j], jerk_max[j], dt)
            c_j, d_j, none = other_piece(rule, target, held, q_j, qd_j, qdd[j], to)
        empty |= none
        c[j], d[j], qdd_out[j] = c_j, d_j, 2.0 * c_j + 6.0 * d_j * dt
        q_out[j] = q_j + dt * (qd_j + dt * (c_j + dt * d_j))
        qd_out[j] = qd_j + dt * (2.0 * c_j + 3.0 * dt * d_j)
    return empty
