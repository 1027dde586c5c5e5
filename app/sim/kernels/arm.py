"""What the kernels know of the robot in its cell, and the contact test of one period, compiled.

Contact between poses is found by conservative advancement: at a pose with clearance ``d``
nothing can touch before ``d / v`` seconds, with ``v`` a bound on how fast any two points can
approach; so the test jumps ahead by that much, at least ``FINEST_STEP``, and reports contact
when the clearance falls below what the finest step could hide. It can be early by about a
millimetre, never late. Within a period the robot follows its polynomial, a person moves
linearly in joint space.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.sim.kernels import body, kinematics
from app.sim.kernels.geometry import (
    FAR,
    pair_distance2,
    place_capsules,
    set_clearance,
    spheres_apart,
)
from app.sim.ports import Vec

NO_CONTACT, HUMAN_CONTACT, CELL_CONTACT, SELF_CONTACT = range(4)
CONTROLLED = 5
"""Joints a policy moves; the sixth turns the tool about itself and is held (thesis 5.3.1)."""
FINEST_STEP = 1e-3
"""Shortest interval the contact test looks at [s]."""
FIRST_OVER_TABLE = 2
"""Capsules before this one (base, shoulder) stand on the table and never leave it."""


class Arm(NamedTuple):
    """Limits, tool and capsules of the robot in its cell."""

    q_min: Vec
    """Lower joint limits [rad], shape (6,)."""
    q_max: Vec
    """Upper joint limits [rad], shape (6,)."""
    qd_max: Vec
    """Speed limits [rad/s], shape (6,)."""
    qdd_max: Vec
    """Acceleration limits [rad/s^2], shape (6,)."""
    home: Vec
    """Home posture [rad], shape (6,)."""
    dt: float
    """Control period [s]."""
    tool_length: float
    """From flange to tcp [m]."""
    link: NDArray[np.int64]
    """Link of each capsule, shape (n,)."""
    p0: Vec
    """Ends in the link's frame [m], shape (n, 3)."""
    p1: Vec
    """Other ends in the link's frame [m], shape (n, 3)."""
    radius: Vec
    """Radii [m], shape (n,)."""
    pairs: NDArray[np.int64]
    """Capsule pairs tested for self-collision, shape (m, 2)."""
    lever: Vec
    """Greatest distance of any point moved by a joint from its axis [m], shape (6,)."""
    pelvis_z: float
    """Height of the person's pelvis [m]."""
    floor_z: float
    """Height of the floor [m]."""


class Pose(NamedTuple):
    """Work space of one pose of robot and person; made once, filled again and again."""

    rot: Vec
    """R_world_link, shape (7, 3, 3)."""
    pos: Vec
    """Origins of the links [m], shape (7, 3)."""
    robot: Vec
    """Robot capsules' ends [m], shape (n, 2, 3)."""
    points: Vec
    """The person's points [m], shape (N_POINTS, 3)."""
    frames: Vec
    """The person's orientations, shape (N_FRAMES, 3, 3)."""
    human: Vec
    """The person's capsules' ends [m], shape (12, 2, 3)."""


@njit(cache=True)
def new_pose(n_robot: int) -> Pose:
    """Return uninitialised work space for a robot of ``n_robot`` capsules."""
    return Pose(
        np.empty((7, 3, 3)),
        np.empty((7, 3)),
        np.empty((n_robot, 2, 3)),
        np.empty((body.N_POINTS, 3)),
        np.empty((body.N_FRAMES, 3, 3)),
        np.empty((body.N_CAPSULES, 2, 3)),
    )


@njit(cache=True)
def place(arm: Arm, q: Vec, human_q: Vec, pose: Pose) -> None:
    """Fill ``pose`` for robot joints ``q`` [rad] and human joints ``human_q`` [m, rad]."""
    place_robot(arm, q, pose)
    body.points_and_frames(human_q, arm.pelvis_z, pose.points, pose.frames)
    body.capsules(pose.points, pose.frames, arm.floor_z, pose.human)


@njit(cache=True)
def place_robot(arm: Arm, q: Vec, pose: Pose) -> None:
    """Fill the robot's part of ``pose``."""
    kinematics.link_poses(q, pose.rot, pose.pos)
    place_capsules(pose.rot, pose.pos, arm.link, arm.p0, arm.p1, 0, pose.robot)


@njit(cache=True)
def human_clearance(arm: Arm, pose: Pose) -> tuple[float, int, int]:
    """Return the distance of robot and person [m] and the two nearest capsules."""
    return set_clearance(
        pose.robot, arm.radius, pose.human, body.RADII, 0, body.N_CAPSULES - 1, FAR
    )


@njit(cache=True)
def table_clearance(arm: Arm, pose: Pose) -> tuple[float, int]:
    """Return the distance of the moving links to the plane z = 0 [m] and the nearest capsule.

    The table's plane is taken as endless: nothing of the robot may go below it anywhere.
    """
    best, link = FAR, 0
    for k in range(FIRST_OVER_TABLE, arm.link.shape[0]):
        d = min(pose.robot[k, 0, 2], pose.robot[k, 1, 2]) - arm.radius[k]
        if d < best:
            best, link = d, k
    return best, link


@njit(cache=True)
def self_clearance(arm: Arm, pose: Pose) -> tuple[float, int]:
    """Return the least distance of the tested capsule pairs [m] and the pair's number."""
    best, pair = FAR, 0
    for i in range(arm.pairs.shape[0]):
        a, b = pose.robot[arm.pairs[i, 0]], pose.robot[arm.pairs[i, 1]]
        radii = arm.radius[arm.pairs[i, 0]] + arm.radius[arm.pairs[i, 1]]
        if spheres_apart(a, b) - radii >= best:
            continue
        d = math.sqrt(pair_distance2(a, b)) - radii
        if d < best:
            best, pair = d, i
    return best, pair


@njit(cache=True)
def robot_speed_bound(arm: Arm, qd0: Vec, c: Vec, before: Vec, after: Vec) -> float:
    """Return a bound on the speed of any point of the robot in a period [m/s].

    A point's mean velocity over the period is its chord over ``dt``, and its velocity never
    differs from the mean by more than ``a dt / 2``, with ``a`` a bound on its acceleration:
    ``sum |qdd_j| l_j + (sum |qd_j|) (sum |qd_j| l_j)`` for levers ``l_j`` that do not grow
    along the chain. The ends of a capsule bound the points between them.

    Args:
        arm: Robot in its cell.
        qd0: Joint speeds at the start [rad/s], shape (6,).
        c: Coefficients of the period [rad/s^2], shape (6,).
        before: Ends of the capsules at the start [m], shape (n, 2, 3).
        after: Ends of the capsules at the end [m], shape (n, 2, 3).
    """
    angular, swing, push = 0.0, 0.0, 0.0
    for j in range(6):
        fastest = max(abs(qd0[j]), abs(qd0[j] + 2.0 * c[j] * arm.dt))
        angular += fastest
        swing += fastest * arm.lever[j]
        push += 2.0 * abs(c[j]) * arm.lever[j]
    chord = longest_chord(before, after)
    return min(swing, chord / arm.dt + 0.5 * arm.dt * (push + angular * swing))


@njit(cache=True)
def longest_chord(before: Vec, after: Vec) -> float:
    """Return the farthest any capsule end moves [m]; both arguments of shape (n, 2, 3)."""
    square = 0.0
    for k in range(before.shape[0]):
        for end in range(2):
            x = after[k, end, 0] - before[k, end, 0]
            y = after[k, end, 1] - before[k, end, 1]
            z = after[k, end, 2] - before[k, end, 2]
            square = max(square, x * x + y * y + z * z)
    return math.sqrt(square)


@njit(cache=True)
def human_speed_bound(before: Vec, after: Vec, dt: float) -> float:
    """Return a bound on the speed of any point of the person in a period [m/s].

    From the chords of the capsules' ends, shape (12, 2, 3), with 5 % for the arc: enough for
    turns up to one radian per period.
    """
    return 1.05 * longest_chord(before, after) / dt


@njit(cache=True)
def contact_at(
    arm: Arm, pose: Pose, robot_speed: float, human_speed: float
) -> tuple[int, int, int, float, float]:
    """Test one pose.

    Returns:
        Kind of contact, robot capsule (or self pair), human capsule, clearance to the person
        [m], and the time for which nothing can touch [s].
    """
    approach = robot_speed + human_speed
    d_human, link, part = human_clearance(arm, pose)
    if d_human <= 0.5 * FINEST_STEP * approach:
        return HUMAN_CONTACT, link, part, d_human, 0.0
    d_table, low = table_clearance(arm, pose)
    if d_table <= 0.5 * FINEST_STEP * robot_speed:
        return CELL_CONTACT, low, 0, d_human, 0.0
    d_self, pair = self_clearance(arm, pose)
    if d_self <= FINEST_STEP * robot_speed:
        return SELF_CONTACT, pair, 0, d_human, 0.0
    safe = min(
        d_human / (approach + 1e-9),
        min(d_table, 0.5 * d_self) / (robot_speed + 1e-9),
    )
    return NO_CONTACT, link, part, d_human, safe


@njit(cache=True)
def sweep(
    arm: Arm,
    q0: Vec,
    qd0: Vec,
    c: Vec,
    human_q0: Vec,
    human_q1: Vec,
    before: Pose,
    pose: Pose,
) -> tuple[int, int, int, float]:
    """Test one whole period for contact, between its ends too.

    Mostly the end of the period settles it: where its clearance is more than anything can cover
    in the period, nothing touched on the way either. Otherwise the period is walked through.

    Args:
        arm: Robot in its cell.
        q0: Joint positions at the start [rad], shape (6,).
        qd0: Joint speeds at the start [rad/s], shape (6,).
        c: Coefficients of the period [rad/s^2], shape (6,).
        human_q0: The person's joints at the start [m, rad], shape (18,).
        human_q1: The person's joints at the end [m, rad], shape (18,).
        before: Work space; holds the start of the period afterwards.
        pose: Work space; holds the last pose looked at, the end of the period if no contact.

    Returns:
        Kind of contact, robot capsule (or self pair), human capsule, clearance to the person at
        the last pose [m].
    """
    q, human_q = np.empty(6), np.empty(18)
    place(arm, q0, human_q0, before)
    _blend(q0, qd0, c, human_q0, human_q1, arm.dt, arm.dt, q, human_q)
    place(arm, q, human_q, pose)
    robot_speed = robot_speed_bound(arm, qd0, c, before.robot, pose.robot)
    human_speed = human_speed_bound(before.human, pose.human, arm.dt)
    kind, link, part, d, safe = contact_at(arm, pose, robot_speed, human_speed)
    if kind == NO_CONTACT and safe >= arm.dt:
        return kind, link, part, d
    x = 0.0
    for _ in range(int(arm.dt / FINEST_STEP) + 2):
        _blend(q0, qd0, c, human_q0, human_q1, x, arm.dt, q, human_q)
        place(arm, q, human_q, pose)
        kind, link, part, d, safe = contact_at(arm, pose, robot_speed, human_speed)
        if kind != NO_CONTACT or x >= arm.dt:
            break
        x = min(arm.dt, x + max(safe, FINEST_STEP))
    return kind, link, part, d


@njit(cache=True)
def _blend(
    q0: Vec,
    qd0: Vec,
    c: Vec,
    human_q0: Vec,
    human_q1: Vec,
    x: float,
    dt: float,
    q: Vec,
    human_q: Vec,
) -> None:
    """Write robot and human joints at time ``x`` of a period of length ``dt`` [s]."""
    for j in range(6):
        q[j] = q0[j] + qd0[j] * x + c[j] * x * x
    for j in range(18):
        human_q[j] = human_q0[j] + (human_q1[j] - human_q0[j]) * (x / dt)
