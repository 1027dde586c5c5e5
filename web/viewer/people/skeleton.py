"""Bones of the mannequin: poses for a posture, and skin weights.

The simulator's person has six moving bodies; the skin needs more bones. Between two bodies that
rotate relative to each other an additional bone has half of the rotation (two bones along the
spine), so that elbows, shoulders and waist keep their cross-section. Legs follow the feet that
:mod:`web.viewer.people.gait` places on the floor.

Frames: in the bind pose the pelvis is the origin, x forward, y left, z up, as in
``app.sim.human.model``. The mannequin is the median person; for another size its skin is scaled
bone by bone (:func:`scales`): along the bone by its length, across it by the girth. The length
of the legs is proportional to the girth, which increases with the stature.
"""

import math
from collections.abc import Mapping

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import MEDIAN
from app.sim.human.kernels import kinematics as lengths
from web.viewer.poses import interpolate_rotation

Bones = dict[str, Vec]
"""T_world_bone by name, each of shape (4, 4)."""

PELVIS_HEIGHT = 0.95
"""Pelvis height of the mannequin in the bind pose [m]."""
HIP_SIDE = 0.09
"""Half of the distance between the hips at girth 1 [m]."""
THIGH, SHIN = 0.42, 0.42
"""Lengths of the median person's legs [m]."""
ANKLE_HEIGHT = 0.09
"""Height of the median person's ankle above the sole [m]."""
SIDES = ("r", "l")
MEDIAN_SIZE = MEDIAN.vector(-MEDIAN.pelvis)
MEDIAN_SIZE.setflags(write=False)
"""Size of the median person with the pelvis at height 0, shape (12,)."""

BIND_Q = np.zeros(18)
BIND_Q[[11, 15]] = 1.05
BIND_Q[[13, 17]] = 0.12
BIND_Q.setflags(write=False)


def _between(first: Vec, second: Vec, share: float) -> Vec:
    """Return a frame at the origin of ``second`` with an interpolated rotation."""
    frame = second.copy()
    frame[:3, :3] = interpolate_rotation(first[:3, :3], second[:3, :3], share)
    return frame


def rest_feet(pelvis: Vec, floor_z: float, girth: float = 1.0) -> dict[str, Vec]:
    """Return T_world_foot of both feet under the pelvis; the origin is the ankle.

    Args:
        pelvis: T_world_pelvis, shape (4, 4).
        floor_z: Height of the floor [m].
        girth: Size of the legs relative to the median person's.
    """
    feet = {}
    for side in SIDES:
        sign = -1.0 if side == "r" else 1.0
        foot = pelvis @ _turned(0.12 * sign)
        foot[:3, 3] = pelvis[:3, 3] + pelvis[:3, :3] @ [-0.01, sign * 0.105 * girth, 0.0]
        foot[2, 3] = floor_z + ANKLE_HEIGHT * girth
        feet[side] = foot
    return feet


def _turned(yaw: float) -> Vec:
    frame = np.eye(4)
    frame[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
    return frame


def _leg(pelvis: Vec, foot: Vec, side: str, size: Vec) -> tuple[Vec, Vec]:
    """Return the frames of thigh and shin between hip and ankle, with the knee in front."""
    sign, girth = -1.0 if side == "r" else 1.0, float(size[lengths.GIRTH])
    thigh, shin = THIGH * girth, SHIN * girth
    hip = pelvis[:3, 3] + pelvis[:3, :3] @ [
        0.0,
        sign * size[lengths.HIP],
        -lengths.HIP_DROP * girth,
    ]
    ankle = foot[:3, 3]
    line = ankle - hip
    distance = float(np.linalg.norm(line))
    span = min(distance, thigh + shin - 1e-4)
    line = line / distance
    forward = 0.5 * (pelvis[:3, 0] + foot[:3, 0])
    forward = forward - (forward @ line) * line
    forward /= np.linalg.norm(forward)
    along = (thigh**2 - shin**2 + span**2) / (2.0 * span)
    knee = hip + along * line + math.sqrt(max(thigh**2 - along**2, 0.0)) * forward
    return _pointing(hip, knee, forward), _pointing(knee, ankle, forward)


def _pointing(origin: Vec, tip: Vec, forward: Vec) -> Vec:
    """Return a frame at ``origin`` whose -z points at ``tip`` and x lies near ``forward``."""
    z = (origin - tip) / np.linalg.norm(origin - tip)
    x = forward - (forward @ z) * z
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3, :3] = np.column_stack([x, np.cross(z, x), z])
    frame[:3, 3] = origin
    return frame


def bones(q: Vec, size: Vec, feet: Mapping[str, Vec]) -> Bones:
    """Return T_world_bone of every bone by name, shape (4, 4) each.

    Args:
        q: Joint positions [m, rad], shape (18,).
        size: The person's size [m], shape (12,) (``Cell.body``).
        feet: T_world_foot by side, ``"r"`` and ``"l"``.
    """
    body = human.body_frames(q, size)
    pelvis, torso = body["pelvis"], body["torso"]
    out = {"pelvis": pelvis, "torso": torso}
    out["spine_1"] = _between(pelvis, torso, 1.0 / 3.0)
    out["spine_2"] = _between(pelvis, torso, 2.0 / 3.0)
    head = _between(pelvis, torso, 0.6)
    head[:3, 3] = human.joint_points(q, size)["neck"]
    out["head"] = head
    for index, side in enumerate(SIDES):
        upper, fore = body[f"upper_arm_{side}"], body[f"forearm_{side}"]
        out[f"upper_{side}"], out[f"fore_{side}"] = upper, fore
        out[f"shoulder_{side}"] = _between(torso, upper, 0.5)
        out[f"shoulder_{side}"][:3, 3] = upper[:3, 3]
        out[f"elbow_{side}"] = _between(upper, fore, 0.5)
        hand = fore.copy()
        hand[:3, 3] = fore[:3, 3] - size[lengths.FOREARM_R + index] * fore[:3, 2]
        out[f"hand_{side}"] = hand
        out[f"thigh_{side}"], out[f"shin_{side}"] = _leg(pelvis, feet[side], side, size)
        out[f"foot_{side}"] = feet[side]
    return out


def bind_bones(size: Vec = MEDIAN_SIZE) -> Bones:
    """Return the bones in the bind pose, with the pelvis at the origin.

    Args:
        size: The person's size [m], shape (12,); the median person's by default.
    """
    here, girth = size.copy(), float(size[lengths.GIRTH])
    here[lengths.PELVIS_Z] = 0.0
    return bones(BIND_Q, here, rest_feet(np.eye(4), -PELVIS_HEIGHT * girth, girth))


def scales(size: Vec, shoulder: str = "r") -> dict[str, Vec]:
    """Return the scale factors of a person's skin along each bone's axes, shape (3,) each.

    Args:
        size: The person's size [m], shape (12,).
        shoulder: Side of the shoulder that determines the width of the trunk, ``"r"`` or
            ``"l"``.
    """
    ratio = size / np.where(MEDIAN_SIZE == 0.0, 1.0, MEDIAN_SIZE)
    girth, trunk = float(ratio[lengths.GIRTH]), float(ratio[lengths.TRUNK])
    wide = float(ratio[lengths.CLAVICLE_R + SIDES.index(shoulder)])
    hip = float(ratio[lengths.HIP])
    out = {
        name: np.array([girth, hip + share * (wide - hip), trunk])
        for name, share in (
            ("pelvis", 0.0),
            ("spine_1", 1 / 3),
            ("spine_2", 2 / 3),
            ("torso", 1.0),
        )
    }
    out["head"] = np.full(3, float(ratio[lengths.HEAD_UP]))
    for index, side in enumerate(SIDES):
        upper = float(ratio[lengths.UPPER_ARM_R + index])
        fore = float(ratio[lengths.FOREARM_R + index])
        out[f"shoulder_{side}"] = np.full(3, girth)
        for name, along in (("upper", upper), ("elbow", 0.5 * (upper + fore)), ("fore", fore)):
            out[f"{name}_{side}"] = np.array([girth, girth, along])
        out[f"hand_{side}"] = np.full(3, float(ratio[lengths.HAND]))
        for name in ("thigh", "shin", "foot"):
            out[f"{name}_{side}"] = np.full(3, girth)
    return out


def _ramp(x: Vec, low: float, high: float) -> Vec:
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def _hat(share: Vec, index: int, count: int) -> Vec:
    """Return the weight of knot ``index`` of ``count`` for positions ``share`` in [0, 1]."""
    return np.maximum(1.0 - np.abs(share * (count - 1) - index), 0.0)


def _along_arm(vertices: Vec, origin: Vec, tip: Vec) -> tuple[Vec, Vec]:
    """Return the distances along and from the line origin-tip [m], each of shape (n,)."""
    direction = (tip - origin) / np.linalg.norm(tip - origin)
    along = (vertices - origin) @ direction
    away = np.linalg.norm(vertices - origin - along[:, None] * direction, axis=1)
    return along, away


def upper_weights(vertices: Vec) -> dict[str, Vec]:
    """Return skin weights of jacket vertices in the bind pose by bone, each of shape (n,)."""
    bind = bind_bones()
    weights: dict[str, Vec] = {}
    arm_share = np.zeros(len(vertices))
    for side, sign in (("r", -1.0), ("l", 1.0)):
        shoulder = bind[f"upper_{side}"][:3, 3]
        elbow, wrist = bind[f"fore_{side}"][:3, 3], bind[f"hand_{side}"][:3, 3]
        along, away = _along_arm(vertices, shoulder, elbow)
        past, _ = _along_arm(vertices, elbow, wrist)
        own_side = sign * vertices[:, 1] > 0.0
        share = _ramp(along, -0.085, 0.115) * own_side
        share *= 1.0 - _ramp(away - 0.02 * (along > 0.1), 0.085, 0.14) * (along < 0.29)
        bend = _ramp(past, -0.06, 0.06)
        weights[f"shoulder_{side}"] = _hat(share, 1, 3)
        outer = _hat(share, 2, 3)
        weights[f"upper_{side}"] = outer * _hat(bend, 0, 3)
        weights[f"elbow_{side}"] = outer * _hat(bend, 1, 3)
        weights[f"fore_{side}"] = outer * _hat(bend, 2, 3)
        arm_share += weights[f"shoulder_{side}"] + outer
    weights.update({name: w * (1.0 - arm_share) for name, w in spine_weights(vertices).items()})
    return weights


def spine_weights(vertices: Vec) -> dict[str, Vec]:
    """Return skin weights of vertices on the trunk by bone, each of shape (n,)."""
    share = _ramp(vertices[:, 2], -0.10, 0.26)
    names = ("pelvis", "spine_1", "spine_2", "torso")
    return {name: _hat(share, i, 4) for i, name in enumerate(names)}


def segment_weights(vertices: Vec) -> dict[str, Vec]:
    """Return skin weights of trouser vertices in the bind pose by bone, each of shape (n,)."""
    z = vertices[:, 2]
    thigh = 1.0 - _ramp(z, -0.19, 0.0)
    shin = 1.0 - _ramp(z, -0.52, -0.42)
    left = _ramp(vertices[:, 1], -0.03, 0.03)
    weights = {"pelvis": (1.0 - thigh) * (1.0 - 0.4 * _ramp(z, -0.02, 0.1))}
    weights["spine_1"] = (1.0 - thigh) * 0.4 * _ramp(z, -0.02, 0.1)
    for side, own in (("r", 1.0 - left), ("l", left)):
        weights[f"thigh_{side}"] = thigh * (1.0 - shin) * own
        weights[f"shin_{side}"] = thigh * shin * own
    return weights
