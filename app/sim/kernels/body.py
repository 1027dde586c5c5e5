"""Forward kinematics and capsules of the 18-DoF human, compiled.

Tree: pelvis (x, y, yaw) - abdomen (flexion, side bend, twist) - clavicles (protraction,
elevation) - shoulders (flexion, abduction, rotation) - elbows. Body axes: x forward, y left,
z up. The abdomen turns by ``Ry(flex) Rx(side) Rz(twist)``; an upper arm hangs along -z and
turns by ``Ry(-flex) Rx(-+abduct) Rz(rotate)`` (right, left), the forearm by ``Ry(-elbow)``.
Joint order: ``app.sim.human.JOINT_NAMES``. Source: METHOD 3.4, thesis fig. 5.2.
"""

import math

import numpy as np

from app.sim.kernels.columns import new_columns, padded
from app.sim.kernels.compiled import kernel
from app.sim.kernels.trig import sines
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


@kernel(inline="always")
def _turn(ca: float, sa: float, cb: float, sb: float, cc: float, sc: float, out: Vec) -> None:
    """Write ``Ry(a) Rx(b) Rz(c)``, from cosines and sines, into ``out``, shape (3, 3)."""
    out[0, 0], out[0, 1], out[0, 2] = ca * cc + sa * sb * sc, sa * sb * cc - ca * sc, sa * cb
    out[1, 0], out[1, 1], out[1, 2] = cb * sc, cb * cc, -sb
    out[2, 0], out[2, 1], out[2, 2] = ca * sb * sc - sa * cc, sa * sc + ca * sb * cc, ca * cb


@kernel(inline="always")
def _times(a: Vec, b: Vec, out: Vec) -> None:
    """Write the product of two (3, 3) matrices into ``out``."""
    for i in range(3):
        for j in range(3):
            out[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@kernel(inline="always")
def _along(rot: Vec, x: float, y: float, z: float, origin: Vec, out: Vec) -> None:
    """Write ``origin + rot (x, y, z)`` into ``out``, shape (3,)."""
    for i in range(3):
        out[i] = origin[i] + rot[i, 0] * x + rot[i, 1] * y + rot[i, 2] * z


@kernel()
def points_and_frames(q: Vec, pelvis_z: float, trig: Vec, points: Vec, frames: Vec) -> None:
    """Write joint centres and body orientations.

    Args:
        q: Joint positions [m, rad], shape (18,).
        pelvis_z: Height of the pelvis [m].
        trig: Work space, shape (3, 16).
        points: Filled with the points named above [m], shape (N_POINTS, 3).
        frames: Filled with R_world_body, shape (N_FRAMES, 3, 3).
    """
    s, c = trig[0], trig[1]
    sines(q[2:18], s, c)
    pelvis, torso = frames[F_PELVIS], frames[F_TORSO]
    pelvis[0, 0], pelvis[0, 1], pelvis[0, 2] = c[0], -s[0], 0.0
    pelvis[1, 0], pelvis[1, 1], pelvis[1, 2] = s[0], c[0], 0.0
    pelvis[2, 0], pelvis[2, 1], pelvis[2, 2] = 0.0, 0.0, 1.0
    points[PELVIS, 0], points[PELVIS, 1], points[PELVIS, 2] = q[0], q[1], pelvis_z
    scratch = trig[2, :9].reshape((3, 3))
    _turn(c[1], s[1], c[2], s[2], c[3], s[3], scratch)
    _times(pelvis, scratch, torso)
    origin = points[PELVIS]
    _along(torso, 0.0, 0.0, 0.12, origin, points[WAIST])
    _along(torso, 0.0, 0.0, 0.30, origin, points[CHEST])
    _along(torso, 0.0, 0.0, NECK_HEIGHT, origin, points[NECK])
    _along(torso, 0.02, 0.0, NECK_HEIGHT + HEAD_HEIGHT, origin, points[HEAD])
    _along(torso, 0.02, 0.0, NECK_HEIGHT + HEAD_HEIGHT + 0.05, origin, points[CROWN])
    for arm in range(2):
        side = -1.0 if arm == 0 else 1.0
        clavicle, first = 4 + 2 * arm, 8 + 4 * arm
        shoulder = SHOULDER_R if arm == 0 else SHOULDER_L
        upper = frames[F_UPPER_ARM_R if arm == 0 else F_UPPER_ARM_L]
        fore = frames[F_FOREARM_R if arm == 0 else F_FOREARM_L]
        level = CLAVICLE * c[clavicle + 1]
        _along(
            torso,
            level * s[clavicle],
            side * level * c[clavicle],
            CLAVICLE * s[clavicle + 1],
            points[NECK],
            points[shoulder],
        )
        _turn(
            c[first],
            -s[first],
            c[first + 1],
            side * s[first + 1],
            c[first + 2],
            s[first + 2],
            scratch,
        )
        _times(torso, scratch, upper)
        _along(upper, 0.0, 0.0, -UPPER_ARM, points[shoulder], points[shoulder + 1])
        ce, se = c[first + 3], s[first + 3]
        for i in range(3):
            x, z = upper[i, 0], upper[i, 2]
            fore[i, 0], fore[i, 1], fore[i, 2] = ce * x + se * z, upper[i, 1], ce * z - se * x
        _along(fore, 0.0, 0.0, -FOREARM, points[shoulder + 1], points[shoulder + 2])
        _along(fore, 0.0, 0.0, -FOREARM - HAND, points[shoulder + 1], points[shoulder + 3])


@kernel(inline="always")
def _between(out: Vec, k: int, points: Vec, start: int, end: int) -> None:
    """Write the capsule from one point to another into column ``k``."""
    for i in range(3):
        out[i, k] = points[start, i]
        out[3 + i, k] = points[end, i] - points[start, i]


@kernel(inline="always")
def _across(out: Vec, k: int, origin: Vec, rot: Vec, half: float) -> None:
    """Write the capsule along a body's lateral axis, ``half`` to either side."""
    for i in range(3):
        out[i, k] = origin[i] + half * rot[i, 1]
        out[3 + i, k] = -2.0 * half * rot[i, 1]


@kernel()
def capsules(points: Vec, frames: Vec, floor_z: float, first: int, out: Vec) -> None:
    """Write the person's twelve capsules into columns ``first`` and on.

    Rows ``X`` to ``UZ`` are written; lengths and radii never change (:func:`capsule_columns`).

    Args:
        points: From :func:`points_and_frames` [m].
        frames: From :func:`points_and_frames`.
        floor_z: Height of the floor [m].
        first: Column of the first capsule.
        out: Capsules as columns, shape (9, n).
    """
    pelvis, torso, top = frames[F_PELVIS], frames[F_TORSO], points[PELVIS]
    _across(out, first + C_PELVIS, top, pelvis, 0.06)
    _across(out, first + C_CHEST, points[CHEST], torso, 0.07)
    for i in range(3):
        out[i, first + C_ABDOMEN] = top[i]
        out[3 + i, first + C_ABDOMEN] = 0.24 * torso[i, 2]
        start = points[NECK, i] + 0.01 * torso[i, 0] + 0.06 * torso[i, 2]
        out[i, first + C_HEAD] = start
        out[3 + i, first + C_HEAD] = points[CROWN, i] - start
    for arm in range(2):
        shoulder = SHOULDER_R if arm == 0 else SHOULDER_L
        fore = frames[F_FOREARM_R if arm == 0 else F_FOREARM_L]
        _between(out, first + C_UPPER_ARM_R + arm, points, shoulder, shoulder + 1)
        _between(out, first + C_FOREARM_R + arm, points, shoulder + 1, shoulder + 2)
        hand, leg = first + C_HAND_R + arm, first + C_LEG_R + arm
        side = -HIP_WIDTH if arm == 0 else HIP_WIDTH
        for i in range(3):
            out[i, hand] = points[shoulder + 2, i]
            out[3 + i, hand] = -HAND_TIP * fore[i, 2]
            out[i, leg] = top[i] + side * pelvis[i, 1]
            out[3 + i, leg] = 0.0
        out[2, leg] = top[2] - 0.05
        out[5, leg] = floor_z + RADII[C_LEG_R] - out[2, leg]


def capsule_columns(n_people: int, pelvis_z: float, floor_z: float) -> Vec:
    """Return the capsules of people as columns: radii and lengths set, places not yet.

    Args:
        n_people: Number of people; each has twelve columns, then come columns nowhere.
        pelvis_z: Height of the pelvis [m].
        floor_z: Height of the floor [m].
    """
    leg = pelvis_z - 0.05 - floor_z - RADII[C_LEG_R]
    head = math.hypot(0.01, HEAD_HEIGHT - 0.01)
    length = np.array(
        [0.12, 0.24, 0.14, head, *2 * [UPPER_ARM], *2 * [FOREARM], *2 * [HAND_TIP], leg, leg]
    )
    n = padded(n_people * N_CAPSULES)
    return new_columns(n, np.tile(RADII, n_people), np.tile(length**2, n_people))
