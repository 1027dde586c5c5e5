"""The 18 joint angles of our person from key-points, in closed form.

Pelvis place from the mid-hip, its yaw from the hips; the torso's axes from mid-hip, neck and
shoulders, split into the abdomen's three angles; the clavicles from shoulders and neck. Then
each arm as a triangle shoulder - elbow - wrist of the model's lengths, so that the wrist is
where it was seen, if it can be, for people of other sizes too; the seen elbow tells the turn of
the triangle about the line to the wrist. A shoulder line that is turned against the hips is
taken as a twist of the trunk; only what both shoulders share, and what they rise, is left to
the clavicles.

What is missing keeps the angles it had, and is named.

Source: METHOD 2.8 and 3.4; the inverse of ``kernels/body.py``.
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.sim import human
from app.sim.kernels import body
from app.sim.keypoints import K
from app.sim.ports import Vec

POLE_MEMORY = 0.04
"""Distance of the elbow from the line shoulder - wrist below which its last direction counts
too, the more the nearer [m]: with a nearly straight arm the seen one is all noise."""

Mask = NDArray[np.bool_]


def joint_angles(points: Vec, q_before: Vec, size: Vec) -> tuple[Vec, Mask]:
    """Return the joint positions that fit key-points best, limb by limb.

    Args:
        points: Key-points [m], shape (25, 3), NaN where missing.
        q_before: The last joint positions [m, rad], shape (18,).
        size: The person's size [m], shape (12,) (``Cell.body``).

    Returns:
        Joint positions inside their limits [m, rad] and which of them were held because their
        key-points are missing, both of shape (18,).
    """
    q, held = np.array(q_before, dtype=np.float64), np.zeros(18, dtype=np.bool_)
    hip = _either(points[K["mid_hip"]], points[K["hip_r"]], points[K["hip_l"]])
    neck = _either(points[K["neck"]], points[K["shoulder_r"]], points[K["shoulder_l"]])
    if np.isnan(hip).any():
        held[:2] = True
    else:
        q[:2] = hip[:2]
    _place_trunk(q, held, points, neck - hip)
    q[:6] = np.clip(q[:6], human.Q_MIN[:6], human.Q_MAX[:6])
    torso = human.body_frames(q, size)["torso"][:3, :3]
    for first, hand, side in ((6, "r", -1.0), (8, "l", 1.0)):
        shoulder = torso.T @ (points[K[f"shoulder_{hand}"]] - points[K["neck"]])
        if not np.linalg.norm(shoulder) > 1e-6:  # NaN, or all in one place.
            held[first : first + 2] = True
            continue
        q[first] = math.atan2(shoulder[0], max(side * shoulder[1], 1e-6))
        q[first + 1] = math.asin(np.clip(shoulder[2] / np.linalg.norm(shoulder), -1.0, 1.0))
    q[6:10] = np.clip(q[6:10], human.Q_MIN[6:10], human.Q_MAX[6:10])
    joints = human.joint_points(q, size)
    for first, hand in ((10, "r"), (14, "l")):
        last = joints[f"elbow_{hand}"] - joints[f"shoulder_{hand}"]
        elbow = points[K[f"elbow_{hand}"]] - joints[f"shoulder_{hand}"]
        wrist = points[K[f"wrist_{hand}"]] - joints[f"shoulder_{hand}"]
        arm, side = slice(first, first + 4), 0 if hand == "r" else 1
        lengths = float(size[body.UPPER_ARM_R + side]), float(size[body.FOREARM_R + side])
        q[arm], held[arm] = _arm(q[arm], torso, hand, lengths, elbow, wrist, last)
    return np.clip(q, human.Q_MIN, human.Q_MAX), held


def _either(point: Vec, right: Vec, left: Vec) -> Vec:
    """Return a middle point, or what its two sides say where it is missing."""
    return 0.5 * (right + left) if np.isnan(point).any() else point


def _across(points: Vec, part: str, middle: str) -> Vec:
    """Return the way from right to left of a pair, or from its middle where one is missing."""
    right, left, center = (points[K[name]] for name in (f"{part}_r", f"{part}_l", middle))
    for vector in (left - right, left - center, center - right):
        if not np.isnan(vector).any():
            return np.asarray(vector)
    return np.full(3, np.nan)


def _near(angle: float, before: float) -> float:
    """Return the angle by whole turns nearest to the last one, inside the yaw's limits."""
    angle += 2.0 * math.pi * round((before - angle) / (2.0 * math.pi))
    if abs(angle) > human.Q_MAX[2]:
        angle -= math.copysign(2.0 * math.pi, angle)
    return angle


def _place_trunk(q: Vec, held: Mask, points: Vec, spine: Vec) -> None:
    """Write pelvis yaw and abdomen angles, in place.

    Args:
        q: Joint positions, ``q[2:6]`` are written where seen [rad], shape (18,).
        held: Which are held; written, shape (18,).
        points: Key-points [m], shape (25, 3).
        spine: From pelvis to neck [m], shape (3,), NaN where unknown.
    """
    hips, shoulders = _across(points, "hip", "mid_hip"), _across(points, "shoulder", "neck")
    if not np.isnan(hips).any():
        q[2] = _near(math.atan2(-hips[0], hips[1]), q[2])
    else:
        held[2] = True
        if not np.isnan(shoulders).any():  # The hips are hidden: the trunk keeps its twist.
            q[2] = _near(math.atan2(-shoulders[0], shoulders[1]) - q[5], q[2])
    if not np.linalg.norm(spine) > 1e-6:  # NaN, or all in one place.
        held[3:6] = True
        return
    c, s = math.cos(q[2]), math.sin(q[2])
    pelvis = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    z = pelvis.T @ (spine / np.linalg.norm(spine))
    q[3], q[4] = math.atan2(z[0], z[2]), -math.asin(np.clip(z[1], -1.0, 1.0))
    y = pelvis.T @ shoulders
    y = y - (y @ z) * z
    if np.isnan(y).any() or np.linalg.norm(y) < 1e-6:
        held[5] = True
        return
    y /= np.linalg.norm(y)
    q[5] = math.atan2(np.cross(y, z)[1], y[1])


def _arm(
    before: Vec,
    torso: Vec,
    hand: str,
    lengths: tuple[float, float],
    elbow: Vec,
    wrist: Vec,
    last: Vec,
) -> tuple[Vec, Mask]:
    """Return flexion, abduction, rotation, elbow [rad] and which are held, (4,) each.

    Args:
        before: The last angles [rad], shape (4,).
        torso: Orientation of the trunk, shape (3, 3).
        hand: ``"r"`` or ``"l"``.
        lengths: Shoulder to elbow and elbow to wrist [m].
        elbow: From the model's shoulder to the seen elbow [m], shape (3,), NaN where missing.
        wrist: The same to the wrist.
        last: The same to the elbow at the last angles.
    """
    side = -1.0 if hand == "r" else 1.0
    seen_elbow, seen_wrist = not np.isnan(elbow).any(), not np.isnan(wrist).any()
    if not seen_wrist:
        held = np.array([not seen_elbow, not seen_elbow, True, True])
        if not seen_elbow or np.linalg.norm(elbow) < 1e-6:
            return before, held
        z = torso.T @ (-elbow / np.linalg.norm(elbow))
        return _angles(z, None, before, side), held
    distance = float(np.linalg.norm(wrist))
    line = wrist / distance if distance > 1e-6 else -torso[:, 2]
    a, b = lengths
    shortest = math.sqrt(a**2 + b**2 + 2.0 * a * b * math.cos(human.Q_MAX[13]))
    span = min(max(distance, shortest), a + b - 1e-4)
    along = (a**2 - b**2 + span**2) / (2.0 * span)
    pole = _pole(line, elbow if seen_elbow else last, last, torso)
    upper = along * line + math.sqrt(max(a**2 - along**2, 0.0)) * pole
    fore = span * line - upper
    z = -upper / np.linalg.norm(upper)
    x = fore - (fore @ z) * z
    x /= np.linalg.norm(x)
    q = _angles(torso.T @ z, torso.T @ x, before, side)
    q[3] = math.acos(np.clip(-(fore @ z) / b, -1.0, 1.0))
    return q, np.array([False, False, not seen_elbow, False])


def _pole(line: Vec, elbow: Vec, last: Vec, torso: Vec) -> Vec:
    """Return the unit vector, normal to ``line``, toward which the elbow points."""
    pole = elbow - (elbow @ line) * line
    weight = max(0.0, POLE_MEMORY - float(np.linalg.norm(pole)))
    for other in (last, -torso[:, 0], -torso[:, 2]):
        across = other - (other @ line) * line
        size = np.linalg.norm(across)
        if size > 1e-6:
            pole = pole + weight * across / size
            break
    if np.linalg.norm(pole) < 1e-9:  # Seen and last direction are opposite and equal.
        pole = np.cross(line, torso[:, 1] if abs(line @ torso[:, 1]) < 0.9 else torso[:, 2])
    return np.asarray(pole / np.linalg.norm(pole))


def _angles(z: Vec, x: Vec | None, before: Vec, side: float) -> Vec:
    """Return the shoulder's angles and the last elbow's [rad], shape (4,).

    Two triples of angles turn an arm alike; the one inside the limits counts, of two the
    nearer to the last.

    Args:
        z: Third axis of the upper arm in the torso's axes, shape (3,).
        x: First axis; None keeps the rotation.
        before: The last angles [rad], shape (4,).
        side: -1 right, 1 left.
    """
    flex, abduct = -math.atan2(z[0], z[2]), -side * math.asin(np.clip(z[1], -1.0, 1.0))
    low, high = human.Q_MIN[10:13], human.Q_MAX[10:13]
    best, least = before.copy(), math.inf
    for turn in (0.0, math.pi):
        angles = np.array([flex + turn, turn - abduct if turn else abduct, before[2]])
        if x is not None:
            angles[2] = _rotation(angles, x, side)
        angles = (angles + math.pi) % (2.0 * math.pi) - math.pi
        excess = np.maximum(0.0, np.maximum(low - angles, angles - high)).sum()
        cost = 100.0 * excess + np.abs(angles - before[:3]).sum()
        if cost < least:
            best[:3], least = angles, cost
    return best


def _rotation(angles: Vec, x: Vec, side: float) -> float:
    """Return the turn about the arm [rad] that brings its first axis to ``x``."""
    cf, sf = math.cos(angles[0]), math.sin(angles[0])
    ca, sa = math.cos(angles[1]), side * math.sin(angles[1])
    first = np.array([cf, 0.0, sf])
    second = np.array([-sf * sa, ca, cf * sa])
    return math.atan2(second @ x, first @ x)
