"""The robot in its cell: limits, capsules, poses, clearances and speed bounds, compiled."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR, FAST, kernel
from app.sim.geometry.box import box_clearance
from app.sim.geometry.capsules import (
    RADIUS,
    UX,
    UZ,
    X,
    Z,
    greatest_displacement,
    least,
    pair_distances,
)
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.joints import JointLimits, JointPath

CONTROLLED = 5
"""Joints that a policy moves; the sixth turns the tool about itself (thesis 5.3.1)."""
FIRST_MOVING = 1
"""The capsule before this one, the base, does not move."""
FIRST_OVER_TABLE = 2
"""Capsules before this one (base, shoulder) stand on the table and never leave it."""


class Arm(NamedTuple):
    """Limits, tool, capsules and surroundings of the robot in its cell."""

    limits: JointLimits
    """Joint limits."""
    home: Vec
    """Home configuration [rad], shape (6,)."""
    dt: float
    """Control period [s]."""
    lengths: kinematics.LinkLengths
    """Lengths of links and tool."""
    link: NDArray[np.int64]
    """Link of each capsule, shape (n,)."""
    p0: Vec
    """Ends in the link's frame [m], shape (n, 3)."""
    span: Vec
    """Other ends less these [m], shape (n, 3)."""
    capsules: Vec
    """Template of the capsules as columns: lengths and radii, shape (9, n)."""
    first: NDArray[np.int64]
    """First capsule of each pair tested for self-collision, shape (m,)."""
    second: NDArray[np.int64]
    """Second capsule of each pair, shape (m,)."""
    lever: Vec
    """Greatest distance of any point moved by a joint from its axis [m], shape (6,)."""
    boxes: Vec
    """Fixed obstacles: centre, half sizes [m], yaw [rad], shape (n_boxes, 7)."""


class RobotPose(NamedTuple):
    """Work space of one pose of the robot."""

    rot: Vec
    """R_world_link, shape (7, 3, 3)."""
    pos: Vec
    """Origins of the links [m], shape (7, 3)."""
    capsules: Vec
    """The robot's capsules, shape (9, n)."""
    pair: Vec
    """Distances of the pairs tested for self-collision [m], shape (m,)."""
    tcp: Vec
    """Tool centre point [m], shape (3,)."""
    jacobian: Vec
    """The tcp's linear Jacobian [m/rad], shape (3, 6)."""


def new_robot_pose(arm: Arm) -> RobotPose:
    """Return work space that is not placed yet."""
    return RobotPose(
        np.empty((7, 3, 3)),
        np.empty((7, 3)),
        arm.capsules.copy(),
        np.empty(len(arm.first)),
        np.empty(3),
        np.empty((3, 6)),
    )


@kernel(inline="always")
def place_robot(arm: Arm, q: Vec, pose: RobotPose) -> None:
    """Fill ``pose`` for joints ``q`` [rad], shape (6,)."""
    kinematics.link_poses(arm.lengths, q, pose.rot, pose.pos)
    kinematics.tcp_point(arm.lengths, pose.rot, pose.pos, pose.tcp)
    place_capsules(pose.rot, pose.pos, arm.link, arm.p0, arm.span, 0, pose.capsules)


@kernel(error_model="numpy", fastmath=FAST)
def place_capsules(
    rot: Vec,
    pos: Vec,
    link: NDArray[np.int64],
    p0: Vec,
    span: Vec,
    first: int,
    out: Vec,
) -> None:
    """Write capsules tied to links.

    Args:
        rot: R_world_link, shape (7, 3, 3).
        pos: Origins of the links [m], shape (7, 3).
        link: Link of each capsule, shape (n,).
        p0: Ends in the link's frame [m], shape (n, 3).
        span: Other ends less these [m], shape (n, 3).
        first: Column of the first capsule.
        out: Capsules as columns, shape (9, >= first + n); rows ``X`` to ``UZ`` are filled.
    """
    for k in range(link.shape[0]):
        body = link[k]
        x, y, z = p0[k, 0], p0[k, 1], p0[k, 2]
        u, v, w = span[k, 0], span[k, 1], span[k, 2]
        for i in range(3):
            a, b, c = rot[body, i, 0], rot[body, i, 1], rot[body, i, 2]
            out[i, first + k] = pos[body, i] + a * x + b * y + c * z
            out[3 + i, first + k] = a * u + b * v + c * w


@kernel(inline="always")
def self_clearance(arm: Arm, pose: RobotPose) -> tuple[float, int]:
    """Return the least distance of the tested capsule pairs [m] and the index of the pair."""
    pair_distances(pose.capsules, arm.first, arm.second, pose.pair)
    return least(pose.pair)


@kernel()
def table_clearance(robot: Vec) -> tuple[float, int]:
    """Return the distance of the moving links to the plane z = 0 [m] and the nearest capsule.

    The table's plane is infinite: no part of the robot may go below it anywhere.

    Args:
        robot: The robot's capsules as columns, shape (9, n).
    """
    best, link = FAR, 0
    for k in range(FIRST_OVER_TABLE, robot.shape[1]):
        d = robot[Z, k] + min(0.0, robot[UZ, k]) - robot[RADIUS, k]
        if d < best:
            best, link = d, k
    return best, link


@kernel(inline="always")
def cell_clearance(arm: Arm, robot: Vec) -> tuple[float, int, int]:
    """Return the distance of the moving links to the table and the boxes [m].

    Returns:
        Distance, the nearest capsule, and its nearest obstacle: -1 for the table, else the
        index of the box.
    """
    best, link = table_clearance(robot)
    near = -1
    if arm.boxes.shape[0] > 0:
        d, k, box = box_clearance(robot, FIRST_MOVING, arm.boxes)
        if d < best:
            best, link, near = d, k, box
    return best, link, near


@kernel(error_model="numpy")
def path_bounds(arm: Arm, path: JointPath, s_end: float) -> tuple[float, float]:
    """Return bounds on the first and second derivative along a path of any robot point.

    The second is ``sum |q''_j| l_j + (sum |q'_j|) (sum |q'_j| l_j)`` for levers ``l_j`` that do
    not grow along the chain.

    Args:
        s_end: End of the path [s].

    Returns:
        ``|dp/ds|`` [m/s] and ``|d2p/ds2|`` [m/s^2], for s in [0, s_end].
    """
    _, qd, c, d = path
    angular, swing, push = 0.0, 0.0, 0.0
    for j in range(6):
        bend = 3.0 * d[j] * s_end
        fastest = max(abs(qd[j]), abs(qd[j] + (2.0 * c[j] + bend) * s_end))
        if abs(c[j]) < abs(bend):  # the speed may turn on the path, at -c / (3 d)
            fastest = max(fastest, abs(qd[j] - c[j] * c[j] / (3.0 * d[j])))
        angular += fastest
        swing += fastest * arm.lever[j]
        push += max(abs(2.0 * c[j]), abs(2.0 * (c[j] + bend))) * arm.lever[j]
    return swing, push + angular * swing


@kernel(inline="always")
def robot_speed_bound(arm: Arm, path: JointPath, before: Vec, after: Vec) -> float:
    """Return a bound on the speed of any point of the robot in a period [m/s].

    A point's mean velocity over the period is its chord over ``dt``, and its velocity never
    differs from the mean by more than ``a dt / 2``, with ``a`` a bound on its acceleration. The
    ends of a capsule bound the points between them.

    Args:
        before: The robot's capsules at the start, shape (9, n).
        after: Its capsules at the end, shape (9, n).
    """
    speed, acceleration = path_bounds(arm, path, arm.dt)
    chord = greatest_displacement(before, after)
    return min(speed, chord / arm.dt + 0.5 * arm.dt * acceleration)


@kernel()
def robot_tilt(pose: RobotPose) -> float:
    """Return the angle of the tool of a placed pose to the vertical [rad]."""
    return math.acos(min(1.0, max(-1.0, -pose.rot[6, 2, 1])))


@kernel(inline="always")
def tcp_speed(pose: RobotPose, qd: Vec) -> float:
    """Return the speed of the tcp of a placed pose [m/s] for joint speeds ``qd`` [rad/s]."""
    jacobian = pose.jacobian
    kinematics.tcp_jacobian(pose.rot, pose.pos, pose.tcp, jacobian)
    square = 0.0
    for i in range(3):
        v = 0.0
        for j in range(6):
            v += jacobian[i, j] * qd[j]
        square += v * v
    return math.sqrt(square)


@kernel(inline="always")
def copy_capsules(capsules: Vec, out: Vec) -> None:
    """Copy the rows that change, ``X`` to ``UZ``, of capsules of equal shape."""
    for row in range(X, UX + 3):
        for k in range(capsules.shape[1]):
            out[row, k] = capsules[row, k]
