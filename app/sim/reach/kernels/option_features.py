"""Option features: predicted clearance along five candidate motions (compiled).

The options are the base motion to the goal, standing still, and retreating to home or to either
side of home. The clearance of each is evaluated at several times, where all people move in a
straight line with radius and speed of the motion predictor (``app/sim/prediction``); workers
move at constant velocity. The least clearance over all people counts.

Each option is followed at the full speed of its slowest joint; the present joint speed decays
over ``ROLL_S``, and each joint lags by ``LAG_S``.
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR, kernel
from app.sim.core.observation_layout import OBS_BOUND, slices_of
from app.sim.geometry.capsules import copy_values
from app.sim.people.kernels.pedestrian import AGE, N_PAST, PAST_RADIUS, PAST_SPEED
from app.sim.people.kernels.people import PeopleState
from app.sim.prediction.kernels.networks import N_TIMES, STEP_S, predict_pedestrian
from app.sim.reach.kernels.base_controller import base_motion
from app.sim.reach.kernels.observation import ALL_PEOPLE, write_person
from app.sim.reach.kernels.observation_workspace import (
    LOOKS,
    N_ASIDE,
    N_LOOKS,
    ReachObservationWorkspace,
    ReachQuery,
)
from app.sim.robot.kernels.arm import Arm
from app.sim.robot.kernels.configuration_lanes import (
    AXIS_R,
    AXIS_X,
    AXIS_Y,
    CLEARANCE,
    JOINTS,
    N_LANES,
    measure_lanes,
    place_lanes,
)
from app.sim.scenario.kernels.person_observation import Obs

LAG_S = 0.05
"""Lag of a joint behind its commanded speed while it accelerates [s]."""
ROLL_S = 0.1
"""Time in which a joint loses its present speed [s]."""
NEAR = 0.2
"""Unit of clearances [m]."""
FARTHEST = 2.0
"""Clearances are clipped at -1 and this many units."""
AFTER_S = 0.15
"""Time after the arrival for which the base motion counts [s]."""
SCALE = 0.5
"""Unit of the clearance of person and goal [m]; it is clipped at three units."""
GROWN = 0.2
"""Unit of the change of a radius [m]."""
SIZES = (
    ("arrival", 1),
    ("base_clearance", N_LOOKS + 1),
    ("aside_clearance", N_ASIDE * (N_LOOKS + 1)),
    ("goal_gap_ahead", N_LOOKS),
    ("radius_ahead", N_LOOKS),
)
"""Names and sizes of the groups of features; the least clearance of an option comes last."""
LAYOUT = slices_of(SIZES)
"""Slice of each group among these features."""
N_OPTION_FEATURES = sum(size for _, size in SIZES)
BASE, ASIDE = LAYOUT["base_clearance"].start, LAYOUT["aside_clearance"].start
GOAL, GROWTH = LAYOUT["goal_gap_ahead"].start, LAYOUT["radius_ahead"].start


@kernel()
def predict_motion(
    state: PeopleState, e: int, which: int, observed: int, work: ReachObservationWorkspace
) -> None:
    """Fill ``work.people``, ``predicted`` and ``n`` with the considered people.

    Args:
        e: Environment.
        which: The only person to consider, workers first, or ALL_PEOPLE.
        observed: The observed person; below 0 for none.
        work: Holds the people, placed as they are now.
    """
    n_workers, n_people = state.q.shape[1], state.q.shape[1] + state.walkers.rows.shape[1]
    work.n[0], work.n[1] = 0, 0
    for p in range(-1 if n_people == 0 else 0, n_people):
        if which != ALL_PEOPLE and p != which:
            continue
        if p == observed:
            work.n[1] = work.n[0]
        write_person(state, e, p, work.geometry, work.person)
        copy_values(work.person, work.people[work.n[0]])
        _predict_person(state, e, p - n_workers, work)
        work.n[0] += 1


@kernel()
def _predict_person(
    state: PeopleState, e: int, walker: int, work: ReachObservationWorkspace
) -> None:
    """Write the predicted positions of ``work.person``; pedestrians have numbers from 0 on."""
    course, person, k = work.course, work.person, work.n[0]
    speed = math.hypot(person[2], person[3])
    for i in range(N_TIMES):
        course[i, 0], course[i, 1] = person[4], STEP_S * (i + 1) * speed
    if walker >= 0:
        row = state.walkers.rows[e, walker]
        radii = row[PAST_RADIUS : PAST_RADIUS + N_PAST]
        speeds = row[PAST_SPEED : PAST_SPEED + N_PAST]
        r, growth = person[4], person[5]
        predict_pedestrian(work.predictor, r, growth, speed, row[AGE], radii, speeds, course)
    per_metre = 1.0 / speed if speed > 1e-9 else 0.0
    for i in range(N_TIMES):
        length = course[i, 1] * per_metre
        work.predicted[i, k, 0] = person[0] + length * person[2]
        work.predicted[i, k, 1] = person[1] + length * person[3]
        work.predicted[i, k, 2] = course[i, 0]


@kernel(inline="always")
def _cut(d: float) -> float:
    return max(-1.0, min(FARTHEST, d / NEAR))


@kernel()
def _measure_people(arm: Arm, top_z: float, n: int, work: ReachObservationWorkspace) -> None:
    """Fill the clearances of ``n`` configurations to all people.

    Configuration ``m`` is evaluated at the time of ``LOOKS[m % N_LOOKS]``.

    Args:
        top_z: Height of people's tops [m].
        n: Number of configurations in ``work.lanes``.
        work: Holds the predicted people.
    """
    lanes = work.lanes
    place_lanes(arm.lengths, n, lanes)
    for p in range(work.n[0]):
        for m in range(n):
            there = work.predicted[LOOKS[m % N_LOOKS] - 1, p]
            lanes[AXIS_X + m], lanes[AXIS_Y + m] = there[0], there[1]
            lanes[AXIS_R + m] = there[2]
        measure_lanes(arm, top_z, n, FARTHEST * NEAR, work.q, work.moved, lanes)


@kernel()
def predict_option_clearances(
    arm: Arm, top_z: float, q: Vec, qd: Vec, work: ReachObservationWorkspace
) -> None:
    """Fill ``work.aside`` with the clearances of the options that do not lead to the goal.

    Args:
        top_z: Height of people's tops [m].
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).
        work: Holds the predicted people.
    """
    lanes = work.lanes
    for option in range(N_ASIDE):
        longest = 1e-9
        if option > 0:
            for j in range(6):
                left = abs(work.retreats[option - 1, j] - q[j])
                longest = max(longest, left / arm.limits.qd_max[j])
        for i in range(N_LOOKS):
            t, m = STEP_S * LOOKS[i], option * N_LOOKS + i
            share = min(1.0, max(0.0, t - LAG_S) / longest)
            for j in range(6):
                there = q[j] + 0.5 * qd[j] * min(t, ROLL_S)
                if option > 0:
                    there += share * (work.retreats[option - 1, j] - q[j])
                lanes[JOINTS + j * N_LANES + m] = there
    _measure_people(arm, top_z, N_ASIDE * N_LOOKS, work)
    for option in range(N_ASIDE):
        k, least = option * (N_LOOKS + 1), FAR
        for i in range(N_LOOKS):
            d = lanes[CLEARANCE + option * N_LOOKS + i]
            least = min(least, d)
            work.aside[k + i] = _cut(d)
        work.aside[k + N_LOOKS] = _cut(least)


@kernel()
def write_option_features(
    arm: Arm,
    top_z: float,
    query: ReachQuery,
    work: ReachObservationWorkspace,
    k: int,
    out: Obs,
) -> None:
    """Write the features of this module from ``out[k]`` on.

    Args:
        top_z: Height of people's tops [m].
        query: State of the robot and goal.
        work: Holds the robot placed at ``query.q`` with its Jacobian, the predicted people, and
            the result of :func:`predict_option_clearances`.
        k: Index of the first feature.
        out: Filled, shape (>= k + N_OPTION_FEATURES,).
    """
    q, qd, goal = query.q, query.qd, query.goal
    rate = base_motion(arm, work.robot, goal, work)
    arrival, least, p = 1.0 / rate, FAR, work.n[1]
    out[k] = min(OBS_BOUND, arrival)
    for i in range(N_LOOKS):
        t = STEP_S * LOOKS[i]
        share = min(1.0, rate * max(0.0, t - LAG_S))
        for j in range(6):
            rolled = 0.5 * qd[j] * min(t, ROLL_S)
            work.lanes[JOINTS + j * N_LANES + i] = q[j] + rolled + share * work.step[j]
    _measure_people(arm, top_z, N_LOOKS, work)
    for i in range(N_LOOKS):
        d = work.lanes[CLEARANCE + i]
        if STEP_S * LOOKS[i] <= arrival + AFTER_S:
            least = min(least, d)
        out[k + BASE + i] = _cut(d)
        there = work.predicted[LOOKS[i] - 1, p]
        distance = math.hypot(there[0] - goal[0], there[1] - goal[1])
        out[k + GOAL + i] = min(3.0, (distance - there[2]) / SCALE)
        out[k + GROWTH + i] = (there[2] - work.observed[4]) / GROWN
    out[k + BASE + N_LOOKS] = _cut(least)
    for i in range(work.aside.shape[0]):
        out[k + ASIDE + i] = work.aside[i]
