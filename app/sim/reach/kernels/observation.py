"""Observations of the reach scenario: the plain state, or that and features, compiled.

The plain state is (4.30): q, qd, human x, y, vx, vy, r, target x, y, z. The features are that,
normalised, and more: relative to target and person, with clearances extrapolated at constant
velocity. All follow from positions and velocities of the moment and the time left; no hidden
history. ``LAYOUT`` names every slice.

A policy sees one person as a vertical cylinder, the nearest one: a walker as it is, a worker as
the cylinder about the pelvis that contains the capsules, nobody as one who stands far away.
Clearances are exact, to the real shapes of all people.

Source: (4.30). Deviates: features are added to it, since the raw state learned far more slowly
(1 % against 90 % after 2.7 k updates in trials).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels.trig import sincos
from app.sim.core.observation_layout import slices_of
from app.sim.geometry.capsules import RADIUS, UX, UY, X, Y, capsule_clearances, least
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.geometry.segments import FAR
from app.sim.human.kernels import kinematics as body
from app.sim.people.kernels.pedestrian import GROWTH, VX, VY, R
from app.sim.people.kernels.pedestrian import X as WALKER_X
from app.sim.people.kernels.pedestrian import Y as WALKER_Y
from app.sim.people.kernels.people import People, PeopleGeometry, PeopleState
from app.sim.pick.kernels.observation import HORIZONS, Sight, look_ahead, new_sight, see_person
from app.sim.reach.kernels import base_controller as reach_prospect
from app.sim.reach.kernels.base_controller import Prospect, new_prospect, put_prospect
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.arm import Arm, RobotPose

Obs = NDArray[np.float32]

N_STATE = 20
"""Length of the plain state (4.30)."""
N_SEEN = 6
"""Numbers by which a person is seen: x, y [m], vx, vy [m/s], r [m] and its growth [m/s]."""
NOBODY = (-2.0, 2.0, 0.0, 0.0, 0.2, 0.0)
"""The person assumed where nobody is there: one who stands in the corner of the walking area
farthest from the robot. Beside one farther away than any met in training, policies fail."""
EVERYBODY = -1
"""In place of a person's number: all of them."""
CENTER_Y = 1.25
"""Middle of the walking area, from which the person's y is counted [m]."""
SCALE = 0.5
"""Clearances are given in units of this and cut at three units [m]."""
TIME_SCALE = 2.5
"""Time left is given in units of this [s]."""

STATE_SIZES = (("q", 6), ("qd", 6), ("human", 5), ("goal", 3))
"""Groups of the plain state (4.30)."""
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
    *reach_prospect.SIZES,
)

LAYOUT = slices_of(SIZES)
"""Slice of each group of features in the observation."""
N_FEATURES = sum(size for _, size in SIZES)
"""Length of the observation."""
BASE_START = LAYOUT["base"].start
"""Where the base motion starts, for the residual action."""


class ReachSight(NamedTuple):
    """Work space of one observation; made once, filled again and again."""

    person: Sight
    """A worker's shape now and ahead."""
    gap: Vec
    """Distance of each of a worker's capsules to the robot [m], shape (16,)."""
    seen: Vec
    """The person a policy sees: x, y [m], vx, vy [m/s], r [m], growth [m/s], shape (6,)."""
    ahead: Vec
    """Clearance at each time ahead [m], shape (3,)."""
    prospect: Prospect
    """Where the base motion leads."""


def new_reach_sight(arm: Arm) -> ReachSight:
    """Return work space."""
    sight = new_sight()
    return ReachSight(
        sight, np.zeros(sight.now.shape[1]), np.zeros(N_SEEN), np.zeros(3), new_prospect(arm)
    )


@kernel()
def enclosing_radius(columns: Vec, first: int, n: int, x: float, y: float) -> float:
    """Return the radius of the upright cylinder about an axis that contains capsules [m].

    Args:
        columns: Capsules as columns, shape (9, m).
        first: First column to contain.
        n: Number of columns.
        x: Axis [m].
        y: Axis [m].
    """
    widest = 0.0
    for k in range(first, first + n):
        dx, dy = columns[X, k] - x, columns[Y, k] - y
        start = math.hypot(dx, dy)
        end = math.hypot(dx + columns[UX, k], dy + columns[UY, k])
        widest = max(widest, max(start, end) + columns[RADIUS, k])
    return widest


@kernel(inline="always")
def show_person(state: PeopleState, e: int, who: int, crowd: PeopleGeometry, seen: Vec) -> None:
    """Write one person of environment ``e`` as a cylinder.

    Args:
        state: Rows of the people.
        e: Environment.
        who: The person: workers first, then walkers; below 0 for nobody.
        crowd: The people, placed as they are now.
        seen: Filled with x, y [m], vx, vy [m/s], r [m], growth [m/s], shape (6,).
    """
    n_workers = state.q.shape[1]
    if who < 0:
        for i in range(N_SEEN):
            seen[i] = NOBODY[i]
    elif who < n_workers:
        seen[0], seen[1] = state.q[e, who, 0], state.q[e, who, 1]
        seen[2], seen[3] = state.qd[e, who, 0], state.qd[e, who, 1]
        n = body.N_CAPSULES
        seen[4] = enclosing_radius(crowd.columns, who * n, n, seen[0], seen[1])
        seen[5] = 0.0
    else:
        rows, k = state.walkers.rows, who - n_workers
        seen[0], seen[1] = rows[e, k, WALKER_X], rows[e, k, WALKER_Y]
        seen[2], seen[3] = rows[e, k, VX], rows[e, k, VY]
        seen[4], seen[5] = rows[e, k, R], rows[e, k, GROWTH]


@kernel(inline="always")
def put_state(q: Vec, qd: Vec, seen: Vec, goal: Vec, out: Obs) -> None:
    """Write the plain state (4.30), shape (N_STATE,)."""
    for j in range(6):
        out[j], out[6 + j] = q[j], qd[j]
    for i in range(5):
        out[12 + i] = seen[i]
    for i in range(3):
        out[17 + i] = goal[i]


@kernel(inline="always")
def clearances_ahead(
    people: People, state: PeopleState, e: int, who: int, robot: Vec, sight: ReachSight
) -> None:
    """Write the clearance of the robot as it stands to people at ``HORIZONS``.

    Args:
        people: Shared data.
        state: Rows of the people, who go on at constant velocity.
        e: Environment.
        who: The one person that counts, or EVERYBODY.
        robot: The robot's capsules as columns, shape (9, n).
        sight: Work space; ``ahead`` is filled.
    """
    person, ahead = sight.person, sight.ahead
    for i in range(3):
        ahead[i] = FAR
    n_workers = state.q.shape[1]
    for w in range(n_workers):
        if who != EVERYBODY and who != w:
            continue
        see_person(people.floor_z, state.q[e, w], state.qd[e, w], state.size[e, w], person)
        for i in range(3):
            look_ahead(person.now, person.later, HORIZONS[i], person.moved)
            capsule_clearances(robot, person.moved, sight.gap)
            ahead[i] = min(ahead[i], least(sight.gap)[0])
    rows = state.walkers.rows
    for k in range(rows.shape[1]):
        if who != EVERYBODY and who != n_workers + k:
            continue
        for i in range(3):
            x = rows[e, k, WALKER_X] + HORIZONS[i] * rows[e, k, VX]
            y = rows[e, k, WALKER_Y] + HORIZONS[i] * rows[e, k, VY]
            d, _ = cylinder_clearance(robot, 0, x, y, rows[e, k, R], people.top_z)
            ahead[i] = min(ahead[i], d)


@kernel(inline="always")
def _scaled(d: float) -> float:
    return min(3.0, d / SCALE)


@kernel(error_model="numpy")
def put_features(
    q: Vec,
    qd: Vec,
    qd_max: Vec,
    seen: Vec,
    goal: Vec,
    rot: Vec,
    pos: Vec,
    tcp: Vec,
    jacobian: Vec,
    clearance: float,
    ahead: Vec,
    time_left: float,
    out: Obs,
) -> None:
    """Write the features of one state.

    Args:
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).
        qd_max: Speed limits [rad/s], shape (6,).
        seen: The person seen: x, y [m], vx, vy [m/s], r [m], growth [m/s], shape (6,).
        goal: Where the tcp shall be [m], shape (3,).
        rot: R_world_link, shape (7, 3, 3).
        pos: Origins of the links [m], shape (7, 3).
        tcp: Tool centre point [m], shape (3,).
        jacobian: Work space, shape (3, 6).
        clearance: Distance of robot and people [m].
        ahead: The same ahead [m], shape (3,).
        time_left: Time left [s].
        out: Filled, shape (N_FEATURES,).
    """
    for j in range(6):
        out[j], out[6 + j] = q[j] / math.pi, qd[j] / qd_max[j]
        out[20 + j], out[26 + j] = sincos(q[j])
    for i in range(5):
        out[12 + i] = seen[i]
    out[13] = seen[1] - CENTER_Y
    kinematics.tcp_jacobian(rot, pos, tcp, jacobian)
    square = 0.0
    for i in range(3):
        speed, way = 0.0, goal[i] - tcp[i]
        for j in range(6):
            speed += jacobian[i, j] * qd[j]
        square += way * way
        out[17 + i], out[32 + i] = goal[i], tcp[i]
        out[35 + i], out[38 + i] = 2.0 * way, speed
        out[48 + i] = _scaled(ahead[i])
    for i in range(2):
        out[41 + i] = seen[i] - tcp[i]
        out[43 + i] = seen[i] - pos[3, i]
        out[45 + i] = seen[i] - goal[i]
    out[47] = _scaled(clearance)
    out[51] = 2.0 * math.sqrt(square)
    out[52] = time_left / TIME_SCALE


@kernel(inline="always")
def describe(
    arm: Arm,
    top_z: float,
    q: Vec,
    qd: Vec,
    goal: Vec,
    clearance: float,
    time_left: float,
    robot: RobotPose,
    sight: ReachSight,
    out: Obs,
) -> None:
    """Write the features of a state; ``sight.seen`` and ``sight.ahead`` are filled already.

    Args:
        arm: Robot in its cell.
        top_z: Height of people's tops [m].
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).
        goal: Where the tcp shall be [m], shape (3,).
        clearance: Distance of robot and people [m].
        time_left: Time left [s].
        robot: The robot, placed at ``q``.
        sight: What is seen of the people.
        out: Filled, shape (N_FEATURES,).
    """
    put_features(
        q,
        qd,
        arm.limits.qd_max,
        sight.seen,
        goal,
        robot.rot,
        robot.pos,
        robot.tcp,
        robot.jacobian,
        clearance,
        sight.ahead,
        time_left,
        out,
    )
    start = N_FEATURES - reach_prospect.N_PROSPECT
    put_prospect(arm, top_z, q, qd, sight.seen, goal, robot, sight.prospect, start, out)
