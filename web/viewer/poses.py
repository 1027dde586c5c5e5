"""Conversion of rotations to and from viser's quaternion order.

Tandem represents poses by homogeneous matrices. viser expects quaternions as w, x, y, z
(Pinocchio stores x, y, z, w); only this module creates them.
"""

import math

import numpy as np
from scipy.spatial.transform import Rotation

from app.sim.core.arrays import Vec


def orientation(rotation: Vec) -> Vec:
    """Return viser's quaternions of rotation matrices (..., 3, 3), unit length, (..., 4)."""
    return np.asarray(Rotation.from_matrix(rotation).as_quat(scalar_first=True))


def upright(yaw: float) -> Vec:
    """Return viser's quaternion of a rotation about z by ``yaw`` [rad], shape (4,)."""
    return np.array([math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)])


def yaw_of(quaternion: Vec) -> float:
    """Return the rotation about z [rad] of a quaternion from viser (w, x, y, z)."""
    w, x, y, z = (float(value) for value in quaternion)
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def interpolate_rotation(first: Vec, second: Vec, share: float) -> Vec:
    """Return the rotation between two rotations on the shortest arc, shape (3, 3).

    Args:
        first: Rotation matrix at share 0, shape (3, 3).
        second: Rotation matrix at share 1, shape (3, 3).
        share: Interpolation parameter, 0 to 1.
    """
    turn = Rotation.from_matrix(first.T @ second).as_rotvec()
    return np.asarray(first @ Rotation.from_rotvec(share * turn).as_matrix())
