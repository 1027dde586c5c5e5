"""The 18 joint angles of a person from key-points, in closed form.

Pelvis position from the mid-hip, its yaw from the hips; abdomen angles from the torso's axes
(mid-hip, neck, shoulders); clavicles from shoulders and neck. Each arm is a triangle shoulder -
elbow - wrist with the model's lengths that meets the measured wrist, if possible; the measured
elbow determines its rotation about the line to the wrist. A rotation of the shoulder line
relative to the hips counts as twist of the trunk.

Joints without key-points keep their angles and are named. The computation is compiled
(``perception/kernels/pose_fit.py``) and shares its formulas (``human/kernels/joint_angles.py``)
with the inverse kinematics of recordings (``inverse_kinematics.py``).

Source: docs/method.md 2.8 and 3.4; the inverse of ``human/kernels/kinematics.py``.
"""

import math
from collections.abc import Iterable

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.perception.kernels.pose_fit import Mask, fit_joints, new_fit_space
from app.sim.perception.keypoints import K

_STEP_S = 0.005
"""Step of the derivative of the joint angles [s]."""
_Q_MIN, _Q_MAX = human.Q_MIN.copy(), human.Q_MAX.copy()
"""Joint limits, writable, because the kernel is compiled separately for read-only arrays."""
_Q_MIN[:2], _Q_MAX[:2] = -np.inf, np.inf  # a person far away is there, not at the model's 5 m


FITTED = ("neck", *(f"{part}_{s}" for part in ("shoulder", "elbow", "wrist") for s in "rl"))
"""Key-points that are joints of the model, besides the pelvis, whose height is given."""
_TRUNK = ("neck", "shoulder_r", "shoulder_l")


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
    q, held = np.array(q_before, dtype=np.float64), np.empty(18, dtype=np.bool_)
    seen, lengths = np.array(points, dtype=np.float64), np.array(size, dtype=np.float64)
    fit_joints(seen, lengths, _Q_MIN, _Q_MAX, new_fit_space(), q, held)
    return q, held


def joint_motion(
    points: Vec, speeds: Vec, q_before: Vec, size: Vec, qd_max: float
) -> tuple[Vec, Vec, Mask]:
    """Return joint positions, joint speeds and held joints, each of shape (18,).

    Joint speeds are the derivative of the positions along the key-points' speeds.

    Args:
        points: Key-points [m], shape (25, 3), NaN where missing.
        speeds: Their speeds [m/s], shape (25, 3).
        q_before: The last joint positions [m, rad], shape (18,).
        size: The person's size [m], shape (12,).
        qd_max: Bound of the speeds [rad/s, m/s]; faster is noise near a singularity.
    """
    q, held = joint_angles(points, q_before, size)
    ahead, _ = joint_angles(points + _STEP_S * speeds, q, size)
    behind, _ = joint_angles(points - _STEP_S * speeds, q, size)
    change = ahead - behind
    change[2] = (change[2] + math.pi) % (2.0 * math.pi) - math.pi
    qd = np.clip(change / (2.0 * _STEP_S), -qd_max, qd_max)
    qd[held] = 0.0
    return q, qd, held


def fit_errors(q: Vec, size: Vec, points: Vec) -> tuple[float, float, float]:
    """Return the distances of the model's joints from key-points [m]; NaN if all are unseen.

    Args:
        q: Joint positions [m, rad], shape (18,).
        size: The person's size [m], shape (12,).
        points: Key-points [m], shape (25, 3), NaN where missing.

    Returns:
        The median over all joints; for the trunk alone the greater one of the median over neck
        and shoulders and of the error of the hips' height, which the model does not fit; and
        the greater one of both wrists, 0 if they are unseen.
    """
    joints = human.joint_points(q, size)
    away = [float(np.linalg.norm(points[K[name]] - joints[name])) for name in FITTED]
    hips = abs(float(points[K["mid_hip"], 2] - joints["pelvis"][2]))
    trunk = [_median(one for one, name in zip(away, FITTED, strict=True) if name in _TRUNK)]
    unfit = max((d for d in (*trunk, hips) if d == d), default=math.nan)
    return _median(away), unfit, max((d for d in away[-2:] if d == d), default=0.0)


def _median(values: Iterable[float]) -> float:
    there = [value for value in values if math.isfinite(value)]
    return float(np.median(there)) if there else math.nan
