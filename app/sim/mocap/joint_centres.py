"""Joint centres of a recorded person over time, and body lengths measured from them."""

from dataclasses import dataclass, field

import numpy as np

from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.human.anthropometry import BodySize
from app.sim.human.kernels import kinematics as body
from app.sim.human.model import POINT_NAMES

TRACK_NAMES = (
    *("pelvis", "neck"),
    *("shoulder_r", "elbow_r", "wrist_r", "shoulder_l", "elbow_l", "wrist_l"),
)
"""Joint centres that determine the 18 angles."""
PELVIS, NECK, SHOULDER_R, ELBOW_R, WRIST_R, SHOULDER_L, ELBOW_L, WRIST_L = range(8)
_TRACKED = [POINT_NAMES.index(name) for name in TRACK_NAMES]
_SEGMENTS = {
    "trunk": (PELVIS, NECK),
    "clavicle_r": (NECK, SHOULDER_R),
    "clavicle_l": (NECK, SHOULDER_L),
    "upper_arm_r": (SHOULDER_R, ELBOW_R),
    "upper_arm_l": (SHOULDER_L, ELBOW_L),
    "forearm_r": (ELBOW_R, WRIST_R),
    "forearm_l": (ELBOW_L, WRIST_L),
}
MEASURED = tuple(_SEGMENTS)
"""Lengths determined by joint centres; all others are those of the median person."""


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
    return BodySize(
        **{
            name: float(np.median(np.linalg.norm(points[:, b] - points[:, a], axis=1)))
            for name, (a, b) in _SEGMENTS.items()
        }
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
    lengths, trig = size.vector(0.0), np.empty((3, 16))
    points, frames = np.empty((len(q), body.N_POINTS, 3)), np.empty((body.N_FRAMES, 3, 3))
    for joints, height, out in zip(as_kernel_array(q), pelvis_z, points, strict=True):
        lengths[body.PELVIS_Z] = height
        body.points_and_frames(joints, lengths, trig, out, frames)
    return points[:, _TRACKED]
