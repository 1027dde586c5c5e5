"""Poses on their way to viser: the one place where quaternions change order.

Inside Tandem a pose is a homogeneous matrix; scipy and Pinocchio store quaternions as
x, y, z, w, viser wants w, x, y, z.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Vec = NDArray[np.float64]


def wxyz(xyzw: Vec) -> Vec:
    """Return quaternions in viser's order, shape (..., 4).

    Args:
        xyzw: Quaternions as scipy and Pinocchio store them, shape (..., 4).
    """
    return np.roll(xyzw, 1, axis=-1)


def xyzw(quaternion: Vec) -> Vec:
    """Return quaternions that came from viser in scipy's order, shape (..., 4)."""
    return np.roll(np.asarray(quaternion, dtype=np.float64), -1, axis=-1)


def orientation(rotation: Vec) -> Vec:
    """Return viser's quaternion of rotation matrices, shape (..., 4).

    Args:
        rotation: Rotation matrices, shape (..., 3, 3).
    """
    return wxyz(Rotation.from_matrix(rotation).as_quat(canonical=True))


def yaw_of(quaternion: Vec) -> float:
    """Return the turn about z [rad] of a quaternion that came from viser."""
    x = Rotation.from_quat(xyzw(quaternion)).apply([1.0, 0.0, 0.0])
    return float(np.arctan2(x[1], x[0]))


def upright(yaw: float) -> Vec:
    """Return viser's quaternion of a turn about z by ``yaw`` [rad]."""
    return wxyz(Rotation.from_euler("z", yaw).as_quat(canonical=True))
