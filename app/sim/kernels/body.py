"""Forward kinematics and capsules of the 18-DoF human, compiled.

Tree: pelvis (x, y, yaw) - abdomen (flexion, side bend, twist) - clavicles (protraction,
elevation) - shoulders (flexion, abduction, rotation) - elbows. Body axes: x forward, y left,
z up. The abdomen turns by ``Ry(flex) Rx(side) Rz(twist)``; an upper arm hangs along -z and
turns by ``Ry(-flex) Rx(-+abduct) Rz(rotate)`` (right, left), the forearm by ``Ry(-elbow)``.
Joint order: ``app.sim.human.JOINT_NAMES``. Source: METHOD 3.4, thesis fig. 5.2.
"""

import math

import numpy as np
from numba import njit

from app.sim.ports import Vec

NECK_HEIGHT = 0.44
"""Pelvis to the base of the neck along the torso [m]; the clavicles start here."""
CLAVICLE = 0.18
"""Length of a clavicle [m]."""
HEAD_HEIGHT = 0.17
"""Base of the neck to the centre of the head [m]."""
UPPER_ARM = 0.29
"""Shoulder to elbow [m]."""
FOREARM = 0.26
"""Elbow to wrist [m]."""
HAND = 0.09
"""Wrist to the middle of the palm [m]; "hand" means this point."""
HAND_TIP = 0.15
"""Wrist to the end of the hand's capsule [m], without its rounding."""
HIP_WIDTH = 0.09
"""Half the distance of the hips [m]."""

N_POINTS = 14
(
    PELVIS,
    WAIST,
    CHEST,
    NECK,
    HEAD,
    SHOULDER_R,
    ELBOW_R,
    WRIST_R,
    HAND_R,
    SHOULDER_L,
    ELBOW_L,
    WRIST_L,
    HAND_L,
    CROWN,
) = range(N_POINTS)

N_CAPSULES = 12
(
    C_PELVIS,
    C_ABDOMEN,
    C_CHEST,
    C_HEAD,
    C_UPPER_ARM_R,
    C_UPPER_ARM_L,
    C_FOREARM_R,
    C_FOREARM_L,
    C_HAND_R,
    C_HAND_L,
    C_LEG_R,
    C_LEG_L,
) = range(N_CAPSULES)

RADII = np.array([0.14, 0.14, 0.15, 0.11, 0.055, 0.055, 0.045, 0.045, 0.045, 0.045, 0.09, 0.09])
RADII.setflags(write=False)


N_FRAMES = 6
(
    F_PELVIS,
    F_TORSO,
    F_UPPER_ARM_R,
    F_FOREARM_R,
    F_UPPER_ARM_L,
    F_FOREARM_L,
) = range(N_FRAMES)


@njit(cache=True, inline="always")
def _euler_yxz(a: float, b: float, c: float, out: Vec) -> None:
    """Write ``Ry(a) Rx(b) Rz(c)`` into ``out``, shape (3, 3)."""
    ca, sa, cb, sb, cc, sc = (
        math.cos(a),
        math.sin(a),
        math.cos(b),
        math.sin(b),
        math.cos(c),
        math.sin(c),
    )
    out[0, 0], out[0, 1], out[0, 2] = ca * cc + sa * sb * sc, sa * sb * cc - ca * sc, sa * cb
    out[1, 0], out[1, 1], out[1, 2] = cb * sc, cb * cc, -sb
    out[2, 0], out[2, 1], out[2, 2] = ca * sb * sc - sa * cc, sa * sc + ca * sb * cc, ca * cb


@njit(cache=True, inline="always")
def _times(a: Vec, b: Vec, out: Vec) -> None:
    """Write the product of two (3, 3) matrices into ``out``."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@njit(cache=True, inline="always")
def _along(rot: Vec, x: float, y: float, z: float, origin: Vec, out: Vec) -> None:
    """Write ``origin + rot (x, y, z)`` into ``out``, shape (3,)."""
    for i in range(3):
        out[i] = origin[i] + rot[i, 0] * x + rot[i, 1] * y + rot[i, 2] * z


@njit(cache=True)
def clavicle_tip(protract: float, elevate: float, side: float, out: Vec) -> None:
    """Write the shoulder relative to the base of the neck, torso axes [m], shape (3,).

    Args:
        protract: Turn of the clavicle to the front [rad].
        elevate: Lift of the clavicle [rad].
        side: -1 for the right clavicle, +1 for the left one.
        out: Filled.
    """
    cosine = math.cos(elevate)
    out[0] = CLAVICLE * cosine * math.sin(protract)
    out[1] = side * CLAVICLE * cosine * math.cos(protract)
    out[2] = CLAVICLE * math.sin(elevate)


@njit(cache=True)
def points_and_frames(q: Vec, pelvis_z: float, points: Vec, frames: Vec) -> None:
    """Write joint centres and body orientations.

    Args:
        q: Joint positions [m, rad], shape (18,).
        pelvis_z: Height of the pelvis [m].
        points: Filled with the points named above [m], shape (N_POINTS, 3).
        frames: Filled with R_world_body, shape (N_FRAMES, 3, 3).
    """
    c, s = math.cos(q[2]), math.sin(q[2])
    pelvis = frames[F_PELVIS]
    pelvis[0, 0], pelvis[0, 1], pelvis[0, 2] = c, -s, 0.0
    pelvis[1, 0], pelvis[1, 1], pelvis[1, 2] = s, c, 0.0
    pelvis[2, 0], pelvis[2, 1], pelvis[2, 2] = 0.0, 0.0, 1.0
    points[PELVIS, 0], points[PELVIS, 1], points[PELVIS, 2] = q[0], q[1], pelvis_z
    scratch = np.empty((3, 3))
    _euler_yxz(q[3], q[4], q[5], scratch)
    torso = frames[F_TORSO]
    _times(pelvis, scratch, torso)
    origin = points[PELVIS]
    _along(torso, 0.0, 0.0, 0.12, origin, points[WAIST])
    _along(torso, 0.0, 0.0, 0.30, origin, points[CHEST])
    _along(torso, 0.0, 0.0, NECK_HEIGHT, origin, points[NECK])
    _along(torso, 0.02, 0.0, NECK_HEIGHT + HEAD_HEIGHT, origin, points[HEAD])
    _along(torso, 0.02, 0.0, NECK_HEIGHT + HEAD_HEIGHT + 0.05, origin, points[CROWN])
    tip = np.empty(3)
    for arm in range(2):
        side = -1.0 if arm == 0 else 1.0
        joints, first = 6 + 2 * arm, 10 + 4 * arm
        shoulder = SHOULDER_R if arm == 0 else SHOULDER_L
        upper = frames[F_UPPER_ARM_R if arm == 0 else F_UPPER_ARM_L]
        fore = frames[F_FOREARM_R if arm == 0 else F_FOREARM_L]
        clavicle_tip(q[joints], q[joints + 1], side, tip)
        _along(torso, tip[0], tip[1], tip[2], points[NECK], points[shoulder])
        _euler_yxz(-q[first], side * q[first + 1], q[first + 2], scratch)
        _times(torso, scratch, upper)
        _along(upper, 0.0, 0.0, -UPPER_ARM, points[shoulder], points[shoulder + 1])
        _euler_yxz(-q[first + 3], 0.0, 0.0, scratch)
        _times(upper, scratch, fore)
        _along(fore, 0.0, 0.0, -FOREARM, points[shoulder + 1], points[shoulder + 2])
        _along(fore, 0.0, 0.0, -FOREARM - HAND, points[shoulder + 1], points[shoulder + 3])


@njit(cache=True)
def capsules(points: Vec, frames: Vec, floor_z: float, out: Vec) -> None:
    """Write the end points of the twelve capsules.

    Args:
        points: From :func:`points_and_frames` [m].
        frames: From :func:`points_and_frames`.
        floor_z: Height of the floor [m].
        out: Filled [m], shape (N_CAPSULES, 2, 3).
    """
    pelvis, torso = frames[F_PELVIS], frames[F_TORSO]
    _along(pelvis, 0.0, 0.06, 0.0, points[PELVIS], out[C_PELVIS, 0])
    _along(pelvis, 0.0, -0.06, 0.0, points[PELVIS], out[C_PELVIS, 1])
    out[C_ABDOMEN, 0] = points[PELVIS]
    _along(torso, 0.0, 0.0, 0.24, points[PELVIS], out[C_ABDOMEN, 1])
    _along(torso, 0.0, 0.07, 0.0, points[CHEST], out[C_CHEST, 0])
    _along(torso, 0.0, -0.07, 0.0, points[CHEST], out[C_CHEST, 1])
    _along(torso, 0.01, 0.0, 0.06, points[NECK], out[C_HEAD, 0])
    out[C_HEAD, 1] = points[CROWN]
    for arm in range(2):
        shoulder = SHOULDER_R if arm == 0 else SHOULDER_L
        fore = frames[F_FOREARM_R if arm == 0 else F_FOREARM_L]
        out[C_UPPER_ARM_R + arm, 0] = points[shoulder]
        out[C_UPPER_ARM_R + arm, 1] = points[shoulder + 1]
        out[C_FOREARM_R + arm, 0] = points[shoulder + 1]
        out[C_FOREARM_R + arm, 1] = points[shoulder + 2]
        out[C_HAND_R + arm, 0] = points[shoulder + 2]
        _along(fore, 0.0, 0.0, -HAND_TIP, points[shoulder + 2], out[C_HAND_R + arm, 1])
        leg = out[C_LEG_R + arm]
        side = -HIP_WIDTH if arm == 0 else HIP_WIDTH
        _along(pelvis, 0.0, side, -0.05, points[PELVIS], leg[0])
        leg[1] = leg[0]
        leg[1, 2] = floor_z + RADII[C_LEG_R]
