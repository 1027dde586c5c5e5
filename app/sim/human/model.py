"""The 18-DoF person of docs/method.md 3.4: names, limits, capsules and inverse kinematics.

``human/kernels/kinematics.py`` computes the forward kinematics; this module names its numbers
and adds the inverse for targets of the palms. The torso leans and twists toward targets beyond
the reach of the arm, then each arm is solved in closed form; the elbow's free rotation about
the line shoulder-hand is the ``swivel``.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.geometry.capsules import ends_of
from app.sim.human.kernels import kinematics as body

Hand = Literal["r", "l"]
HANDS: tuple[Hand, Hand] = ("r", "l")

JOINT_NAMES = (
    *("pelvis_x", "pelvis_y", "pelvis_yaw", "abdomen_flex", "abdomen_side", "abdomen_twist"),
    *("clavicle_r_protract", "clavicle_r_elevate", "clavicle_l_protract", "clavicle_l_elevate"),
    *("shoulder_r_flex", "shoulder_r_abduct", "shoulder_r_rotate", "elbow_r"),
    *("shoulder_l_flex", "shoulder_l_abduct", "shoulder_l_rotate", "elbow_l"),
)
CAPSULE_NAMES = (
    *("pelvis", "abdomen", "chest", "head"),
    *("upper_arm_r", "upper_arm_l", "forearm_r", "forearm_l", "hand_r", "hand_l"),
    *("leg_r", "leg_l"),
)
POINT_NAMES = (
    *("pelvis", "waist", "chest", "neck", "head"),
    *("shoulder_r", "elbow_r", "wrist_r", "hand_r"),
    *("shoulder_l", "elbow_l", "wrist_l", "hand_l"),
    "crown",
)
FRAME_NAMES = ("pelvis", "torso", "upper_arm_r", "forearm_r", "upper_arm_l", "forearm_l")
FRAME_ORIGINS = ("pelvis", "pelvis", "shoulder_r", "elbow_r", "shoulder_l", "elbow_l")
CAPSULE_RADII = body.RADII
"""Radii of the median person's capsules [m]."""

_ARM_MIN, _ARM_MAX = (-1.2, -0.8, -2.2, 0.0), (3.0, 2.6, 2.2, 2.6)
Q_MIN = np.array([-5.0, -5.0, -7.0, -0.4, -0.6, -1.0, *([-0.5] * 4), *_ARM_MIN, *_ARM_MIN])
"""Lower joint limits [m, rad], shape (18,); pelvis x and y span the cell."""
Q_MAX = np.array([5.0, 5.0, 7.0, 1.3, 0.6, 1.0, *([0.5] * 4), *_ARM_MAX, *_ARM_MAX])
"""Upper joint limits [m, rad], shape (18,)."""
Q_MIN.setflags(write=False)
Q_MAX.setflags(write=False)

REST_ARM = (0.15, 0.18, 0.0, 0.6)
"""Arm hanging relaxed: flexion, abduction, rotation, elbow [rad]."""
NEAREST_PALM = 0.16
"""Least distance of a palm and its shoulder [m]."""
EASY_REACH = 0.92
"""Share of an arm's length beyond which the torso helps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Posture:
    """Result of inverse kinematics."""

    q: Vec
    """Joint positions inside the limits [m, rad], shape (18,)."""
    reached: bool
    """Whether every requested hand is within 1 cm of its target."""


def rest_posture(x: float, y: float, yaw: float) -> Vec:
    """Return a relaxed standing posture [m, rad], shape (18,).

    Args:
        x: Pelvis x [m].
        y: Pelvis y [m].
        yaw: Direction the person faces [rad].
    """
    q = np.zeros(18)
    q[:3] = x, y, yaw
    q[10:14] = q[14:18] = REST_ARM
    return q


def arm_lengths(size: Vec, hand: str) -> tuple[float, float]:
    """Return the lengths of an arm [m]: shoulder to elbow, elbow to palm.

    Args:
        size: Body lengths [m], shape (N_SIZE,).
        hand: ``"r"`` or ``"l"``.
    """
    side = 0 if hand == "r" else 1
    fore = size[body.FOREARM_R + side] + size[body.HAND]
    return float(size[body.UPPER_ARM_R + side]), float(fore)


def _forward(q: Vec, size: Vec) -> tuple[Vec, Vec]:
    points, frames = np.empty((body.N_POINTS, 3)), np.empty((body.N_FRAMES, 3, 3))
    trig = np.empty((3, 16))
    body.points_and_frames(as_kernel_array(q), as_kernel_array(size), trig, points, frames)
    return points, frames


def capsules(q: Vec, size: Vec, floor_z: float) -> Vec:
    """Return the capsules' end points [m], shape (12, 2, 3), order of CAPSULE_NAMES.

    Args:
        q: Joint positions [m, rad], shape (18,).
        size: The person's size [m], shape (12,) (``BodySize.vector``, ``Cell.body``).
        floor_z: Height of the floor [m] (``Cell.floor_z``).
    """
    out = body.new_body_capsules(1)
    body.capsules(*_forward(q, size), as_kernel_array(size), floor_z, 0, out)
    return ends_of(out, body.N_CAPSULES)


def capsule_radii(size: Vec) -> Vec:
    """Return the radii of a person's capsules [m], shape (12,), order of CAPSULE_NAMES."""
    return np.asarray(size[body.GIRTH] * CAPSULE_RADII)


def joint_points(q: Vec, size: Vec) -> dict[str, Vec]:
    """Return the joint centres by name (POINT_NAMES) [m], each of shape (3,)."""
    points, _ = _forward(q, size)
    return dict(zip(POINT_NAMES, points, strict=True))


def palms(q: Vec, size: Vec) -> Vec:
    """Return the positions of the right and the left palm [m], shape (2, 3)."""
    points = joint_points(q, size)
    return np.stack([points["hand_r"], points["hand_l"]])


def body_frames(q: Vec, size: Vec) -> dict[str, Vec]:
    """Return T_world_body by name (FRAME_NAMES), each of shape (4, 4).

    The origin is the joint nearest the pelvis; arms hang along the frame's -z.
    """
    points, rotations = _forward(q, size)
    frames = {}
    for name, origin, rotation in zip(FRAME_NAMES, FRAME_ORIGINS, rotations, strict=True):
        frame = np.eye(4)
        frame[:3, :3], frame[:3, 3] = rotation, points[POINT_NAMES.index(origin)]
        frames[name] = frame
    return frames


def solve_hands(
    q_now: Vec,
    size: Vec,
    *,
    right: Vec | None = None,
    left: Vec | None = None,
    pelvis: tuple[float, float, float] | None = None,
    swivel: float = 0.35,
) -> Posture:
    """Place pelvis and hands; the torso follows.

    Continuous in its inputs, so that a dragged gizmo moves the person smoothly. A hand without
    a target keeps its arm's joints.

    Args:
        q_now: Present joint positions [m, rad], shape (18,).
        size: The person's size [m], shape (12,) (``BodySize.vector``).
        right: Target of the right palm [m], shape (3,).
        left: Target of the left palm [m], shape (3,).
        pelvis: Pelvis x [m], y [m], yaw [rad]; as it is where None.
        swivel: Turn of the elbow out of the vertical plane through shoulder and hand [rad].
    """
    q = np.array(q_now, dtype=np.float64)
    if pelvis is not None:
        q[:3] = pelvis
    given = {"r": right, "l": left}
    targets = {hand: target for hand, target in given.items() if target is not None}
    if targets:
        q[3:6] = _lean(q, size, targets)
    for hand, target in targets.items():
        first = 10 if hand == "r" else 14
        q[first : first + 4] = _solve_arm(q, size, hand, target, swivel)
    q = np.clip(q, Q_MIN, Q_MAX)
    points = joint_points(q, size)
    errors = (np.linalg.norm(points[f"hand_{hand}"] - targets[hand]) for hand in targets)
    return Posture(q=q, reached=all(bool(error < 0.01) for error in errors))


def _lean(q: Vec, size: Vec, targets: dict[str, Vec]) -> Vec:
    """Return abdomen angles [rad], shape (3,), that bring the shoulders near their targets.

    Bends the trunk just far enough: bisection on one lean factor along the direction of the
    farthest target, so that its shoulder comes within EASY_REACH of the arm's length.
    """
    neutral = q.copy()
    neutral[3:6] = 0.0
    points = joint_points(neutral, size)
    c, s = math.cos(q[2]), math.sin(q[2])
    best = np.zeros(3)
    for hand, target in targets.items():
        offset = target - points[f"shoulder_{hand}"]
        forward, sideways = c * offset[0] + s * offset[1], c * offset[1] - s * offset[0]
        heading = math.atan2(sideways, max(forward, 0.05))
        sign = 1.0 if hand == "r" else -1.0
        direction = np.array(
            [
                math.cos(heading),
                -0.35 * math.sin(heading),
                0.25 * sign + 0.5 * math.sin(heading),
            ]
        )
        angles = _lean_factor(neutral, size, hand, target, direction) * direction
        if np.abs(angles).max() > np.abs(best).max():
            best = angles
    return np.clip(best, Q_MIN[3:6], Q_MAX[3:6])


def _lean_factor(q: Vec, size: Vec, hand: str, target: Vec, direction: Vec) -> float:
    trial, easy = q.copy(), EASY_REACH * sum(arm_lengths(size, hand))
    writable, trig = as_kernel_array(size), np.empty((3, 16))
    points, frames = np.empty((body.N_POINTS, 3)), np.empty((body.N_FRAMES, 3, 3))
    shoulder, abdomen = points[POINT_NAMES.index(f"shoulder_{hand}")], trial[3:6]

    def gap(factor: float) -> float:
        np.minimum(np.maximum(factor * direction, Q_MIN[3:6]), Q_MAX[3:6], out=abdomen)
        body.points_and_frames(trial, writable, trig, points, frames)
        offset = target - shoulder
        return math.sqrt(offset @ offset) - easy

    if gap(0.0) <= 0.0:
        return 0.0
    low, high = 0.0, 1.2
    for _ in range(14):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if gap(middle) > 0.0 else (low, middle)
    return high


def _solve_arm(q: Vec, size: Vec, hand: str, target: Vec, swivel: float) -> Vec:
    """Return flexion, abduction, rotation, elbow [rad] that bring the palm to ``target``."""
    points, frames = _forward(q, size)
    torso = frames[body.F_TORSO]
    shoulder = points[POINT_NAMES.index(f"shoulder_{hand}")]
    side = -1.0 if hand == "r" else 1.0
    upper, fore = arm_lengths(size, hand)
    offset = target - shoulder
    distance = float(np.linalg.norm(offset))
    line = offset / distance if distance > 1e-6 else -torso[:, 2]
    least = max(NEAREST_PALM, abs(upper - fore) + 0.01)  # the elbow is never quite folded
    span = min(max(distance, least), upper + fore - 1e-4)
    along = (upper**2 - fore**2 + span**2) / (2.0 * span)
    across = math.sqrt(max(upper**2 - along**2, 0.0))
    pole = _elbow_pole(torso, line, side, swivel)
    elbow = along * line + across * pole
    fore_direction = span * line - elbow
    z = -elbow / np.linalg.norm(elbow)
    x = fore_direction - (fore_direction @ z) * z
    x /= np.linalg.norm(x)
    rotation = torso.T @ np.column_stack([x, np.cross(z, x), z])
    bend = math.acos(np.clip(-(fore_direction @ z) / fore, -1.0, 1.0))
    abduct = -side * math.asin(np.clip(rotation[1, 2], -1.0, 1.0))
    flex = -math.atan2(rotation[0, 2], rotation[2, 2])
    rotate = math.atan2(rotation[1, 0], rotation[1, 1])
    return np.array([flex, abduct, rotate, bend])


def _elbow_pole(torso: Vec, line: Vec, side: float, swivel: float) -> Vec:
    """Return the unit vector from ``line`` to the elbow, normal to the line."""
    down = -torso[:, 2] - 0.3 * torso[:, 0]
    down = down - (down @ line) * line
    if np.linalg.norm(down) < 1e-6:
        down = torso[:, 0] - (torso[:, 0] @ line) * line
    down /= np.linalg.norm(down)
    outward = np.cross(line, down)
    outward *= np.sign(side * (outward @ torso[:, 1])) or 1.0
    pole = math.cos(swivel) * down + math.sin(swivel) * outward
    return np.asarray(pole / np.linalg.norm(pole))


def reach(
    hand: Hand,
    position: Vec,
    q_start: Vec,
    size: Vec,
    *,
    pelvis: tuple[float, float, float] | None = None,
    swivel: float = 0.35,
) -> Posture:
    """Return the posture with one palm at ``position``, the other arm as in ``q_start``.

    Args:
        hand: ``"r"`` or ``"l"``.
        position: Target of the palm [m], shape (3,).
        q_start: Joint positions to start from [m, rad], shape (18,).
        size: The person's size [m], shape (12,) (``BodySize.vector``).
        pelvis: Pelvis x [m], y [m], yaw [rad]; as it is where None.
        swivel: Turn of the elbow outward [rad].
    """
    right, left = (position, None) if hand == "r" else (None, position)
    return solve_hands(q_start, size, right=right, left=left, pelvis=pelvis, swivel=swivel)
