"""Motion of the joints in one period that an action of a policy commands, compiled.

One function for both degrees, both kinds of bounds and both meanings of an action
(docs/method.md 2.2). Every joint follows ``q(x) = q + qd x + c x^2 + d x^3``, ``0 <= x <= dt``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.robot.kernels import acceleration_bounds as polynomial
from app.sim.robot.kernels import jerk_bounds as jerk
from app.sim.robot.kernels.joints import AxisLimits, AxisState, JointLimits, JointState

Action = NDArray[np.floating]

VIABLE, MYOPIC = range(2)
"""Bounds: recursively feasible, or the thesis' for one period only (degree 2)."""
SPEED, COEFFICIENT = range(2)
"""Meanings: a share of the speed limit to approach, or a place in the interval (4.23)."""
N_JOINTS = 6
"""Joints of the robot; a constant, so that loops over them are unrolled."""
HOLD_GAIN = 2.0
"""Speed toward 0 of a joint without action, per distance [1/s]."""


class ActionRule(NamedTuple):
    """Interpretation of actions; :mod:`app.sim.robot.actions` makes it from names."""

    degree: int
    """2 (acceleration-limited) or 3 (jerk-limited)."""
    bounds: int
    """VIABLE or MYOPIC."""
    meaning: int
    """SPEED or COEFFICIENT."""


class Coefficients(NamedTuple):
    """Coefficients of one period's trajectory, each of shape (6,)."""

    c: Vec
    """Coefficients of x^2 [rad/s^2]."""
    d: Vec
    """Coefficients of x^3 [rad/s^3]; 0 for degree 2."""


@kernel(error_model="numpy", inline="always")
def wanted_speed(j: int, q: float, qd_max: float, act: Action) -> float:
    """Return the target speed of a joint [rad/s]; joints without action are held at 0."""
    if j < act.shape[0]:
        return float(min(1.0, max(-1.0, act[j])) * qd_max)
    return float(min(qd_max, max(-qd_max, -HOLD_GAIN * q)))


@kernel(error_model="numpy")
def quadratic_by_interval(
    rule: ActionRule, qd_target: float, held: bool, q: float, qd: float, limits: AxisLimits
) -> tuple[float, bool]:
    """Return the coefficient of degree 2 for rules that need the whole interval.

    Args:
        rule: Interpretation of actions.
        qd_target: Target speed [rad/s]; the action is its share of the speed limit.
        held: Whether the joint has no action and follows the speed in any case.
        q: Joint position [rad].
        qd: Joint speed [rad/s].
        limits: Limits of the joint.

    Returns:
        The coefficient [rad/s^2] and whether the interval is empty; the joint then brakes.
    """
    if rule.bounds == MYOPIC:
        c_min, c_max = polynomial.one_step_interval(q, qd, limits)
    else:
        c_min, c_max = polynomial.coefficient_interval(q, qd, limits)
    if c_min > c_max:
        return polynomial.brake(qd, limits.qdd_max, limits.dt), True
    if rule.meaning == COEFFICIENT and not held:
        return polynomial.coefficient_of(qd_target / limits.qd_max, c_min, c_max), False
    return min(c_max, max(c_min, (qd_target - qd) / (2.0 * limits.dt))), False


@kernel(error_model="numpy")
def other_coefficients(
    rule: ActionRule, qd_target: float, held: bool, at: AxisState, limits: AxisLimits
) -> tuple[float, float, bool]:
    """Return ``c`` and ``d`` of one joint for every rule except the default.

    Scalars in, scalars out: the loop of :func:`advance` stays small for the default.

    Args:
        rule: Interpretation of actions.
        qd_target: Target speed [rad/s]; the action is its share of the speed limit.
        held: Whether the joint has no action and follows the speed in any case.

    Returns:
        Coefficients [rad/s^2, rad/s^3] and whether the interval is empty.
    """
    if rule.degree == 2:
        c, empty = quadratic_by_interval(rule, qd_target, held, at.q, at.qd, limits)
        return c, 0.0, empty
    if rule.meaning == COEFFICIENT and not held:
        low, high, empty = jerk.jerk_interval(at, limits)
        j = polynomial.coefficient_of(qd_target / limits.qd_max, low, high)
    else:
        j, empty = jerk.jerk_for_speed(at, qd_target, limits)
    return 0.5 * at.qdd, j / 6.0, empty


@kernel(error_model="numpy", forceinline=True)
def advance(
    rule: ActionRule,
    limits: JointLimits,
    dt: float,
    start: JointState,
    act: Action,
    out: Coefficients,
    end: JointState,
) -> bool:
    """Move all joints through one period by an action.

    Args:
        rule: Interpretation of actions.
        limits: Joint limits; jerk limits are read by degree 3 only.
        dt: Period [s].
        start: State at the start; accelerations are read by degree 3 only.
        act: Actions, clipped to [-1, 1], shape (n,), n <= 6; further joints are held at 0.
        out: Filled with the coefficients.
        end: Filled with the state after the period; may be ``start``.

    Returns:
        Whether the interval of a joint was empty (*unfeasible*); that joint brakes. Viable
        bounds are empty only for a start that is not viable.
    """
    per_2dt, empty = 0.5 / dt, False
    plain = (rule.degree == 2) & (rule.bounds == VIABLE) & (rule.meaning == SPEED)
    q, qd, qdd = start.q, start.qd, start.qdd
    for j in range(N_JOINTS):
        q_j, qd_j, d_j = q[j], qd[j], 0.0
        target = wanted_speed(j, q_j, limits.qd_max[j], act)
        axis = AxisLimits(
            limits.q_min[j],
            limits.q_max[j],
            limits.qd_max[j],
            limits.qdd_max[j],
            limits.jerk_max[j],
            dt,
        )
        if plain:
            c_j, none = polynomial.viable_coefficient_for_speed(
                q_j, qd_j, target, axis, per_2dt
            )
        else:
            at = AxisState(q_j, qd_j, qdd[j])
            c_j, d_j, none = other_coefficients(rule, target, j >= act.shape[0], at, axis)
        empty |= none
        out.c[j], out.d[j], end.qdd[j] = c_j, d_j, 2.0 * c_j + 6.0 * d_j * dt
        end.q[j] = q_j + dt * (qd_j + dt * (c_j + dt * d_j))
        end.qd[j] = qd_j + dt * (2.0 * c_j + 3.0 * dt * d_j)
    return empty
