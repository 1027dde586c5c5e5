"""Joint centres of a recorded person over time, and body lengths measured from them."""

from dataclasses import dataclass, field

import numpy as np
import scipy

from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import BodySize
from app.sim.mocap.bvh import axis_turns

TRACK_NAMES = (
    "pelvis",
    "neck",
    "shoulder_r",
    "elbow_r",
    "wrist_r",
    "shoulder_l",
    "elbow_l",
    "wrist_l",
)
"""Joint centres that determine the 18 angles."""
PELVIS, NECK, SHOULDER_R, ELBOW_R, WRIST_R, SHOULDER_L, ELBOW_L, WRIST_L = range(8)
MEASURED = (
    "trunk",
    "clavicle_r",
    "clavicle_l",
    "upper_arm_r",
    "upper_arm_l",
    "forearm_r",
    "forearm_l",
)
"""Lengths determined by joint centres; all others are those of the median person."""
SIDES = {"r": -1.0, "l": 1.0}
"""Sign of the body's lateral axis (y, to the left) on either side."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyTrack:
    """Joint centres over time."""

    times: Vec
    """Increasing times [s], shape (n,)."""
    points: Vec
    """Joint centres in the order of TRACK_NAMES, z up [m], shape (n, 8, 3)."""
    upright: Vec = field(default_factory=lambda: np.eye(3))
    """Trunk's frame (:func:`trunk_frame`) in upright standing, shape (3, 3); not the identity
    if the recorded pelvis is off the trunk's axis."""
    hips: Vec | None = None
    """Vector from the right to the left hip [m], shape (n, 3); None without legs."""


def measure(points: Vec) -> BodySize:
    """Return the median lengths of a person's segments [m].

    Args:
        points: Joint centres [m], shape (n, 8, 3).
    """

    def length(a: int, b: int) -> float:
        return float(np.median(np.linalg.norm(points[:, b] - points[:, a], axis=1)))

    return BodySize(
        trunk=length(PELVIS, NECK),
        clavicle_r=length(NECK, SHOULDER_R),
        clavicle_l=length(NECK, SHOULDER_L),
        upper_arm_r=length(SHOULDER_R, ELBOW_R),
        upper_arm_l=length(SHOULDER_L, ELBOW_L),
        forearm_r=length(ELBOW_R, WRIST_R),
        forearm_l=length(ELBOW_L, WRIST_L),
    )


def trunk_frame(pelvis: Vec, neck: Vec, across: Vec) -> Vec:
    """Return the frame of the points of the trunk, shape (n, 3, 3).

    Args:
        pelvis: Centre of the pelvis, shape (n, 3).
        neck: Base of the neck, shape (n, 3); the frame's z points to it from the pelvis.
        across: From the right to the left shoulder, shape (n, 3); y lies along it.
    """
    z = unit(neck - pelvis)
    x = unit(np.cross(across, z))
    return np.stack([x, np.cross(z, x), z], axis=2)


def unit(v: Vec) -> Vec:
    """Return vectors of length one, shape (..., 3); a zero vector stays zero."""
    return np.asarray(v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9))


def model_points(q: Vec, pelvis_z: Vec, size: BodySize) -> Vec:
    """Return the joint centres of the 18-DoF model [m], shape (n, 8, 3).

    Args:
        q: Joint positions [m, rad], shape (n, 18).
        pelvis_z: Height of the pelvis [m], shape (n,).
        size: The person's lengths.
    """
    points = np.empty((len(q), 8, 3))
    points[:, PELVIS, :2], points[:, PELVIS, 2] = q[:, :2], pelvis_z
    torso = axis_turns(2, q[:, 2]) @ euler_turns(q[:, 3], q[:, 4], q[:, 5])
    points[:, NECK] = points[:, PELVIS] + size.trunk * torso[:, :, 2]
    lengths = size.lengths()
    for hand, side in SIDES.items():
        clavicle, arm = (6, 10) if hand == "r" else (8, 14)
        shoulder = SHOULDER_R if hand == "r" else SHOULDER_L
        protract, elevate = q[:, clavicle], q[:, clavicle + 1]
        level = np.cos(elevate)
        direction = np.stack(
            [level * np.sin(protract), side * level * np.cos(protract), np.sin(elevate)], axis=1
        )
        step = lengths[f"clavicle_{hand}"] * np.einsum("nij,nj->ni", torso, direction)
        points[:, shoulder] = points[:, NECK] + step
        flex, abduct, rotate, bend = q[:, arm : arm + 4].T
        upper = torso @ euler_turns(-flex, side * abduct, rotate)
        fore = upper @ axis_turns(1, -bend)
        upper_arm, forearm = lengths[f"upper_arm_{hand}"], lengths[f"forearm_{hand}"]
        points[:, shoulder + 1] = points[:, shoulder] - upper_arm * upper[:, :, 2]
        points[:, shoulder + 2] = points[:, shoulder + 1] - forearm * fore[:, :, 2]
    return points


def euler_turns(a: Vec, b: Vec, c: Vec) -> Vec:
    """Return ``Ry(a) Rx(b) Rz(c)`` for angles [rad] of shape (n,), shape (n, 3, 3)."""
    return np.asarray(
        scipy.spatial.transform.Rotation.from_euler(
            "YXZ", np.column_stack([a, b, c])
        ).as_matrix()
    )
