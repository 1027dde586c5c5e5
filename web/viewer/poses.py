"""Rotations on their way to viser and back: the one place that knows its quaternion order.

Inside Tandem a pose is a homogeneous matrix. viser wants quaternions as w, x, y, z (Pinocchio
stores x, y, z, w); they are made from matrices here and nowhere else.
"""

import math

import numpy as np
from numpy.typing import NDArray

Vec = NDArray[np.float64]


def orientation(rotation: Vec) -> Vec:
    """Return viser's unit quaternions (w, x, y, z) of rotation matrices, shape (..., 4).

    Args:
        rotation: Rotation matrices, shape (..., 3, 3).
    """
    r = np.asarray(rotation, dtype=np.float64)
    xx, yy, zz = r[..., 0, 0], r[..., 1, 1], r[..., 2, 2]
    squares = 1.0 + np.stack([xx + yy + zz, xx - yy - zz, yy - xx - zz, zz - xx - yy], axis=-1)
    wx, wy, wz = (
        r[..., 2, 1] - r[..., 1, 2],
        r[..., 0, 2] - r[..., 2, 0],
        r[..., 1, 0] - r[..., 0, 1],
    )
    xy, xz, yz = (
        r[..., 0, 1] + r[..., 1, 0],
        r[..., 0, 2] + r[..., 2, 0],
        r[..., 1, 2] + r[..., 2, 1],
    )
    # Row k is 4 q_k times q; the row of the greatest component divides safely.
    rows = np.stack(
        [
            np.stack([squares[..., 0], wx, wy, wz], axis=-1),
            np.stack([wx, squares[..., 1], xy, xz], axis=-1),
            np.stack([wy, xy, squares[..., 2], yz], axis=-1),
            np.stack([wz, xz, yz, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    best = squares.argmax(axis=-1)[..., None, None]
    row = np.take_along_axis(rows, best, axis=-2)[..., 0, :]
    return np.asarray(row / np.linalg.norm(row, axis=-1, keepdims=True))


def upright(yaw: float) -> Vec:
    """Return viser's quaternion of a turn about z by ``yaw`` [rad], shape (4,)."""
    return np.array([math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)])


def yaw_of(quaternion: Vec) -> float:
    """Return the turn about z [rad] of a quaternion that came from viser."""
    w, x, y, z = (float(value) for value in quaternion)
    return math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def interpolate_rotation(first: Vec, second: Vec, share: float) -> Vec:
    """Return the rotation between two rotations on the shortest arc, shape (3, 3).

    Args:
        first: Rotation matrix at share 0, shape (3, 3).
        second: Rotation matrix at share 1, shape (3, 3).
        share: Interpolation parameter, 0 to 1.
    """
    turn = first.T @ second
    w, x, y, z = orientation(turn)
    axis = np.array([x, y, z])
    sine = float(np.linalg.norm(axis))
    if sine < 1e-9:
        return first
    angle = 2.0 * math.atan2(sine, abs(float(w))) * share
    axis = axis / sine * (1.0 if w >= 0.0 else -1.0)
    cross = np.array(
        [[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]]
    )
    part = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross
    return np.asarray(first @ part)
