"""The 18-DoF person a second time, in plain numpy: the reference for the kernels.

A tree of homogeneous transforms from docs/method.md 3.4 for a person of any size; nothing is
taken from ``human/kernels/kinematics.py`` but the order of the capsules and their radii. A
clavicle is a bar that turns about the torso's z by protraction and then lifts by elevation; it
carries the shoulder's place, not its orientation.
"""

import numpy as np

from app.sim.human.anthropometry import BodySize
from app.sim.human.kernels import kinematics as body

PELVIS_HALF, CHEST_HALF = 0.06, 0.07
"""Half widths of the median person's capsules of pelvis and chest [m]."""
CHEST_HEIGHT, ABDOMEN = 0.30 / 0.44, 0.24 / 0.44
"""Height of the chest's capsule and length of the abdomen's, of the trunk's length."""
HEAD_START, CROWN = (0.01, 0.06 / 0.17), (0.02, 0.22 / 0.17)
"""Ends of the head's capsule above the base of the neck: forward [m], up [head's height]."""
HAND_TIP = 0.15 / 0.09
"""Wrist to the end of the hand's capsule, of the way to the palm."""
HIP_DROP = 0.05
"""How far the legs begin below the pelvis [m]."""


def turn(axis: str, angle: np.ndarray) -> np.ndarray:
    """Homogeneous rotations about an axis, shape (n, 4, 4)."""
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    out = np.tile(np.eye(4), (len(angle), 1, 1))
    out[:, i, i] = out[:, j, j] = np.cos(angle)
    out[:, j, i] = np.sin(angle)
    out[:, i, j] = -np.sin(angle)
    return out


def shift(x: float, y: float, z: float) -> np.ndarray:
    """A homogeneous translation, shape (4, 4)."""
    out = np.eye(4)
    out[:3, 3] = x, y, z
    return out


def at(pose: np.ndarray, x: float, y: float, z: float) -> np.ndarray:
    """Where a point of a body is [m], shape (n, 3)."""
    return (pose @ np.array([x, y, z, 1.0]))[:, :3]


def frames(q: np.ndarray, size: BodySize, floor_z: float) -> dict[str, np.ndarray]:
    """T_world_body of the bodies for joints ``q``, shape (n, 18); each of shape (n, 4, 4)."""
    pelvis = turn("z", q[:, 2])
    pelvis[:, :2, 3], pelvis[:, 2, 3] = q[:, :2], floor_z + size.pelvis
    torso = pelvis @ turn("y", q[:, 3]) @ turn("x", q[:, 4]) @ turn("z", q[:, 5])
    found, lengths = {"pelvis": pelvis, "torso": torso}, size.lengths()
    for hand, side, clavicle, arm in (("r", -1.0, 6, 10), ("l", 1.0, 8, 14)):
        bar = torso @ shift(0.0, 0.0, size.trunk)
        bar = bar @ turn("z", -side * q[:, clavicle]) @ turn("x", side * q[:, clavicle + 1])
        upper = torso.copy()
        upper[:, :3, 3] = at(bar, 0.0, side * lengths[f"clavicle_{hand}"], 0.0)
        upper = upper @ turn("y", -q[:, arm]) @ turn("x", side * q[:, arm + 1])
        upper = upper @ turn("z", q[:, arm + 2])
        elbow = shift(0.0, 0.0, -lengths[f"upper_arm_{hand}"])
        fore = upper @ elbow @ turn("y", -q[:, arm + 3])
        found[f"upper_arm_{hand}"], found[f"forearm_{hand}"] = upper, fore
    return found


def capsule_ends(q: np.ndarray, size: BodySize, floor_z: float) -> np.ndarray:
    """Ends of the twelve capsules [m], shape (n, 12, 2, 3), order of ``CAPSULE_NAMES``."""
    pose, lengths = frames(q, size, floor_z), size.lengths()
    pelvis, torso = pose["pelvis"], pose["torso"]
    neck, head, thick, out = size.trunk, size.head, size.girth, {}
    half, wide = thick * PELVIS_HALF, thick * CHEST_HALF
    out[body.C_PELVIS] = [at(pelvis, 0, y, 0) for y in (half, -half)]
    out[body.C_ABDOMEN] = [at(torso, 0, 0, z) for z in (0, neck * ABDOMEN)]
    out[body.C_CHEST] = [at(torso, 0, y, neck * CHEST_HEIGHT) for y in (wide, -wide)]
    out[body.C_HEAD] = [at(torso, x, 0, neck + head * z) for x, z in (HEAD_START, CROWN)]
    for k, hand in enumerate("rl"):
        upper, fore = pose[f"upper_arm_{hand}"], pose[f"forearm_{hand}"]
        wrist, elbow = -lengths[f"forearm_{hand}"], -lengths[f"upper_arm_{hand}"]
        tip = wrist - size.hand * HAND_TIP
        out[body.C_UPPER_ARM_R + k] = [at(upper, 0, 0, z) for z in (0, elbow)]
        out[body.C_FOREARM_R + k] = [at(fore, 0, 0, z) for z in (0, wrist)]
        out[body.C_HAND_R + k] = [at(fore, 0, 0, z) for z in (wrist, tip)]
        hip = at(pelvis, 0, (2 * k - 1) * size.hip, -HIP_DROP)
        foot = hip.copy()
        foot[:, 2] = floor_z + thick * body.RADII[body.C_LEG_R]
        out[body.C_LEG_R + k] = [hip, foot]
    return np.stack([np.stack(out[k], axis=1) for k in range(body.N_CAPSULES)], axis=1)
