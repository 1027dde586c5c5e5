"""Base controller of the reach scenario, and features of the approach of a person (compiled).

The base controller moves the tcp straight to its goal by damped least squares of the Jacobian.
It suffices where no person interferes, so that a policy only learns when to deviate from it.
The features add the clearance along that motion; the time and distance of closest approach of
the person to tool, elbow and goal at constant velocity; and the person's direction from each
group of links. The observed person is an upright cylinder.

Source: Buss, *Introduction to inverse kinematics with Jacobian transpose, pseudoinverse and
damped least squares methods* (2004). Deviates: (4.30) has none of these features.
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import RADIUS, UX, UY, X, Y
from app.sim.reach.kernels.observation_workspace import ReachObservationWorkspace, ReachQuery
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.arm import Arm, RobotPose
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
from app.sim.scenario.kernels.person_observation import BASE_GAIN, HORIZONS, Obs

DAMPING = 0.1
"""Damping of the least squares [m/rad]."""
SCALE = 0.5
"""Unit of distances [m]."""
FARTHEST = 3.0
"""Distances are clipped at this many units."""
APPROACH_HORIZON = 2.0
"""Horizon of the closest approach, and unit of its time [s]."""
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
"""Names and sizes of the groups of features; ``app/sim/envs/reach.py`` describes them."""
N_APPROACH = sum(size for _, size in SIZES)


@kernel(error_model="numpy")
def damped_step(jacobian: Vec, offset: Vec, out: Vec) -> None:
    """Write ``J' (J J' + DAMPING^2 I)^-1 offset``, the joint step along an offset of the tcp.

    Args:
        jacobian: Linear Jacobian [m/rad], shape (3, 6).
        offset: Offset of the tcp [m], shape (3,).
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
    u = (c00 * offset[0] + c01 * offset[1] + c02 * offset[2]) * whole
    v = (c01 * offset[0] + c11 * offset[1] + c12 * offset[2]) * whole
    w = (c02 * offset[0] + c12 * offset[1] + c22 * offset[2]) * whole
    for j in range(6):
        out[j] = jacobian[0, j] * u + jacobian[1, j] * v + jacobian[2, j] * w


@kernel(inline="always")
def base_motion(
    arm: Arm, robot: RobotPose, goal: Vec, work: ReachObservationWorkspace
) -> float:
    """Fill ``work.step`` and ``work.base`` with the straight motion of the tcp to the goal.

    All joints keep their shares of the step; the speed falls with the remaining step.

    Args:
        robot: The placed robot, with its Jacobian.
        goal: Goal of the tcp [m], shape (3,).
        work: Work space; ``q`` is overwritten.

    Returns:
        The share of the step made per second [1/s].
    """
    step, base = work.step, work.base
    for i in range(3):
        work.q[i] = goal[i] - robot.tcp[i]
    damped_step(robot.jacobian, work.q, step)
    widest = 0.0
    for j in range(6):
        widest = max(widest, abs(step[j]) / arm.limits.qd_max[j])
    rate = min(BASE_GAIN, 1.0 / max(widest, 1e-9))
    for j in range(6):
        base[j] = step[j] * rate / arm.limits.qd_max[j]
    return rate


@kernel(inline="always")
def _scaled(d: float) -> float:
    return min(FARTHEST, d / SCALE)


@kernel(error_model="numpy")
def approach(x: float, y: float, vx: float, vy: float) -> tuple[float, float]:
    """Return time [s] and distance [m] of the closest approach of two points in the plane.

    Args:
        x: x of the position of one point relative to the other [m].
        y: y of that position [m].
        vx: x of the velocity of that point relative to the other [m/s].
        vy: y of that velocity [m/s].
    """
    square = vx * vx + vy * vy
    t = 0.0
    if square > 1e-9:
        t = min(APPROACH_HORIZON, max(0.0, -(x * vx + y * vy) / square))
    return t, math.hypot(x + t * vx, y + t * vy)


@kernel(inline="always")
def _write_approach(person: Vec, point: Vec, vx: float, vy: float, k: int, out: Obs) -> None:
    """Write time and distance of the closest approach of the person to a moving point.

    Args:
        person: The observed person, shape (N_PERSON,).
        point: The point in the world frame [m], shape (>= 2,).
        vx: x of its velocity [m/s].
        vy: y of its velocity [m/s].
        k: Index of the first of the two features.
        out: Filled from ``k`` on, in units of APPROACH_HORIZON and SCALE.
    """
    t, d = approach(person[0] - point[0], person[1] - point[1], person[2] - vx, person[3] - vy)
    out[k], out[k + 1] = t / APPROACH_HORIZON, _scaled(d - person[4])


@kernel(error_model="numpy")
def _write_groups(robot: Vec, person: Vec, k: int, out: Obs) -> None:
    """Write distance and direction of the person from each group of links, in plan view."""
    for group in range(3):
        least, dx, dy = 1e9, 1.0, 0.0
        for c in range(GROUPS[group], min(GROUPS[group + 1], robot.shape[1])):
            wx, wy = person[0] - robot[X, c], person[1] - robot[Y, c]
            ux, uy = robot[UX, c], robot[UY, c]
            s = min(1.0, max(0.0, (wx * ux + wy * uy) / max(ux * ux + uy * uy, 1e-12)))
            px, py = wx - s * ux, wy - s * uy
            away = math.hypot(px, py)
            if away - robot[RADIUS, c] < least:
                least = away - robot[RADIUS, c]
                dx, dy = px / max(away, 1e-9), py / max(away, 1e-9)
        out[k + 3 * group] = _scaled(least - person[4])
        out[k + 3 * group + 1], out[k + 3 * group + 2] = dx, dy


@kernel()
def _measure_ahead(
    arm: Arm, top_z: float, q: Vec, rate: float, work: ReachObservationWorkspace
) -> None:
    """Measure the clearances of the robot along the base motion, at the horizons, in lanes.

    Args:
        top_z: Height of people's tops [m].
        q: Joint positions [rad], shape (6,).
        rate: Share of ``work.step`` made per second [1/s].
        work: Holds ``step`` and ``observed``; ``lanes`` is filled.
    """
    lanes, person, n = work.lanes, work.observed, len(HORIZONS) + 1
    for m in range(n):  # the last one twice: whole vectors
        t = HORIZONS[min(m, len(HORIZONS) - 1)]
        share = min(1.0, rate * t)
        for j in range(6):
            lanes[JOINTS + j * N_LANES + m] = q[j] + share * work.step[j]
        lanes[AXIS_X + m], lanes[AXIS_Y + m] = (
            person[0] + t * person[2],
            person[1] + t * person[3],
        )
        lanes[AXIS_R + m] = person[4]
    place_lanes(arm.lengths, n, lanes)
    measure_lanes(arm, top_z, n, FARTHEST * SCALE, work.q, work.moved, lanes)


@kernel()
def write_approach_features(
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
        work: Holds the robot placed at ``query.q`` with its Jacobian, and ``observed``.
        k: Index of the first feature.
        out: Filled, shape (>= k + N_APPROACH,).
    """
    q, qd, goal, person = query.q, query.qd, query.goal, work.observed
    robot, moved, lanes = work.robot, work.moved, work.lanes
    rate = base_motion(arm, robot, goal, work)
    for j in range(6):
        out[k + j] = work.base[j]
    _measure_ahead(arm, top_z, q, rate, work)
    for i in range(3):
        x, y = lanes[AXIS_X + i], lanes[AXIS_Y + i]
        out[k + 6 + i] = _scaled(lanes[CLEARANCE + i])
        out[k + 19 + i] = _scaled(math.hypot(x - goal[0], y - goal[1]) - person[4])
    out[k + 9] = 2.0 * person[5]
    out[k + 18] = _scaled(math.hypot(person[0] - goal[0], person[1] - goal[1]) - person[4])
    vx = vy = ex = ey = 0.0
    for j in range(6):
        vx += robot.jacobian[0, j] * qd[j]
        vy += robot.jacobian[1, j] * qd[j]
    kinematics.tcp_jacobian(robot.rot, robot.pos, robot.pos[3], moved.jacobian)
    for j in range(2):
        ex += moved.jacobian[0, j] * qd[j]
        ey += moved.jacobian[1, j] * qd[j]
    _write_approach(person, robot.tcp, vx, vy, k + 10, out)
    _write_approach(person, robot.tcp, 0.0, 0.0, k + 12, out)
    _write_approach(person, robot.pos[3], ex, ey, k + 14, out)
    _write_approach(person, goal, 0.0, 0.0, k + 16, out)
    _write_groups(robot.capsules, person, k + 22, out)
