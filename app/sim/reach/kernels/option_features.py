"""What would come of each way a robot could go beside people who go on as forecast, compiled.

The ways are the straight one to the goal, standing still, and drawing back home or to either
side of home. For each the clearance of the robot is looked at at several times ahead, where
everybody walks straight on, as fast and as wide as ``forecast.py`` says from what is remembered
of them; a worker goes on at constant velocity. Of several people the nearest counts, way by way
and time by time, so that these features stand for any number of them.

A way is followed at full speed of its slowest joint; what a joint still has of its old speed,
and how it lags behind the new one, are allowed for.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.observation_layout import slices_of
from app.sim.geometry.capsules import copy_values
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.geometry.segments import FAR
from app.sim.people.kernels.pedestrian import AGE, N_PAST, PAST_RADIUS, PAST_SPEED
from app.sim.people.kernels.people import MAX_PEOPLE, PeopleGeometry, PeopleState
from app.sim.prediction.kernels.networks import N_TIMES, STEP_S, Forecaster, forecast
from app.sim.reach.kernels.base_controller import Prospect, base_motion
from app.sim.reach.kernels.observation import EVERYBODY, N_SEEN, Obs, show_person
from app.sim.robot.kernels.arm import Arm, RobotPose, new_robot_pose, place_robot

LOOKS = (1, 3, 6, 9, 12, 17, 24, 32)
"""When clearances are looked at, in steps of the forecast."""
N_LOOKS = len(LOOKS)
ASIDE = 0.9
"""How far to either side of home a robot may draw back, about its pan axis [rad]."""
N_ASIDE = 4
"""Ways that do not lead to the goal: standing still, home, either side of home."""
LAG_S = 0.05
"""By how much a joint lags behind a wanted speed while it accelerates [s]."""
ROLL_S = 0.1
"""Time in which a joint loses the speed it has [s]."""
NEAR = 0.2
"""Clearances are given in units of this [m] and cut at -1 and 2 units."""
AFTER_S = 0.15
"""Time after the arrival until which the straight way counts [s]."""
SCALE = 0.5
"""Gaps of person and goal are given in units of this and cut at three units [m]."""
GROWN = 0.2
"""Unit of the change of a radius [m]."""
SIZES = (
    ("arrival", 1),
    ("way_clearance", N_LOOKS + 1),
    ("aside_clearance", N_ASIDE * (N_LOOKS + 1)),
    ("goal_gap_ahead", N_LOOKS),
    ("radius_ahead", N_LOOKS),
)
"""Names and sizes of the groups of features; of each way the least clearance comes last."""
LAYOUT = slices_of(SIZES)
"""Slice of each group among these features."""
N_OPTION_FEATURES = sum(size for _, size in SIZES)
WAY, OTHERS = LAYOUT["way_clearance"].start, LAYOUT["aside_clearance"].start
GAP, GROWTH = LAYOUT["goal_gap_ahead"].start, LAYOUT["radius_ahead"].start


class Ways(NamedTuple):
    """Work space; made once, filled again and again."""

    forecaster: Forecaster
    """Says how a walker goes on."""
    told: Vec
    """Radius and way of one walker at each time ahead [m], shape (N_TIMES, 2)."""
    person: Vec
    """One person: x, y [m], vx, vy [m/s], r [m], growth [m/s], shape (6,)."""
    now: Vec
    """Everybody who counts, each as ``person``, shape (MAX_PEOPLE, 6)."""
    ahead: Vec
    """x, y and radius of everybody who counts at each time [m], (N_TIMES, MAX_PEOPLE, 3)."""
    number: NDArray[np.int64]
    """How many count, and which of them is seen, shape (2,)."""
    robot: RobotPose
    """The robot further along a way."""
    q: Vec
    """Its joints [rad], shape (6,)."""
    refuge: Vec
    """Postures to draw back to [rad], shape (N_ASIDE - 1, 6)."""
    aside: Vec
    """Features of the ways that do not lead to the goal, shape (N_ASIDE * (N_LOOKS + 1),)."""


def new_ways(arm: Arm, forecaster: Forecaster) -> Ways:
    """Return work space."""
    turn = np.zeros((N_ASIDE - 1, 6))
    turn[1, 0], turn[2, 0] = ASIDE, -ASIDE
    return Ways(
        forecaster=forecaster,
        told=np.zeros((N_TIMES, 2)),
        person=np.zeros(N_SEEN),
        now=np.zeros((MAX_PEOPLE, N_SEEN)),
        ahead=np.zeros((N_TIMES, MAX_PEOPLE, 3)),
        number=np.zeros(2, dtype=np.int64),
        robot=new_robot_pose(arm),
        q=np.zeros(6),
        refuge=np.clip(arm.home + turn, arm.limits.q_min, arm.limits.q_max),
        aside=np.zeros(N_ASIDE * (N_LOOKS + 1)),
    )


@kernel()
def foresee(
    state: PeopleState, e: int, who: int, seen: int, crowd: PeopleGeometry, ways: Ways
) -> None:
    """Fill ``ways.now``, ``ahead`` and ``number`` with everybody who counts.

    Args:
        state: Rows of the people.
        e: Environment.
        who: The one person that counts, workers first, or EVERYBODY.
        seen: The person a policy sees; below 0 for nobody.
        crowd: The people, placed as they are now.
        ways: Work space.
    """
    n_workers, n_people = state.q.shape[1], state.q.shape[1] + state.walkers.rows.shape[1]
    ways.number[0], ways.number[1] = 0, 0
    for p in range(-1 if n_people == 0 else 0, n_people):
        if who != EVERYBODY and p != who:
            continue
        if p == seen:
            ways.number[1] = ways.number[0]
        show_person(state, e, p, crowd, ways.person)
        copy_values(ways.person, ways.now[ways.number[0]])
        _go_on(state, e, p - n_workers, ways)
        ways.number[0] += 1


@kernel()
def _go_on(state: PeopleState, e: int, walker: int, ways: Ways) -> None:
    """Write where ``ways.person`` will be; a walker, from 0 on, as forecast."""
    told, person, k = ways.told, ways.person, ways.number[0]
    speed = math.hypot(person[2], person[3])
    for i in range(N_TIMES):
        told[i, 0], told[i, 1] = person[4], STEP_S * (i + 1) * speed
    if walker >= 0:
        row = state.walkers.rows[e, walker]
        radii = row[PAST_RADIUS : PAST_RADIUS + N_PAST]
        speeds = row[PAST_SPEED : PAST_SPEED + N_PAST]
        r, growth = person[4], person[5]
        forecast(ways.forecaster, r, growth, speed, row[AGE], radii, speeds, told)
    per_metre = 1.0 / speed if speed > 1e-9 else 0.0
    for i in range(N_TIMES):
        way = told[i, 1] * per_metre
        ways.ahead[i, k, 0] = person[0] + way * person[2]
        ways.ahead[i, k, 1] = person[1] + way * person[3]
        ways.ahead[i, k, 2] = told[i, 0]


@kernel(inline="always")
def _cut(d: float) -> float:
    return max(-1.0, min(2.0, d / NEAR))


@kernel(inline="always")
def _clearance(arm: Arm, top_z: float, i: int, ways: Ways) -> float:
    """Return the distance of the robot at ``ways.q`` and everybody, step ``i`` ahead [m]."""
    place_robot(arm, ways.q, ways.robot)
    least = FAR
    for p in range(ways.number[0]):
        x, y, r = ways.ahead[i, p, 0], ways.ahead[i, p, 1], ways.ahead[i, p, 2]
        d, _ = cylinder_clearance(ways.robot.columns, 0, x, y, r, top_z)
        least = min(least, d)
    return least


@kernel()
def look_aside(arm: Arm, top_z: float, q: Vec, qd: Vec, ways: Ways) -> None:
    """Fill ``ways.aside``; :func:`foresee` has been called.

    Args:
        arm: Robot in its cell.
        top_z: Height of people's tops [m].
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).
        ways: Work space.
    """
    for way in range(N_ASIDE):
        longest = 1e-9
        if way > 0:
            for j in range(6):
                left = abs(ways.refuge[way - 1, j] - q[j])
                longest = max(longest, left / arm.limits.qd_max[j])
        k, least = way * (N_LOOKS + 1), FAR
        for i in range(N_LOOKS):
            t = STEP_S * LOOKS[i]
            share = min(1.0, max(0.0, t - LAG_S) / longest)
            for j in range(6):
                ways.q[j] = q[j] + 0.5 * qd[j] * min(t, ROLL_S)
                if way > 0:
                    ways.q[j] += share * (ways.refuge[way - 1, j] - q[j])
            d = _clearance(arm, top_z, LOOKS[i] - 1, ways)
            least = min(least, d)
            ways.aside[k + i] = _cut(d)
        ways.aside[k + N_LOOKS] = _cut(least)


@kernel()
def put_ways(
    arm: Arm,
    top_z: float,
    q: Vec,
    qd: Vec,
    seen: Vec,
    goal: Vec,
    robot: RobotPose,
    prospect: Prospect,
    ways: Ways,
    k: int,
    out: Obs,
) -> None:
    """Write the features from ``out[k]`` on; :func:`look_aside` has been called.

    Args:
        arm: Robot in its cell.
        top_z: Height of people's tops [m].
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).
        seen: The person seen: x, y [m], vx, vy [m/s], r [m], growth [m/s], shape (6,).
        goal: Where the tcp shall be [m], shape (3,).
        robot: The robot, placed at ``q``, with its Jacobian.
        prospect: Work space.
        ways: Work space.
        k: Where to begin.
        out: Filled, shape (>= k + N_OPTION_FEATURES,).
    """
    rate = base_motion(arm, robot, goal, prospect)
    arrival, least, slot = 1.0 / rate, FAR, ways.number[1]
    out[k] = arrival
    for i in range(N_LOOKS):
        t, step = STEP_S * LOOKS[i], LOOKS[i] - 1
        share = min(1.0, rate * max(0.0, t - LAG_S))
        for j in range(6):
            rolled = 0.5 * qd[j] * min(t, ROLL_S)
            ways.q[j] = q[j] + rolled + share * prospect.step[j]
        d = _clearance(arm, top_z, step, ways)
        if t <= arrival + AFTER_S:
            least = min(least, d)
        out[k + WAY + i] = _cut(d)
        x, y, r = (
            ways.ahead[step, slot, 0],
            ways.ahead[step, slot, 1],
            ways.ahead[step, slot, 2],
        )
        out[k + GAP + i] = min(3.0, (math.hypot(x - goal[0], y - goal[1]) - r) / SCALE)
        out[k + GROWTH + i] = (r - seen[4]) / GROWN
    out[k + WAY + N_LOOKS] = _cut(least)
    for i in range(ways.aside.shape[0]):
        out[k + OTHERS + i] = ways.aside[i]
