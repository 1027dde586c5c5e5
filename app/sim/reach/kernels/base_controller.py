"""What lies ahead of a robot that reaches: the base motion, and how near people come, compiled.

The *base* is the straight way of the tcp to its goal, by damped least squares of the Jacobian:
where nobody is in the way, following it is enough, so that a policy learns only when to do
otherwise. Beside it stand the clearance of the robot along that way, when and how near the
person comes to tool, wrist, elbow and goal if robot and person go on as they do, and where the
person stands about each group of links. All count the seen person as an upright cylinder.

Source: Buss, *Introduction to inverse kinematics with Jacobian transpose, pseudoinverse and
damped least squares methods* (2004). Deviates: (4.30) has none of this.
"""

import math
from typing import NamedTuple

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import RADIUS, UX, UY, X, Y
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.pick.kernels.observation import BASE_GAIN, HORIZONS, Obs
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.arm import Arm, RobotPose, new_robot_pose, place_robot

DAMPING = 0.1
"""Damping of the least squares [m/rad]."""
SCALE = 0.5
"""Distances are given in units of this and cut at three units [m]."""
LOOK_S = 2.0
"""How far ahead approaches are looked for [s]; times are given in units of it."""
GROUPS = (1, 5, 8, 12)
"""First capsule of shoulder and upper arm, of forearm, of wrists and tool; and their end."""
SIZES = (
    ("base", 6),
    ("look_ahead_base", 3),
    ("human_growth", 1),
    ("approach", 8),
    ("goal_gap", 4),
    ("group_gap", 9),
)
"""Names and sizes of the groups of features."""
N_PROSPECT = sum(size for _, size in SIZES)


class Prospect(NamedTuple):
    """Work space of one look ahead; made once, filled again and again."""

    robot: RobotPose
    """The robot further along its way."""
    q: Vec
    """Its joints [rad], shape (6,)."""
    step: Vec
    """Joint steps to the goal [rad], shape (6,)."""
    base: Vec
    """The base motion in [-1, 1], shape (6,)."""


def new_prospect(arm: Arm) -> Prospect:
    """Return work space."""
    return Prospect(new_robot_pose(arm), np.zeros(6), np.zeros(6), np.zeros(6))


@kernel(error_model="numpy")
def damped_step(jacobian: Vec, way: Vec, out: Vec) -> None:
    """Write ``J' (J J' + DAMPING^2 I)^-1 way``, the joint step that leads along a way.

    Args:
        jacobian: Linear Jacobian [m/rad], shape (3, 6).
        way: Way of the tcp [m], shape (3,).
        out: Filled [rad], shape (6,).
    """
    a00 = a11 = a22 = DAMPING * DAMPING
    a01 = a02 = a12 = 0.0
    for j in range(6):
        x, y, z = jacobian[0, j], jacobian[1, j], jacobian[2, j]
        a00 += x * x
        a11 += y * y
        a22 += z * z
        a01 += x * y
        a02 += x * z
        a12 += y * z
    c00, c01, c02 = a11 * a22 - a12 * a12, a02 * a12 - a01 * a22, a01 * a12 - a02 * a11
    c11, c12, c22 = a00 * a22 - a02 * a02, a01 * a02 - a00 * a12, a00 * a11 - a01 * a01
    whole = 1.0 / (a00 * c00 + a01 * c01 + a02 * c02)
    u = (c00 * way[0] + c01 * way[1] + c02 * way[2]) * whole
    v = (c01 * way[0] + c11 * way[1] + c12 * way[2]) * whole
    w = (c02 * way[0] + c12 * way[1] + c22 * way[2]) * whole
    for j in range(6):
        out[j] = jacobian[0, j] * u + jacobian[1, j] * v + jacobian[2, j] * w


@kernel(inline="always")
def base_motion(arm: Arm, robot: RobotPose, goal: Vec, prospect: Prospect) -> float:
    """Fill ``prospect.step`` and ``prospect.base``: the straight way to the goal.

    All joints keep their shares of the step; the speed falls with the way left.

    Args:
        arm: Robot in its cell.
        robot: The robot as it is, with its Jacobian.
        goal: Where the tcp shall be [m], shape (3,).
        prospect: Work space.

    Returns:
        The share of the step made in a second, 1/s.
    """
    step, base = prospect.step, prospect.base
    for i in range(3):
        prospect.q[i] = goal[i] - robot.tcp[i]
    damped_step(robot.jacobian, prospect.q, step)
    widest = 0.0
    for j in range(6):
        widest = max(widest, abs(step[j]) / arm.limits.qd_max[j])
    rate = min(BASE_GAIN, 1.0 / max(widest, 1e-9))
    for j in range(6):
        base[j] = step[j] * rate / arm.limits.qd_max[j]
    return rate


@kernel(inline="always")
def _scaled(d: float) -> float:
    return min(3.0, d / SCALE)


@kernel(error_model="numpy")
def approach(x: float, y: float, vx: float, vy: float) -> tuple[float, float]:
    """Return when two points in the plane come nearest within ``LOOK_S`` [s], and how near [m].

    Args:
        x: Place of one relative to the other [m].
        y: See x.
        vx: Its velocity relative to the other [m/s].
        vy: See vx.
    """
    square = vx * vx + vy * vy
    t = 0.0
    if square > 1e-9:
        t = min(LOOK_S, max(0.0, -(x * vx + y * vy) / square))
    return t, math.hypot(x + t * vx, y + t * vy)


@kernel(inline="always")
def _put_approach(seen: Vec, point: Vec, vx: float, vy: float, k: int, out: Obs) -> None:
    """Write when and how near the person comes to a point that goes on at constant velocity."""
    t, d = approach(seen[0] - point[0], seen[1] - point[1], seen[2] - vx, seen[3] - vy)
    out[k], out[k + 1] = t / LOOK_S, _scaled(d - seen[4])


@kernel(error_model="numpy")
def _put_groups(robot: Vec, seen: Vec, k: int, out: Obs) -> None:
    """Write gap and direction of the person to each group of the robot's capsules, in plan."""
    for group in range(3):
        least, dx, dy = 1e9, 1.0, 0.0
        for c in range(GROUPS[group], min(GROUPS[group + 1], robot.shape[1])):
            wx, wy = seen[0] - robot[X, c], seen[1] - robot[Y, c]
            ux, uy = robot[UX, c], robot[UY, c]
            s = min(1.0, max(0.0, (wx * ux + wy * uy) / max(ux * ux + uy * uy, 1e-12)))
            px, py = wx - s * ux, wy - s * uy
            away = math.hypot(px, py)
            if away - robot[RADIUS, c] < least:
                least = away - robot[RADIUS, c]
                dx, dy = px / max(away, 1e-9), py / max(away, 1e-9)
        out[k + 3 * group] = _scaled(least - seen[4])
        out[k + 3 * group + 1], out[k + 3 * group + 2] = dx, dy


@kernel()
def put_prospect(
    arm: Arm,
    top_z: float,
    q: Vec,
    qd: Vec,
    seen: Vec,
    goal: Vec,
    robot: RobotPose,
    prospect: Prospect,
    k: int,
    out: Obs,
) -> None:
    """Write the features from ``out[k]`` on.

    Args:
        arm: Robot in its cell.
        top_z: Height of people's tops [m].
        q: Joint positions [rad], shape (6,).
        qd: Joint speeds [rad/s], shape (6,).
        seen: The person: x, y [m], vx, vy [m/s], r [m], growth [m/s], shape (6,).
        goal: Where the tcp shall be [m], shape (3,).
        robot: The robot, placed at ``q``, with its Jacobian.
        prospect: Work space.
        k: Where to begin.
        out: Filled, shape (>= k + N_PROSPECT,).
    """
    rate = base_motion(arm, robot, goal, prospect)
    for j in range(6):
        out[k + j] = prospect.base[j]
    for i in range(3):
        share = min(1.0, rate * HORIZONS[i])
        for j in range(6):
            prospect.q[j] = q[j] + share * prospect.step[j]
        place_robot(arm, prospect.q, prospect.robot)
        x, y = seen[0] + HORIZONS[i] * seen[2], seen[1] + HORIZONS[i] * seen[3]
        d, _ = cylinder_clearance(prospect.robot.columns, 0, x, y, seen[4], top_z)
        out[k + 6 + i] = _scaled(d)
        out[k + 19 + i] = _scaled(math.hypot(x - goal[0], y - goal[1]) - seen[4])
    out[k + 9] = 2.0 * seen[5]
    out[k + 18] = _scaled(math.hypot(seen[0] - goal[0], seen[1] - goal[1]) - seen[4])
    vx = vy = ex = ey = 0.0
    for j in range(6):
        vx += robot.jacobian[0, j] * qd[j]
        vy += robot.jacobian[1, j] * qd[j]
    kinematics.tcp_jacobian(robot.rot, robot.pos, robot.pos[3], prospect.robot.jacobian)
    for j in range(2):
        ex += prospect.robot.jacobian[0, j] * qd[j]
        ey += prospect.robot.jacobian[1, j] * qd[j]
    _put_approach(seen, robot.tcp, vx, vy, k + 10, out)
    _put_approach(seen, robot.tcp, 0.0, 0.0, k + 12, out)
    _put_approach(seen, robot.pos[3], ex, ey, k + 14, out)
    _put_approach(seen, goal, 0.0, 0.0, k + 16, out)
    _put_groups(robot.columns, seen, k + 22, out)
