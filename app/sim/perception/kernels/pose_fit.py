"""Joint angles of a person from key-points (compiled); see ``keypoint_angles.py``."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.human.kernels import kinematics as body
from app.sim.human.kernels.joint_angles import (
    Point,
    arm_lift,
    arm_rotation,
    clavicle_angles,
    heading,
    turn_angles,
    unit_range,
)

NECK, MID_HIP, HIP_R, HIP_L = 1, 8, 9, 12
SHOULDERS = (2, 5)
"""Right and left shoulder in BODY_25; elbow and wrist follow each."""
POLE_MEMORY = 0.04
"""Distance of the elbow from the line shoulder - wrist below which its previous direction is
blended in [m], since noise dominates the measured one of a nearly straight arm."""

Mask = NDArray[np.bool_]


class FitSpace(NamedTuple):
    """Work space of a fit."""

    trig: Vec
    """Sines and cosines, shape (3, 16)."""
    joints: Vec
    """Points of the model [m], shape (body.N_POINTS, 3)."""
    frames: Vec
    """Orientations of the model, shape (body.N_FRAMES, 3, 3)."""


def new_fit_space() -> FitSpace:
    """Return work space."""
    return FitSpace(
        np.empty((3, 16)), np.empty((body.N_POINTS, 3)), np.empty((body.N_FRAMES, 3, 3))
    )


@kernel(inline="always")
def _row(points: Vec, k: int) -> Point:
    return points[k, 0], points[k, 1], points[k, 2]


@kernel(inline="always")
def _unknown(a: Point) -> bool:
    return math.isnan(a[0] + a[1] + a[2])


@kernel(inline="always")
def _minus(a: Point, b: Point) -> Point:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel(inline="always")
def _plus(a: Point, f: float, b: Point) -> Point:
    """Return ``a + f b``."""
    return a[0] + f * b[0], a[1] + f * b[1], a[2] + f * b[2]


@kernel(inline="always")
def _times(f: float, a: Point) -> Point:
    return f * a[0], f * a[1], f * a[2]


@kernel(inline="always")
def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel(inline="always")
def _cross(a: Point, b: Point) -> Point:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel(inline="always")
def _length(a: Point) -> float:
    return math.sqrt(_dot(a, a))


@kernel(inline="always")
def _inside(rot: Vec, a: Point) -> Point:
    """Return a direction in the axes of ``rot``, shape (3, 3)."""
    return (
        rot[0, 0] * a[0] + rot[1, 0] * a[1] + rot[2, 0] * a[2],
        rot[0, 1] * a[0] + rot[1, 1] * a[1] + rot[2, 1] * a[2],
        rot[0, 2] * a[0] + rot[1, 2] * a[1] + rot[2, 2] * a[2],
    )


@kernel(inline="always")
def _either(points: Vec, middle: int, right: int, left: int) -> Point:
    """Return a middle point, or the mean of its two sides if it is missing."""
    here = _row(points, middle)
    if _unknown(here):
        here = _times(0.5, _plus(_row(points, right), 1.0, _row(points, left)))
    return here


@kernel(inline="always")
def _across(points: Vec, right: int, left: int, middle: int) -> Point:
    """Return the direction from right to left of a pair, or from or to its middle."""
    r, l, m = _row(points, right), _row(points, left), _row(points, middle)
    direction = _minus(l, r)
    if _unknown(direction):
        direction = _minus(l, m)
    if _unknown(direction):
        direction = _minus(m, r)
    return direction


@kernel(inline="always")
def _near(angle: float, before: float, most: float) -> float:
    """Return the equivalent angle nearest to the previous one, inside the yaw's limit."""
    angle += 2.0 * math.pi * np.rint((before - angle) / (2.0 * math.pi))
    if abs(angle) > most:
        angle -= math.copysign(2.0 * math.pi, angle)
    return angle


@kernel(inline="always")
def _clip(q: Vec, first: int, last: int, q_min: Vec, q_max: Vec) -> None:
    for j in range(first, last):
        q[j] = max(q_min[j], min(q_max[j], q[j]))


@kernel(error_model="numpy")
def fit_joints(
    points: Vec, size: Vec, q_min: Vec, q_max: Vec, space: FitSpace, q: Vec, held: Mask
) -> None:
    """Write the joint positions that fit key-points, limb by limb.

    Args:
        points: Key-points [m], shape (25, 3), NaN where missing.
        size: Body size [m], shape (12,).
        q_min: Lower joint limits [m, rad], shape (18,).
        q_max: Upper joint limits [m, rad], shape (18,).
        q: Previous joint positions, replaced by the new ones [m, rad], shape (18,).
        held: Whether a joint keeps its value for lack of key-points; written, shape (18,).
    """
    for j in range(18):
        held[j] = False
    hip = _either(points, MID_HIP, HIP_R, HIP_L)
    neck = _either(points, NECK, SHOULDERS[0], SHOULDERS[1])
    if _unknown(hip):
        held[0] = held[1] = True
    else:
        q[0], q[1] = hip[0], hip[1]
    _fit_trunk(points, _minus(neck, hip), q_max[2], q, held)
    _clip(q, 0, 6, q_min, q_max)
    body.points_and_frames(q, size, space.trig, space.joints, space.frames)
    torso = space.frames[body.F_TORSO]
    for arm in range(2):
        side, first = (-1.0, 6) if arm == 0 else (1.0, 8)
        direction = _minus(_row(points, SHOULDERS[arm]), _row(points, NECK))
        bar, length = _inside(torso, direction), _length(direction)
        if not length > 1e-6:  # NaN or coincident
            held[first] = held[first + 1] = True
            continue
        out = max(side * bar[1], 1e-6)
        q[first], q[first + 1] = clavicle_angles(bar[0], out, bar[2] / length)
    _clip(q, 6, 10, q_min, q_max)
    body.points_and_frames(q, size, space.trig, space.joints, space.frames)
    for arm in range(2):
        _fit_arm(points, size, q_min, q_max, space, arm, q, held)
    _clip(q, 10, 18, q_min, q_max)


@kernel(error_model="numpy")
def _fit_trunk(points: Vec, spine: Point, most_yaw: float, q: Vec, held: Mask) -> None:
    """Write pelvis yaw and abdomen angles.

    Args:
        points: Key-points [m], shape (25, 3).
        spine: Vector from pelvis to neck [m], NaN where unknown.
        most_yaw: Limit of the yaw [rad].
        q: Joint positions; ``q[2:6]`` are written where known, shape (18,).
        held: As in :func:`fit_joints`, shape (18,).
    """
    hips = _across(points, HIP_R, HIP_L, MID_HIP)
    shoulders = _across(points, SHOULDERS[0], SHOULDERS[1], NECK)
    if not _unknown(hips):
        q[2] = _near(heading(hips[0], hips[1]), q[2], most_yaw)
    else:
        held[2] = True
        if not _unknown(shoulders):  # hidden hips: constant twist
            q[2] = _near(heading(shoulders[0], shoulders[1]) - q[5], q[2], most_yaw)
    length = _length(spine)
    if not length > 1e-6:  # NaN or coincident
        held[3] = held[4] = held[5] = True
        return
    c, s = math.cos(q[2]), math.sin(q[2])
    z = (c * spine[0] + s * spine[1], c * spine[1] - s * spine[0], spine[2])
    z = _times(1.0 / length, z)
    y = (c * shoulders[0] + s * shoulders[1], c * shoulders[1] - s * shoulders[0], shoulders[2])
    y = _plus(y, -_dot(y, z), z)
    wide = _length(y)
    known = wide >= 1e-6
    if known:
        y = _times(1.0 / wide, y)
    flex, bend, twist = turn_angles(_cross(y, z)[1], y[1], z)
    q[3], q[4] = flex, bend
    if known:
        q[5] = twist
    else:
        held[5] = True


@kernel(error_model="numpy")
def _fit_arm(
    points: Vec,
    size: Vec,
    q_min: Vec,
    q_max: Vec,
    space: FitSpace,
    arm: int,
    q: Vec,
    held: Mask,
) -> None:
    """Write flexion, abduction, rotation and elbow of one arm, 0 right or 1 left.

    ``space`` holds the model with the arm's previous angles.
    """
    first, side = (10, -1.0) if arm == 0 else (14, 1.0)
    torso = space.frames[body.F_TORSO]
    at = body.SHOULDER_R if arm == 0 else body.SHOULDER_L
    shoulder = _row(space.joints, at)
    last = _minus(_row(space.joints, at + 1), shoulder)
    elbow = _minus(_row(points, SHOULDERS[arm] + 1), shoulder)
    wrist = _minus(_row(points, SHOULDERS[arm] + 2), shoulder)
    seen_elbow = not _unknown(elbow)
    if _unknown(wrist):
        held[first] = held[first + 1] = not seen_elbow
        held[first + 2] = held[first + 3] = True
        length = _length(elbow)
        if length >= 1e-6:
            upper = _inside(torso, _times(1.0 / length, elbow))
            _write_shoulder(upper, (0.0, 0.0, 0.0), False, side, first, q_min, q_max, q)
        return
    distance = _length(wrist)
    line = (-torso[0, 2], -torso[1, 2], -torso[2, 2])
    if distance > 1e-6:
        line = _times(1.0 / distance, wrist)
    a, b = size[body.UPPER_ARM_R + arm], size[body.FOREARM_R + arm]
    shortest = math.sqrt(a * a + b * b + 2.0 * a * b * math.cos(q_max[first + 3]))
    span = min(max(distance, shortest), a + b - 1e-4)
    along = (a * a - b * b + span * span) / (2.0 * span)
    pole = _pole(line, elbow if seen_elbow else last, last, torso)
    height = math.sqrt(max(a * a - along * along, 0.0))
    upper = _plus(_times(along, line), height, pole)
    fore = _minus(_times(span, line), upper)
    upper = _times(1.0 / _length(upper), upper)
    reach = _dot(fore, upper)
    toward = _inside(torso, _plus(fore, -reach, upper))
    _write_shoulder(_inside(torso, upper), toward, True, side, first, q_min, q_max, q)
    q[first + 3] = math.acos(unit_range(reach / b))
    held[first + 2] = not seen_elbow


@kernel(inline="always")
def _pole(line: Point, elbow: Point, last: Point, torso: Vec) -> Point:
    """Return the unit vector from ``line`` to the elbow, normal to the line."""
    pole = _plus(elbow, -_dot(elbow, line), line)
    weight = max(0.0, POLE_MEMORY - _length(pole))
    for k in range(3):
        other = last
        if k > 0:
            axis = 0 if k == 1 else 2
            other = (-torso[0, axis], -torso[1, axis], -torso[2, axis])
        across = _plus(other, -_dot(other, line), line)
        length = _length(across)
        if length > 1e-6:
            pole = _plus(pole, weight / length, across)
            break
    if _length(pole) < 1e-9:  # opposite measured and previous directions
        y = (torso[0, 1], torso[1, 1], torso[2, 1])
        if abs(_dot(line, y)) >= 0.9:
            y = (torso[0, 2], torso[1, 2], torso[2, 2])
        pole = _cross(line, y)
    return _times(1.0 / _length(pole), pole)


@kernel(error_model="numpy")
def _write_shoulder(
    upper: Point,
    toward: Point,
    bends: bool,
    side: float,
    first: int,
    q_min: Vec,
    q_max: Vec,
    q: Vec,
) -> None:
    """Write the three angles of a shoulder.

    Of the two equivalent triples, the one inside the limits or nearer to the previous one is
    selected.

    Args:
        upper: Direction of the upper arm in the torso.
        toward: Direction of the elbow's bend, normal to ``upper``.
        bends: Whether ``toward`` is known; otherwise the rotation is kept.
        side: -1 right, 1 left.
        first: Index of the flexion.
        q_min: Lower limits, shape (18,).
        q_max: Upper limits, shape (18,).
        q: Previous joint positions; ``q[first:first + 3]`` is written.
    """
    flex, lift = arm_lift(upper)
    best, least = (q[first], q[first + 1], q[first + 2]), math.inf
    for k in range(2):
        one, two, three = flex, side * lift, q[first + 2]
        if k == 1:
            one, two = flex + math.pi, math.pi - side * lift
        if bends:
            three = arm_rotation(one, side * two, toward)
        angles = (_wrapped(one), _wrapped(two), _wrapped(three))
        cost = 0.0
        for i in range(3):
            excess = max(q_min[first + i] - angles[i], angles[i] - q_max[first + i])
            cost += 100.0 * max(0.0, excess) + abs(angles[i] - q[first + i])
        if cost < least:
            best, least = angles, cost
    q[first], q[first + 1], q[first + 2] = best


@kernel(inline="always")
def _wrapped(angle: float) -> float:
    return (angle + math.pi) % (2.0 * math.pi) - math.pi
