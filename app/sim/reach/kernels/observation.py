"""Observation of the reach scenario: the raw state, or the raw state and features (compiled).

The raw state is (4.30): q, qd, the person's x, y, vx, vy, r, and the goal's x, y, z. The
features are the normalised state and more: relative to goal and person, with clearances
extrapolated at constant velocity. All follow from present positions and velocities and the time
left; there is no hidden history. ``LAYOUT`` gives the slice of each group.

A policy observes the nearest person as a vertical cylinder: a pedestrian as it is, a worker as
the cylinder about the pelvis that contains the body, and ``NO_PERSON`` in an empty cell.
Clearances are exact and consider all people, except ``look_ahead_base``, the clearance along
the base motion: it is that of the observed person alone, as the cylinder.

Source: (4.30). Deviates: features are added, because the raw state learned far more slowly (1 %
against 90 % after 2.7 k updates in trials).
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR, kernel
from app.sim.core.kernels.trig import sincos
from app.sim.core.observation_layout import OBS_BOUND, slices_of
from app.sim.geometry.capsules import RADIUS, UX, UY, X, Y, capsule_clearances, least
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.human.kernels import kinematics as body
from app.sim.people.kernels.pedestrian import GROWTH, VX, VY, R
from app.sim.people.kernels.pedestrian import X as WALKER_X
from app.sim.people.kernels.pedestrian import Y as WALKER_Y
from app.sim.people.kernels.people import People, PeopleGeometry, PeopleState
from app.sim.reach.kernels import base_controller
from app.sim.reach.kernels.base_controller import write_approach_features
from app.sim.reach.kernels.observation_workspace import (
    N_PERSON,
    ReachObservationWorkspace,
    ReachQuery,
)
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.arm import Arm
from app.sim.scenario.kernels.person_observation import (
    HORIZONS,
    Obs,
    extrapolate_capsules,
    place_person,
)

N_STATE = 20
"""Length of the raw state (4.30)."""
NO_PERSON = (-2.0, 2.0, 0.0, 0.0, 0.2, 0.0)
"""Person that policies observe in an empty cell: at rest in the corner of the walking area
farthest from the robot. Policies fail beside a person farther away than any in training."""
ALL_PEOPLE = -1
"""In place of a person's number: all people."""
CENTER_Y = 1.25
"""Middle of the walking area, subtracted from the person's y [m]."""
SCALE = 0.5
"""Unit of clearances [m]; they are clipped at three units."""
TIME_SCALE = 2.5
"""Unit of the time left [s]."""

STATE_SIZES = (("q", 6), ("qd", 6), ("human", 5), ("goal", 3))
"""Groups of the raw state (4.30)."""
SIZES = (
    *STATE_SIZES,
    ("sin_q", 6),
    ("cos_q", 6),
    ("tcp", 3),
    ("goal_minus_tcp", 3),
    ("tcp_velocity", 3),
    ("human_minus_tcp", 2),
    ("human_minus_elbow", 2),
    ("human_minus_goal", 2),
    ("clearance", 1),
    ("look_ahead", 3),
    ("distance", 1),
    ("time_left", 1),
    *base_controller.SIZES,
)

LAYOUT = slices_of(SIZES)
"""Slice of each group of features in the observation."""
N_FEATURES = sum(size for _, size in SIZES)
"""Length of the observation."""
BASE_START = LAYOUT["base"].start
"""Index of the base motion, for the residual action."""


@kernel()
def enclosing_radius(capsules: Vec, first: int, n: int, x: float, y: float) -> float:
    """Return the radius of the upright cylinder about an axis that contains capsules [m].

    Args:
        capsules: Set of capsules (``geometry/capsules.py``), shape (9, m).
        first: First capsule to contain.
        n: Number of capsules to contain.
        x: x coordinate of the axis in the world frame [m].
        y: y coordinate of the axis in the world frame [m].
    """
    widest = 0.0
    for k in range(first, first + n):
        dx, dy = capsules[X, k] - x, capsules[Y, k] - y
        start = math.hypot(dx, dy)
        end = math.hypot(dx + capsules[UX, k], dy + capsules[UY, k])
        widest = max(widest, max(start, end) + capsules[RADIUS, k])
    return widest


@kernel(inline="always")
def write_person(
    state: PeopleState, e: int, p: int, geometry: PeopleGeometry, out: Vec
) -> None:
    """Write one person of environment ``e`` as a cylinder.

    Args:
        e: Environment.
        p: The person: workers first, then pedestrians; below 0 for NO_PERSON.
        geometry: The people, placed as they are now.
        out: Filled with x, y [m], vx, vy [m/s], r [m], growth [m/s], shape (N_PERSON,).
    """
    n_workers = state.q.shape[1]
    if p < 0:
        for i in range(N_PERSON):
            out[i] = NO_PERSON[i]
    elif p < n_workers:
        out[0], out[1] = state.q[e, p, 0], state.q[e, p, 1]
        out[2], out[3] = state.qd[e, p, 0], state.qd[e, p, 1]
        n = body.N_CAPSULES
        out[4] = enclosing_radius(geometry.capsules, p * n, n, out[0], out[1])
        out[5] = 0.0
    else:
        rows, k = state.walkers.rows, p - n_workers
        out[0], out[1] = rows[e, k, WALKER_X], rows[e, k, WALKER_Y]
        out[2], out[3] = rows[e, k, VX], rows[e, k, VY]
        out[4], out[5] = rows[e, k, R], rows[e, k, GROWTH]


@kernel(inline="always")
def write_raw_state(query: ReachQuery, person: Vec, out: Obs) -> None:
    """Write the raw state (4.30), shape (N_STATE,)."""
    for j in range(6):
        out[j], out[6 + j] = query.q[j], query.qd[j]
    for i in range(5):
        out[12 + i] = person[i]
    for i in range(3):
        out[17 + i] = query.goal[i]


@kernel(inline="always")
def extrapolate_clearances(
    people: People, state: PeopleState, e: int, which: int, work: ReachObservationWorkspace
) -> None:
    """Fill ``work.clearances_ahead`` with those of the robot at rest to people at ``HORIZONS``.

    Args:
        state: State of the people, who move at constant velocity.
        e: Environment.
        which: The one person that counts, or ALL_PEOPLE.
        work: Holds the placed robot.
    """
    robot, person, found = work.robot.capsules, work.body, work.clearances_ahead
    for i in range(3):
        found[i] = FAR
    n_workers = state.q.shape[1]
    for w in range(n_workers):
        if which != ALL_PEOPLE and which != w:
            continue
        place_person(people.floor_z, state.q[e, w], state.qd[e, w], state.size[e, w], person)
        for i in range(3):
            extrapolate_capsules(person.now, person.later, HORIZONS[i], person.moved)
            capsule_clearances(robot, person.moved, work.clearance)
            found[i] = min(found[i], least(work.clearance)[0])
    rows = state.walkers.rows
    for k in range(rows.shape[1]):
        if which != ALL_PEOPLE and which != n_workers + k:
            continue
        for i in range(3):
            x = rows[e, k, WALKER_X] + HORIZONS[i] * rows[e, k, VX]
            y = rows[e, k, WALKER_Y] + HORIZONS[i] * rows[e, k, VY]
            d, _ = cylinder_clearance(robot, 0, x, y, rows[e, k, R], people.top_z)
            found[i] = min(found[i], d)


@kernel(inline="always")
def _scaled(d: float) -> float:
    return min(3.0, d / SCALE)


@kernel(error_model="numpy")
def _write_state_features(
    arm: Arm, query: ReachQuery, clearance: float, work: ReachObservationWorkspace, out: Obs
) -> None:
    q, qd, goal, person, robot = query.q, query.qd, query.goal, work.observed, work.robot
    tcp, pos, jacobian = robot.tcp, robot.pos, robot.jacobian
    for j in range(6):
        out[j], out[6 + j] = q[j] / math.pi, qd[j] / arm.limits.qd_max[j]
        out[20 + j], out[26 + j] = sincos(q[j])
    for i in range(5):
        out[12 + i] = person[i]
    out[13] = person[1] - CENTER_Y
    kinematics.tcp_jacobian(robot.rot, pos, tcp, jacobian)
    square = 0.0
    for i in range(3):
        speed, offset = 0.0, goal[i] - tcp[i]
        for j in range(6):
            speed += jacobian[i, j] * qd[j]
        square += offset * offset
        out[17 + i], out[32 + i] = goal[i], tcp[i]
        out[35 + i], out[38 + i] = 2.0 * offset, speed
        out[48 + i] = _scaled(work.clearances_ahead[i])
    for i in range(2):
        out[41 + i] = person[i] - tcp[i]
        out[43 + i] = person[i] - pos[3, i]
        out[45 + i] = person[i] - goal[i]
    out[47] = _scaled(clearance)
    out[51] = 2.0 * math.sqrt(square)


@kernel(inline="always")
def write_features(
    arm: Arm,
    top_z: float,
    query: ReachQuery,
    clearance: float,
    time_left: float,
    work: ReachObservationWorkspace,
    out: Obs,
) -> None:
    """Write the features of a state.

    Args:
        top_z: Height of people's tops [m].
        query: State of the robot and goal.
        clearance: Clearance of robot and people [m].
        time_left: Time left [s].
        work: Holds the robot placed at ``query.q``, ``observed`` and ``clearances``.
        out: Filled, shape (>= N_FEATURES,).
    """
    _write_state_features(arm, query, clearance, work, out)
    out[52] = min(OBS_BOUND, time_left / TIME_SCALE)
    start = N_FEATURES - base_controller.N_APPROACH
    write_approach_features(arm, top_z, query, work, start, out)
