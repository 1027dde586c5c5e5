"""Whether the robot is free of people, cell and itself, at a pose and along a motion, compiled.

What a planner asks thousands of times. People stand still here: capsules and upright cylinders
at one moment. *Slack* is the clearance beyond what is asked for: distance to people less their
margin, distance to the cell and of the robot to itself less another. A pose is free when its
slack is more than half of RESOLUTION; a motion is free when poses no farther apart than
RESOLUTION, or than the slack at the last one allows, are free. Between two such poses no point
moves farther than half the resolution from the nearer of both, so a free motion has slack above
zero everywhere: the test can be early by half a millimetre, never late.
"""

from typing import NamedTuple

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import capsule_clearances, least
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.geometry.segments import FAR
from app.sim.robot.kernels.arm import (
    Arm,
    RobotPose,
    cell_clearance,
    place_robot,
    self_clearance,
)

RESOLUTION = 1e-3
"""Farthest that any point of the robot moves between two poses of a walked motion [m]."""


class Obstacles(NamedTuple):
    """People at one moment, the distances to keep, and work space."""

    columns: Vec
    """The people's capsules, shape (9, m)."""
    gap: Vec
    """Work space: distance of each capsule to the robot [m], shape (m,)."""
    cylinders: Vec
    """Upright cylinders that stand on the floor: x, y, radius, top [m], shape (n, 4)."""
    margin: float
    """Distance to keep from people [m]."""
    cell_margin: float
    """Distance to keep from the cell and of the robot from itself [m]."""
    q: Vec
    """Work space: a position on the way [rad], shape (6,)."""
    qd: Vec
    """Work space: speeds of a motion [rad/s], shape (6,)."""
    c: Vec
    """Work space: coefficients of a motion [rad/s^2], shape (6,)."""


@kernel()
def distance_to_people(around: Obstacles, pose: RobotPose) -> float:
    """Return the distance of the placed robot to people [m]; FAR without any."""
    best = FAR
    if around.columns.shape[1] > 0:
        capsule_clearances(pose.columns, around.columns, around.gap)
        best, _ = least(around.gap)
    for k in range(around.cylinders.shape[0]):
        x, y = around.cylinders[k, 0], around.cylinders[k, 1]
        r, top = around.cylinders[k, 2], around.cylinders[k, 3]
        d, _ = cylinder_clearance(pose.columns, 0, x, y, r, top)
        best = min(best, d)
    return best


@kernel()
def clearances_at(
    arm: Arm, q: Vec, around: Obstacles, pose: RobotPose
) -> tuple[float, float, float]:
    """Return the distances to people, to the cell and of the robot to itself [m].

    Args:
        arm: Robot in its cell.
        q: Joint positions [rad], shape (6,).
        around: People.
        pose: Work space.
    """
    place_robot(arm, q, pose)
    people = distance_to_people(around, pose)
    cell, _, _ = cell_clearance(arm, pose.columns)
    own, _ = self_clearance(arm, pose)
    return people, cell, own


@kernel()
def spare_clearance(arm: Arm, q: Vec, around: Obstacles, pose: RobotPose) -> float:
    """Return how far any point of the robot may move before something is too near [m].

    Of two parts of the robot that approach each other both move, so their slack counts half.
    """
    people, cell, own = clearances_at(arm, q, around, pose)
    return min(
        people - around.margin,
        cell - around.cell_margin,
        0.5 * (own - around.cell_margin),
    )


@kernel()
def free_at(arm: Arm, q: Vec, around: Obstacles, pose: RobotPose) -> bool:
    """Tell whether a pose is free."""
    return bool(spare_clearance(arm, q, around, pose) > 0.5 * RESOLUTION)


@kernel()
def motion_free(
    arm: Arm, q0: Vec, qd0: Vec, c: Vec, duration: float, around: Obstacles, pose: RobotPose
) -> tuple[bool, int]:
    """Tell whether ``q0 + qd0 x + c x^2`` is free for all x from 0 to ``duration``.

    The end and the middle are looked at first, where most motions that are not free fail.

    Args:
        arm: Robot in its cell.
        q0: Joint positions at the start [rad], shape (6,).
        qd0: Joint speeds at the start [rad/s], shape (6,).
        c: Coefficients [rad/s^2], shape (6,).
        duration: How long the motion takes [s].
        around: People.
        pose: Work space.

    Returns:
        Whether it is free, and the number of poses looked at.
    """
    q, speed = around.q, 0.0
    for j in range(6):
        fastest = max(abs(qd0[j]), abs(qd0[j] + 2.0 * c[j] * duration))
        speed += fastest * arm.lever[j]
    looked = 0
    for part in (1.0, 0.5, 0.25, 0.75):
        _along(q0, qd0, c, part * duration, q)
        looked += 1
        if not free_at(arm, q, around, pose):
            return False, looked
        if speed * duration <= RESOLUTION:
            break
    x = 0.0
    while x < duration:
        _along(q0, qd0, c, x, q)
        looked += 1
        slack = spare_clearance(arm, q, around, pose)
        if slack <= 0.5 * RESOLUTION:
            return False, looked
        x += max(slack, RESOLUTION) / max(speed, 1e-9)
    return True, looked


@kernel()
def edge_free(
    arm: Arm, q0: Vec, q1: Vec, around: Obstacles, pose: RobotPose
) -> tuple[bool, int]:
    """Tell whether the straight joint motion from ``q0`` to ``q1`` is free; see motion_free."""
    for j in range(6):
        around.qd[j], around.c[j] = q1[j] - q0[j], 0.0
    return motion_free(arm, q0, around.qd, around.c, 1.0, around, pose)


@kernel()
def first_blocked(
    arm: Arm, q: Vec, qd: Vec, dt: float, first: int, around: Obstacles, pose: RobotPose
) -> int:
    """Return the first period of a timed path that is not free, or their number if all are.

    Args:
        arm: Robot in its cell.
        q: Joint positions between periods [rad], shape (n + 1, 6).
        qd: Joint speeds between periods [rad/s], shape (n + 1, 6).
        dt: Period [s].
        first: Period to begin with.
        around: People.
        pose: Work space.
    """
    n = int(q.shape[0]) - 1
    for k in range(first, n):
        for j in range(6):
            around.c[j] = (qd[k + 1, j] - qd[k, j]) / (2.0 * dt)
        free, _ = motion_free(arm, q[k], qd[k], around.c, dt, around, pose)
        if not free:
            return k
    return n


@kernel()
def _along(q0: Vec, qd0: Vec, c: Vec, x: float, q: Vec) -> None:
    """Write the position at time ``x`` of a motion into ``q``, shape (6,)."""
    for j in range(6):
        q[j] = q0[j] + qd0[j] * x + c[j] * x * x
