"""Whether the robot is free of people, cell and itself, at a pose and along a motion, compiled.

What a planner asks thousands of times. People stand still here: capsules and upright cylinders
at one moment. *Slack* is the clearance beyond what is asked for: distance to people less their
margin, distance to the table and of the robot to itself less another. A pose is free when its
slack is more than half of RESOLUTION; a motion is free when poses no farther apart than
RESOLUTION, or than the slack at the last one allows, are free. Between two such poses no point
moves farther than half the resolution from the nearer of both, so a free motion has slack above
zero everywhere: the test can be early by half a millimetre, never late.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from app.sim.kernels.arm import (
    Arm,
    Pose,
    place_robot,
    self_clearance,
    table_clearance,
)
from app.sim.kernels.geometry import FAR, set_clearance
from app.sim.ports import Vec

RESOLUTION = 1e-3
"""Farthest that any point of the robot moves between two poses of a walked motion [m]."""
GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)
"""The share of an interval that golden section search keeps."""
SEARCH_STEPS = 32
"""Steps of that search: 2e-7 of the segment's length are left."""


class Around(NamedTuple):
    """People at one moment, and the distances to keep."""

    ends: Vec
    """Ends of the capsules [m], shape (m, 2, 3)."""
    radius: Vec
    """Radii of the capsules [m], shape (m,)."""
    cylinders: Vec
    """Upright cylinders that stand on the floor: x, y, radius, top [m], shape (n, 4)."""
    margin: float
    """Distance to keep from people [m]."""
    cell_margin: float
    """Distance to keep from the table and of the robot from itself [m]."""


@njit(cache=True)
def above_cylinder(x: float, y: float, z: float, cylinder: Vec) -> float:
    """Return the distance of a point to a cylinder that stands on the floor [m], 0 inside."""
    out = max(0.0, math.hypot(x - cylinder[0], y - cylinder[1]) - cylinder[2])
    return float(math.hypot(out, max(0.0, z - cylinder[3])))


@njit(cache=True)
def cylinder_gap(a: Vec, radius: float, cylinder: Vec) -> float:
    """Return the distance of a capsule to a cylinder that stands on the floor [m].

    Where the segment is nearest to the cylinder's axis and below its top, that place is nearest
    to the cylinder too; else the distance to a convex body is convex along the segment, and a
    search finds its least value. ``-radius`` where the segment meets the cylinder.

    Args:
        a: Ends of the capsule's segment [m], shape (2, 3).
        radius: The capsule's radius [m].
        cylinder: x, y, radius, top [m], shape (4,).
    """
    dx, dy = a[1, 0] - a[0, 0], a[1, 1] - a[0, 1]
    wx, wy = cylinder[0] - a[0, 0], cylinder[1] - a[0, 1]
    flat2 = dx * dx + dy * dy
    s = min(1.0, max(0.0, (wx * dx + wy * dy) / flat2)) if flat2 > 1e-12 else 0.0
    if a[0, 2] + s * (a[1, 2] - a[0, 2]) <= cylinder[3]:
        return float(max(0.0, math.hypot(wx - s * dx, wy - s * dy) - cylinder[2]) - radius)
    return _search_segment(a, cylinder) - radius


@njit(cache=True)
def _search_segment(a: Vec, cylinder: Vec) -> float:
    """Return the least distance of a segment to a cylinder [m] by golden section search."""
    dx, dy, dz = a[1, 0] - a[0, 0], a[1, 1] - a[0, 1], a[1, 2] - a[0, 2]
    low, high = 0.0, 1.0
    s, t = 1.0 - GOLDEN, GOLDEN
    ds = above_cylinder(a[0, 0] + s * dx, a[0, 1] + s * dy, a[0, 2] + s * dz, cylinder)
    dt = above_cylinder(a[0, 0] + t * dx, a[0, 1] + t * dy, a[0, 2] + t * dz, cylinder)
    for _ in range(SEARCH_STEPS):
        if ds <= dt:
            high, t, dt = t, s, ds
            s = high - GOLDEN * (high - low)
            ds = above_cylinder(a[0, 0] + s * dx, a[0, 1] + s * dy, a[0, 2] + s * dz, cylinder)
        else:
            low, s, ds = s, t, dt
            t = low + GOLDEN * (high - low)
            dt = above_cylinder(a[0, 0] + t * dx, a[0, 1] + t * dy, a[0, 2] + t * dz, cylinder)
    first = above_cylinder(a[0, 0], a[0, 1], a[0, 2], cylinder)
    last = above_cylinder(a[1, 0], a[1, 1], a[1, 2], cylinder)
    return min(ds, dt, first, last)


@njit(cache=True)
def people_gap(arm: Arm, around: Around, pose: Pose) -> float:
    """Return the distance of the placed robot to people [m]; FAR without any."""
    best = FAR
    if around.radius.shape[0] > 0:
        best, _, _ = set_clearance(
            pose.robot,
            arm.radius,
            around.ends,
            around.radius,
            0,
            around.radius.shape[0] - 1,
            FAR,
        )
    for n in range(around.cylinders.shape[0]):
        for k in range(arm.radius.shape[0]):
            best = min(best, cylinder_gap(pose.robot[k], arm.radius[k], around.cylinders[n]))
    return best


@njit(cache=True)
def gaps_at(arm: Arm, q: Vec, around: Around, pose: Pose) -> tuple[float, float, float]:
    """Return the distances to people, to the table and of the robot to itself [m].

    Args:
        arm: Robot in its cell.
        q: Joint positions [rad], shape (6,).
        around: People.
        pose: Work space.
    """
    place_robot(arm, q, pose)
    people = people_gap(arm, around, pose)
    table, _ = table_clearance(arm, pose)
    own, _ = self_clearance(arm, pose)
    return people, table, own


@njit(cache=True)
def slack_at(arm: Arm, q: Vec, around: Around, pose: Pose) -> float:
    """Return how far any point of the robot may move before something is too near [m].

    Of two parts of the robot that approach each other both move, so their slack counts half.
    """
    people, table, own = gaps_at(arm, q, around, pose)
    return min(
        people - around.margin,
        table - around.cell_margin,
        0.5 * (own - around.cell_margin),
    )


@njit(cache=True)
def free_at(arm: Arm, q: Vec, around: Around, pose: Pose) -> bool:
    """Tell whether a pose is free."""
    return bool(slack_at(arm, q, around, pose) > 0.5 * RESOLUTION)


@njit(cache=True)
def motion_free(
    arm: Arm, q0: Vec, qd0: Vec, c: Vec, duration: float, around: Around, pose: Pose
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
    q = np.empty(6)
    speed = 0.0
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
        slack = slack_at(arm, q, around, pose)
        if slack <= 0.5 * RESOLUTION:
            return False, looked
        x += max(slack, RESOLUTION) / max(speed, 1e-9)
    return True, looked


@njit(cache=True)
def edge_free(arm: Arm, q0: Vec, q1: Vec, around: Around, pose: Pose) -> tuple[bool, int]:
    """Tell whether the straight joint motion from ``q0`` to ``q1`` is free; see motion_free."""
    return motion_free(arm, q0, q1 - q0, np.zeros(6), 1.0, around, pose)


@njit(cache=True)
def first_blocked(
    arm: Arm, q: Vec, qd: Vec, dt: float, first: int, around: Around, pose: Pose
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
    n = len(q) - 1
    for k in range(first, n):
        c = (qd[k + 1] - qd[k]) / (2.0 * dt)
        free, _ = motion_free(arm, q[k], qd[k], c, dt, around, pose)
        if not free:
            return k
    return n


@njit(cache=True)
def _along(q0: Vec, qd0: Vec, c: Vec, x: float, q: Vec) -> None:
    """Write the position at time ``x`` of a motion into ``q``, shape (6,)."""
    for j in range(6):
        q[j] = q0[j] + qd0[j] * x + c[j] * x * x
