"""Pedestrian: a vertical cylinder with pseudo-random speed and radius (compiled).

Speed and radius follow, each with its own constants (thesis eq. 4.1, 4.2)::

    f(t) = m + 0.5 a sin(w t + p1) + 0.3 a sin(3 w t + p2) + 0.2 a sin(4 w t + p3)

with ``m`` the middle of the range, ``a`` drawn from the range, ``w / 2 pi`` up to a maximum
frequency and free phases, drawn once per episode. A speed below ``v_min`` is standing; speeds
are limited to ``v_max`` and radii to their range. The path leads straight to a target drawn
from the walking area, and to the next one within a tolerance. Pedestrians do not react to the
robot.

The speed at the start of a period holds for the period, and the radius changes linearly: x, y,
vx, vy determine the axis one period later. With sine and cosine of ``w t`` the multiples are
products, and ``a sin(k w t + p) = (a cos p) sin(k w t) + (a sin p) cos(k w t)``.

A row also stores the past 1.5 s, radius and walking speed every 0.1 s, including the time
before the episode.

Source: docs/method.md 2.1. Deviates: the authors' public code redraws the constants of the
speed at every step, which is not the continuous function of the text, and uses 0.1 for the
third amplitude; this is the printed function, drawn once per episode. ``a``, "a random value
within the range", is uniform in [v_min, v_max] and [r_min, r_max], frequencies uniform from 0.
The rules APART to P_GO_ON select other features of that code; they are off by default.
"""

import math
from typing import NamedTuple

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAST, kernel
from app.sim.core.kernels.rng import State, split_stream, uniform

WALKER, CONSTANT, FIXED_SPEED = range(3)
"""Kinds: docs/method.md 2.1; constant speed and radius per episode; a given speed without
limits, and a radius of docs/method.md 2.1."""
WALKING, STAYING, STILL = range(3)
"""Gaits: walking; staying at a reached target; standing still for the whole episode."""
AMPLITUDES = (0.5, 0.3, 0.2)
"""Shares of the three sines, eq. (4.1), (4.2)."""

N_RULES = 19
(
    KIND,
    V_MIN,
    V_MAX,
    R_MIN,
    R_MAX,
    F_SPEED_MAX,
    F_RADIUS_MAX,
    X_MIN,
    X_MAX,
    Y_MIN,
    Y_MAX,
    TOLERANCE,
    P_STILL,
    P_STAY,
    FIXED,
    APART,
    INSIDE,
    HURRIED,
    P_GO_ON,
) = range(N_RULES)
"""Rules of a walker: its kind; least and greatest walking speed [m/s] and radius [m]; greatest
frequencies [Hz]; walking area [m]; distance at which a target counts as reached [m];
probabilities of standing still for a whole episode and of staying for good at a target that was
reached; speed of kind FIXED_SPEED [m/s]. Then the authors' code: least way to a new target [m];
targets lie this many radii inside the area; whether (1 or 0) the first period is never slower
than V_MIN; probability, per period, of walking on after having stayed at a target."""
TARGET_TRIES = 64
"""Targets drawn before the last one is taken however near it is."""

N_CONSTANTS = 8
FREQUENCY, MIDDLE, SIN_1, COS_1, SIN_3, COS_3, SIN_4, COS_4 = range(N_CONSTANTS)
"""Constants of a function: frequency [Hz], middle, and factors of sine and cosine of the phase
and its multiples [m/s or m]."""

X, Y, VX, VY, R, GROWTH, GAIT, TARGET_X, TARGET_Y, COURSE_X, COURSE_Y, LEFT, TIME, SPEED = (
    range(14)
)
"""State of a walker: axis [m], velocity in the period to come [m/s], radius [m], its change in
the period that passed [m/s], gait, target [m], direction to it, distance left [m], time since
the start [s]; then the constants of the speed's function, and from RADIUS on the radius'."""
RADIUS = SPEED + N_CONSTANTS
N_PAST = 16
"""Moments of the past that are remembered."""
PAST_S = 0.1
"""Time between two of them [s]."""
AGE = RADIUS + N_CONSTANTS
PAST_RADIUS = AGE + 1
PAST_SPEED = PAST_RADIUS + N_PAST
"""History: age of the newest sample [s], radii [m] and speeds [m/s], newest first."""
N_STATE = PAST_SPEED + N_PAST


class PedestrianRules(NamedTuple):
    """Motion of each of a cell's W walkers."""

    rows: Vec
    """Rules named above, shape (W, N_RULES)."""


class PedestrianState(NamedTuple):
    """The walkers of all environments."""

    rows: Vec
    """State named above, shape (n_envs, W, N_STATE)."""
    stream: State
    """Random stream of each walker, shape (n_envs, W, 1)."""


@kernel(error_model="numpy", fastmath=FAST)
def wave(rows: Vec, e: int, p: int, first: int, t: float) -> float:
    """Return a pseudo-random function at ``t`` [s], before it is clipped (eq. 4.1, 4.2).

    Args:
        rows: State of all walkers, shape (n_envs, W, N_STATE).
        e: Environment.
        p: Walker.
        first: Index of the function's first constant, SPEED or RADIUS.
        t: Time since the start [s].
    """
    turns = rows[e, p, first + FREQUENCY] * t
    x = 0.5 * math.pi * (turns - math.floor(turns + 0.5))
    z = x * x
    # Taylor series of a quarter of the phase, at most pi / 4: what is left is below 1e-16.
    s = x * (1.0 - z / 6.0 * (1.0 - z / 20.0 * (1.0 - z / 42.0 * (1.0 - z / 72.0 * (
        1.0 - z / 110.0 * (1.0 - z / 156.0 * (1.0 - z / 210.0)))))))  # fmt: skip
    c = 1.0 - z / 2.0 * (1.0 - z / 12.0 * (1.0 - z / 30.0 * (1.0 - z / 56.0 * (
        1.0 - z / 90.0 * (1.0 - z / 132.0 * (1.0 - z / 182.0))))))  # fmt: skip
    s, c = 2.0 * s * c, 1.0 - 2.0 * s * s
    s, c = 2.0 * s * c, 1.0 - 2.0 * s * s
    s2, c2 = 2.0 * s * c, 1.0 - 2.0 * s * s
    return float(
        rows[e, p, first + MIDDLE]
        + rows[e, p, first + SIN_1] * s
        + rows[e, p, first + COS_1] * c
        + rows[e, p, first + SIN_3] * (s2 * c + c2 * s)
        + rows[e, p, first + COS_3] * (c2 * c - s2 * s)
        + rows[e, p, first + SIN_4] * (2.0 * s2 * c2)
        + rows[e, p, first + COS_4] * (1.0 - 2.0 * s2 * s2)
    )


@kernel()
def _draw_wave(stream: State, low: float, high: float, f_max: float, constants: Vec) -> None:
    """Draw a function's constants, shape (N_CONSTANTS,), for a range and a frequency [Hz]."""
    constants[FREQUENCY] = f_max * uniform(stream)
    constants[MIDDLE] = 0.5 * (low + high)
    amplitude = _between(stream, low, high)
    for k in range(3):
        phase = 2.0 * math.pi * uniform(stream)
        constants[SIN_1 + 2 * k] = AMPLITUDES[k] * amplitude * math.cos(phase)
        constants[COS_1 + 2 * k] = AMPLITUDES[k] * amplitude * math.sin(phase)


@kernel()
def _hold(value: float, constants: Vec) -> None:
    """Make a function constant."""
    constants[:] = 0.0
    constants[MIDDLE] = value


@kernel()
def _between(stream: State, low: float, high: float) -> float:
    return low + (high - low) * uniform(stream)


@kernel()
def start_pedestrian(
    rules: PedestrianRules, state: PedestrianState, e: int, p: int, stream: State
) -> None:
    """Draw an episode of one walker: place, gait, first target, the two functions.

    The place is uniform in the walking area. Where a start needs clearance from the robot, the
    caller draws again: that is a rule of the scenario (docs/method.md 2.1, open).

    Args:
        rules: Motion of the walkers.
        state: The walkers; (e, p) is written.
        e: Environment.
        p: Walker.
        stream: Random stream of the episode, shape (1,); the walker branches off its own.
    """
    rule, row, own = rules.rows[p], state.rows[e, p], state.stream[e, p]
    split_stream(stream, p, own)
    row[X] = _between(own, rule[X_MIN], rule[X_MAX])
    row[Y] = _between(own, rule[Y_MIN], rule[Y_MAX])
    row[GAIT] = STILL if uniform(own) < rule[P_STILL] else WALKING
    speed, radius = row[SPEED:RADIUS], row[RADIUS:N_STATE]
    _draw_wave(own, rule[V_MIN], rule[V_MAX], rule[F_SPEED_MAX], speed)
    _draw_wave(own, rule[R_MIN], rule[R_MAX], rule[F_RADIUS_MAX], radius)
    if rule[KIND] == CONSTANT:
        _hold(_between(own, rule[V_MIN], rule[V_MAX]), speed)
        _hold(_between(own, rule[R_MIN], rule[R_MAX]), radius)
    elif rule[KIND] == FIXED_SPEED:
        _hold(rule[FIXED], speed)
    row[TIME], row[GROWTH] = 0.0, 0.0
    row[R] = _radius(rules.rows, state.rows, e, p, 0.0)
    _new_target(rules.rows, state.rows, own, e, p)
    _set_velocity(rules.rows, state.rows, e, p, 0.0)
    _remember_before(rules.rows, state.rows, e, p)
    stands = row[VX] == 0.0 and row[VY] == 0.0
    if rule[HURRIED] > 0.0 and stands and row[GAIT] == WALKING and rule[KIND] != FIXED_SPEED:
        row[VX], row[VY] = rule[V_MIN] * row[COURSE_X], rule[V_MIN] * row[COURSE_Y]


@kernel(error_model="numpy", fastmath=FAST)
def advance_pedestrian(
    rules: PedestrianRules, state: PedestrianState, e: int, p: int, dt: float
) -> None:
    """Move one walker by one control period, at most to its target.

    Args:
        rules: Motion of the walkers.
        state: The walkers; (e, p) is changed.
        e: Environment.
        p: Walker.
        dt: Period [s].
    """
    rule, rows = rules.rows, state.rows
    if rows[e, p, GAIT] == WALKING:
        speed = rows[e, p, VX] * rows[e, p, COURSE_X] + rows[e, p, VY] * rows[e, p, COURSE_Y]
        left = rows[e, p, LEFT] - dt * speed
        if left > 0.0:
            rows[e, p, X] += dt * rows[e, p, VX]
            rows[e, p, Y] += dt * rows[e, p, VY]
        else:
            rows[e, p, X], rows[e, p, Y] = rows[e, p, TARGET_X], rows[e, p, TARGET_Y]
        rows[e, p, LEFT] = left
        if left <= rule[p, TOLERANCE]:
            _arrive(rules, state, e, p)
    elif rows[e, p, GAIT] == STAYING and rule[p, P_GO_ON] > 0.0:
        _go_on(rules, state, e, p)
    t = rows[e, p, TIME] + dt
    r = _radius(rule, rows, e, p, t)
    rows[e, p, GROWTH] = (r - rows[e, p, R]) / dt
    rows[e, p, R] = r
    rows[e, p, TIME] = t
    _set_velocity(rule, rows, e, p, t)
    remember(rows, e, p, dt)


@kernel(inline="always")
def remember(rows: Vec, e: int, p: int, dt: float) -> None:
    """Age the history of a walker and add a sample when due.

    Samples are PAST_S apart, rounded up to whole control periods.

    Args:
        rows: State of all walkers, shape (n_envs, W, N_STATE).
        e: Environment.
        p: Walker.
        dt: Time since the last call [s].
    """
    rows[e, p, AGE] += dt
    if rows[e, p, AGE] < PAST_S - 1e-9:
        return
    for k in range(N_PAST - 1, 0, -1):
        rows[e, p, PAST_RADIUS + k] = rows[e, p, PAST_RADIUS + k - 1]
        rows[e, p, PAST_SPEED + k] = rows[e, p, PAST_SPEED + k - 1]
    rows[e, p, AGE], rows[e, p, PAST_RADIUS] = 0.0, rows[e, p, R]
    rows[e, p, PAST_SPEED] = math.hypot(rows[e, p, VX], rows[e, p, VY])


@kernel()
def remember_as_now(rows: Vec, e: int, p: int) -> None:
    """Set the history of a walker to its present values."""
    rows[e, p, AGE] = 0.0
    for k in range(N_PAST):
        rows[e, p, PAST_RADIUS + k] = rows[e, p, R]
        rows[e, p, PAST_SPEED + k] = math.hypot(rows[e, p, VX], rows[e, p, VY])


@kernel()
def _remember_before(rule: Vec, rows: Vec, e: int, p: int) -> None:
    """Set the history of a walker before its start."""
    rows[e, p, AGE] = 0.0
    for k in range(N_PAST):
        t = -k * PAST_S
        rows[e, p, PAST_RADIUS + k] = _radius(rule, rows, e, p, t)
        rows[e, p, PAST_SPEED + k] = _speed(rule, rows, e, p, t)


@kernel()
def _arrive(rules: PedestrianRules, state: PedestrianState, e: int, p: int) -> None:
    """Stay at the target for the rest of the episode, or draw a new one."""
    own = state.stream[e, p]
    if uniform(own) < rules.rows[p, P_STAY]:
        state.rows[e, p, GAIT] = STAYING
    else:
        _new_target(rules.rows, state.rows, own, e, p)


@kernel()
def _go_on(rules: PedestrianRules, state: PedestrianState, e: int, p: int) -> None:
    """Leave the target with a given probability."""
    own = state.stream[e, p]
    if uniform(own) < rules.rows[p, P_GO_ON]:
        state.rows[e, p, GAIT] = WALKING
        _new_target(rules.rows, state.rows, own, e, p)


@kernel()
def _drawn_inside(own: State, low: float, high: float, margin: float) -> float:
    """Draw from a range less a margin at both ends; from its middle if that is empty."""
    margin = min(margin, 0.5 * (high - low))
    return _between(own, low + margin, high - margin)


@kernel()
def _new_target(rule: Vec, rows: Vec, own: State, e: int, p: int) -> None:
    """Draw a target from the walking area and set the course to it."""
    x, y, margin = rows[e, p, X], rows[e, p, Y], rule[p, INSIDE] * rows[e, p, R]
    to_x, to_y, left = x, y, 0.0
    for _ in range(TARGET_TRIES):
        to_x = _drawn_inside(own, rule[p, X_MIN], rule[p, X_MAX], margin)
        to_y = _drawn_inside(own, rule[p, Y_MIN], rule[p, Y_MAX], margin)
        left = math.hypot(to_x - x, to_y - y)
        if left >= rule[p, APART]:
            break
    per_metre = 1.0 / left if left > 0.0 else 0.0
    rows[e, p, TARGET_X], rows[e, p, TARGET_Y], rows[e, p, LEFT] = to_x, to_y, left
    rows[e, p, COURSE_X], rows[e, p, COURSE_Y] = per_metre * (to_x - x), per_metre * (to_y - y)


@kernel(inline="always")
def _radius(rule: Vec, rows: Vec, e: int, p: int, t: float) -> float:
    """Return the radius at ``t`` [m]."""
    return float(min(rule[p, R_MAX], max(rule[p, R_MIN], wave(rows, e, p, RADIUS, t))))


@kernel(inline="always")
def _speed(rule: Vec, rows: Vec, e: int, p: int, t: float) -> float:
    """Return the walking speed at ``t`` [m/s]."""
    speed = 0.0
    if rows[e, p, GAIT] == WALKING:
        speed = wave(rows, e, p, SPEED, t)
        if rule[p, KIND] != FIXED_SPEED:
            speed = 0.0 if speed < rule[p, V_MIN] else min(speed, rule[p, V_MAX])
    return float(speed)


@kernel(inline="always")
def _set_velocity(rule: Vec, rows: Vec, e: int, p: int, t: float) -> None:
    """Write the velocity of the period from ``t``."""
    speed = _speed(rule, rows, e, p, t)
    rows[e, p, VX] = speed * rows[e, p, COURSE_X]
    rows[e, p, VY] = speed * rows[e, p, COURSE_Y]
