"""The bones inside the mannequin: where each is for a posture, and which skin follows which.

The simulator's person has six moving bodies; skin needs more. Between two bodies that turn
against each other a bone turns half-way (two along the spine), which keeps elbows, shoulders
and waist round. Legs follow the feet that :mod:`web.gait` puts on the floor.

Frames: in the bind pose the pelvis is the origin, x forward, y left, z up, as in
``app.sim.human``.
"""

import math
from collections.abc import Mapping

import numpy as np

from app.sim import human
from app.sim.body_size import MEDIAN
from web.poses import Vec, part_way

Bones = dict[str, Vec]
"""T_world_bone by name, each of shape (4, 4)."""

PELVIS_HEIGHT = 0.95
"""Height of the pelvis the mannequin is modelled with [m]."""
HIP_SIDE, HIP_DROP = 0.09, 0.05
THIGH, SHIN = 0.42, 0.42
ANKLE_HEIGHT = 0.09
SIDES = ("r", "l")

BIND_Q = np.zeros(18)
BIND_Q[[11, 15]] = 1.05
BIND_Q[[13, 17]] = 0.12
BIND_Q.setflags(write=False)


def _between(first: Vec, second: Vec, share: float) -> Vec:
    """Return a frame at ``second``'s origin, turned by a share of the way from ``first``."""
    frame = second.copy()
    frame[:3, :3] = part_way(first[:3, :3], second[:3, :3], share)
    return frame


def rest_feet(pelvis: Vec, floor_z: float) -> dict[str, Vec]:
    """Return T_world_foot of both feet under the pelvis; the origin is the ankle.

    Args:
        pelvis: T_world_pelvis, shape (4, 4).
        floor_z: Height of the floor [m].
    """
    feet = {}
    for side in SIDES:
        sign = -1.0 if side == "r" else 1.0
        foot = pelvis @ _turned(0.12 * sign)
        foot[:3, 3] = pelvis[:3, 3] + pelvis[:3, :3] @ [-0.01, sign * 0.105, 0.0]
        foot[2, 3] = floor_z + ANKLE_HEIGHT
        feet[side] = foot
    return feet


def _turned(yaw: float) -> Vec:
    frame = np.eye(4)
    frame[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
    return frame


def _leg(pelvis: Vec, foot: Vec, side: str) -> tuple[Vec, Vec]:
    """Return thigh and shin frames that connect hip and ankle, the knee to the front."""
    sign = -1.0 if side == "r" else 1.0
    hip = pelvis[:3, 3] + pelvis[:3, :3] @ [0.0, sign * HIP_SIDE, -HIP_DROP]
    ankle = foot[:3, 3]
    line = ankle - hip
    distance = float(np.linalg.norm(line))
    span = min(distance, THIGH + SHIN - 1e-4)
    line = line / distance
    forward = 0.5 * (pelvis[:3, 0] + foot[:3, 0])
    forward = forward - (forward @ line) * line
    forward /= np.linalg.norm(forward)
    along = (THIGH**2 - SHIN**2 + span**2) / (2.0 * span)
    knee = hip + along * line + math.sqrt(max(THIGH**2 - along**2, 0.0)) * forward
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
    """Return every bone's pose.

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
    for side in SIDES:
        upper, fore = body[f"upper_arm_{side}"], body[f"forearm_{side}"]
        out[f"upper_{side}"], out[f"fore_{side}"] = upper, fore
        out[f"shoulder_{side}"] = _between(torso, upper, 0.5)
        out[f"shoulder_{side}"][:3, 3] = upper[:3, 3]
        out[f"elbow_{side}"] = _between(upper, fore, 0.5)
        hand = fore.copy()
        hand[:3, 3] = fore[:3, 3] - 0.26 * fore[:3, 2]
        out[f"hand_{side}"] = hand
        out[f"thigh_{side}"], out[f"shin_{side}"] = _leg(pelvis, feet[side], side)
        out[f"foot_{side}"] = feet[side]
    return out


def bind_bones() -> Bones:
    """Return the bones in the pose the mannequin is modelled in, pelvis at the origin."""
    feet = rest_feet(np.eye(4), -PELVIS_HEIGHT)
    return bones(BIND_Q, MEDIAN.vector(-MEDIAN.pelvis), feet)


def _ramp(x: Vec, low: float, high: float) -> Vec:
    t = np.clip((x - low) / (high - low), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def _hat(share: Vec, index: int, count: int) -> Vec:
    """Return the weight of knot ``index`` of ``count`` for positions ``share`` in [0, 1]."""
    return np.maximum(1.0 - np.abs(share * (count - 1) - index), 0.0)


def _along_arm(vertices: Vec, origin: Vec, tip: Vec) -> tuple[Vec, Vec]:
    """Return distance along and away from the line origin-tip [m], each of shape (n,)."""
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
    """Return skin weights of what covers the trunk only, by bone, each of shape (n,)."""
    share = _ramp(vertices[:, 2], -0.10, 0.26)
    names = ("pelvis", "spine_1", "spine_2", "torso")
    return {name: _hat(share, i, 4) for i, name in enumerate(names)}


def leg_weights(vertices: Vec) -> dict[str, Vec]:
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
