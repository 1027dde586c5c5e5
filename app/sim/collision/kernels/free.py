"""Collision check of planners: clearance at a configuration and along a motion, compiled.

People are static here: capsules and vertical cylinders at one moment. The *spare clearance* is
the distance to people beyond their margin, or that to the cell and of the robot to itself
beyond another. A configuration is free when its spare clearance exceeds half of RESOLUTION; a
motion is free when configurations no farther apart than RESOLUTION, or than the spare clearance
of the last one permits, are free. Between two of them no point moves farther than half the
resolution from the nearer one, so the spare clearance of a free motion is positive everywhere:
the check may refuse half a millimetre early, never late.
"""

from typing import NamedTuple

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR, kernel
from app.sim.geometry.capsules import capsule_clearances, least
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.robot.kernels.arm import (
    Arm,
    RobotPose,
    cell_clearance,
    place_robot,
    self_clearance,
)

RESOLUTION = 1e-3
"""Greatest displacement of any point between two configurations that are checked [m]."""


class Obstacles(NamedTuple):
    """People at one moment, distances to keep, and work space."""

    capsules: Vec
    """The people's capsules, shape (9, m)."""
    clearance: Vec
    """Work space: distance of each capsule to the robot [m], shape (m,)."""
    cylinders: Vec
    """Upright cylinders that stand on the floor: x, y, radius, top [m], shape (n, 4)."""
    margin: float
    """Distance to keep from people [m]."""
    cell_margin: float
    """Distance to keep from the cell and of the robot from itself [m]."""
    q: Vec
    """Work space: joint positions on a motion [rad], shape (6,)."""
    qd: Vec
    """Work space: speeds of a motion [rad/s], shape (6,)."""
    c: Vec
    """Work space: coefficients of a motion [rad/s^2], shape (6,)."""


@kernel()
def distance_to_people(obstacles: Obstacles, pose: RobotPose) -> float:
    """Return the distance of the placed robot to people [m]; FAR without any."""
    best = FAR
    if obstacles.capsules.shape[1] > 0:
        capsule_clearances(pose.capsules, obstacles.capsules, obstacles.clearance)
        best, _ = least(obstacles.clearance)
    for k in range(obstacles.cylinders.shape[0]):
        x, y = obstacles.cylinders[k, 0], obstacles.cylinders[k, 1]
        r, top = obstacles.cylinders[k, 2], obstacles.cylinders[k, 3]
        d, _ = cylinder_clearance(pose.capsules, 0, x, y, r, top)
        best = min(best, d)
    return best


@kernel()
def clearances_at(
    arm: Arm, q: Vec, obstacles: Obstacles, pose: RobotPose
) -> tuple[float, float, float]:
    """Return the distances to people, to the cell and of the robot to itself [m].

    Args:
        q: Joint positions [rad], shape (6,).
        obstacles: People.
        pose: Work space.
    """
    place_robot(arm, q, pose)
    people = distance_to_people(obstacles, pose)
    cell, _, _ = cell_clearance(arm, pose.capsules)
    own, _ = self_clearance(arm, pose)
    return people, cell, own


@kernel()
def spare_clearance(arm: Arm, q: Vec, obstacles: Obstacles, pose: RobotPose) -> float:
    """Return the distance any point of the robot can move before a margin is violated [m].

    Two parts of the robot that approach each other both move, so theirs counts half.
    """
    people, cell, own = clearances_at(arm, q, obstacles, pose)
    return min(
        people - obstacles.margin,
        cell - obstacles.cell_margin,
        0.5 * (own - obstacles.cell_margin),
    )


@kernel()
def free_at(arm: Arm, q: Vec, obstacles: Obstacles, pose: RobotPose) -> bool:
    """Return whether a configuration is free."""
    return bool(spare_clearance(arm, q, obstacles, pose) > 0.5 * RESOLUTION)


@kernel()
def motion_free(
    arm: Arm, q0: Vec, qd0: Vec, c: Vec, duration: float, obstacles: Obstacles, pose: RobotPose
) -> tuple[bool, int]:
    """Return whether ``q0 + qd0 x + c x^2`` is free for all x from 0 to ``duration``.

    The end and the middle are checked first, where most motions that are not free fail.

    Args:
        q0: Joint positions at the start [rad], shape (6,).
        qd0: Joint speeds at the start [rad/s], shape (6,).
        c: Coefficients [rad/s^2], shape (6,).
        duration: Duration of the motion [s].
        obstacles: People.
        pose: Work space.

    Returns:
        Whether it is free, and the number of configurations checked.
    """
    q, speed = obstacles.q, 0.0
    for j in range(6):
        fastest = max(abs(qd0[j]), abs(qd0[j] + 2.0 * c[j] * duration))
        speed += fastest * arm.lever[j]
    checked = 0
    for part in (1.0, 0.5, 0.25, 0.75):
        _along(q0, qd0, c, part * duration, q)
        checked += 1
        if not free_at(arm, q, obstacles, pose):
            return False, checked
        if speed * duration <= RESOLUTION:
            break
    x = 0.0
    while x < duration:
        _along(q0, qd0, c, x, q)
        checked += 1
        spare = spare_clearance(arm, q, obstacles, pose)
        if spare <= 0.5 * RESOLUTION:
            return False, checked
        x += max(spare, RESOLUTION) / max(speed, 1e-9)
    return True, checked


@kernel()
def edge_free(
    arm: Arm, q0: Vec, q1: Vec, obstacles: Obstacles, pose: RobotPose
) -> tuple[bool, int]:
    """Return whether the straight motion from ``q0`` to ``q1`` is free; see motion_free."""
    for j in range(6):
        obstacles.qd[j], obstacles.c[j] = q1[j] - q0[j], 0.0
    return motion_free(arm, q0, obstacles.qd, obstacles.c, 1.0, obstacles, pose)


@kernel()
def first_blocked(
    arm: Arm, q: Vec, qd: Vec, dt: float, first: int, obstacles: Obstacles, pose: RobotPose
) -> int:
    """Return the first period of a timed path that is not free, or their number if all are.

    Args:
        q: Joint positions between periods [rad], shape (n + 1, 6).
        qd: Joint speeds between periods [rad/s], shape (n + 1, 6).
        dt: Period [s].
        first: Period to begin with.
        obstacles: People.
        pose: Work space.
    """
    n = int(q.shape[0]) - 1
    for k in range(first, n):
        for j in range(6):
            obstacles.c[j] = (qd[k + 1, j] - qd[k, j]) / (2.0 * dt)
        free, _ = motion_free(arm, q[k], qd[k], obstacles.c, dt, obstacles, pose)
        if not free:
            return k
    return n


@kernel()
def _along(q0: Vec, qd0: Vec, c: Vec, x: float, q: Vec) -> None:
    """Write the position at time ``x`` of a motion into ``q``, shape (6,)."""
    for j in range(6):
        q[j] = q0[j] + qd0[j] * x + c[j] * x * x
