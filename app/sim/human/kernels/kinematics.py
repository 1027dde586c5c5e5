"""Forward kinematics and capsules of the 18-DoF human of any size, compiled.

Tree: pelvis (x, y, yaw) - abdomen (flexion, side bend, twist) - clavicles (protraction,
elevation) - shoulders (flexion, abduction, rotation) - elbows. Body axes: x forward, y left,
z up. The abdomen turns by ``Ry(flex) Rx(side) Rz(twist)``; an upper arm hangs along -z and
turns by ``Ry(-flex) Rx(-+abduct) Rz(rotate)`` (right, left), the forearm by ``Ry(-elbow)``.
Joint order: ``app.sim.human.model.JOINT_NAMES``. Source: docs/method.md 3.4, thesis fig. 5.2.
"""

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels.trig import sines
from app.sim.geometry.capsules import INVERSE, RADIUS, UU, new_capsules, padded_size

N_SIZE = 12
(
    PELVIS_Z,
    TRUNK,
    CLAVICLE_R,
    CLAVICLE_L,
    UPPER_ARM_R,
    UPPER_ARM_L,
    FOREARM_R,
    FOREARM_L,
    HAND,
    HEAD_UP,
    HIP,
    GIRTH,
) = range(N_SIZE)
"""Entries of a person's *size* [m]: height of the pelvis in the cell's frame; pelvis to the
base of the neck, along the torso; base of the neck to shoulder; shoulder to elbow; elbow to
wrist; wrist to the middle of the palm, which "hand" means; base of the neck to the centre of
the head; half the distance of the hips; and the body's thickness, 1 for the median person."""

MEDIAN_TRUNK = 0.44
MEDIAN_HAND = 0.09
MEDIAN_HEAD = 0.17
HAND_TIP = 0.15
"""Wrist to the end of the median hand's capsule [m], without its rounding."""
HIP_DROP = 0.05
"""Height of the pelvis above the upper ends of the legs [m]."""

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
"""Radii of the median person's capsules [m]."""


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
def points_and_frames(q: Vec, size: Vec, trig: Vec, points: Vec, frames: Vec) -> None:
    """Write joint centres and body orientations.

    Args:
        q: Joint positions [m, rad], shape (18,).
        size: The person's size [m], shape (N_SIZE,).
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
    points[PELVIS, 0], points[PELVIS, 1], points[PELVIS, 2] = q[0], q[1], size[PELVIS_Z]
    scratch = trig[2, :9].reshape((3, 3))
    _turn(c[1], s[1], c[2], s[2], c[3], s[3], scratch)
    _times(pelvis, scratch, torso)
    origin = points[PELVIS]
    trunk, head = size[TRUNK], size[TRUNK] + size[HEAD_UP]
    _along(torso, 0.0, 0.0, trunk * (0.12 / MEDIAN_TRUNK), origin, points[WAIST])
    _along(torso, 0.0, 0.0, trunk * (0.30 / MEDIAN_TRUNK), origin, points[CHEST])
    _along(torso, 0.0, 0.0, trunk, origin, points[NECK])
    _along(torso, 0.02, 0.0, head, origin, points[HEAD])
    crown = trunk + size[HEAD_UP] * (0.22 / MEDIAN_HEAD)
    _along(torso, 0.02, 0.0, crown, origin, points[CROWN])
    for arm in range(2):
        side = -1.0 if arm == 0 else 1.0
        clavicle, first = 4 + 2 * arm, 8 + 4 * arm
        shoulder = SHOULDER_R if arm == 0 else SHOULDER_L
        upper = frames[F_UPPER_ARM_R if arm == 0 else F_UPPER_ARM_L]
        fore = frames[F_FOREARM_R if arm == 0 else F_FOREARM_L]
        bar, upper_arm, forearm = (
            size[CLAVICLE_R + arm],
            size[UPPER_ARM_R + arm],
            size[FOREARM_R + arm],
        )
        level = bar * c[clavicle + 1]
        _along(
            torso,
            level * s[clavicle],
            side * level * c[clavicle],
            bar * s[clavicle + 1],
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
        _along(upper, 0.0, 0.0, -upper_arm, points[shoulder], points[shoulder + 1])
        ce, se = c[first + 3], s[first + 3]
        for i in range(3):
            x, z = upper[i, 0], upper[i, 2]
            fore[i, 0], fore[i, 1], fore[i, 2] = ce * x + se * z, upper[i, 1], ce * z - se * x
        _along(fore, 0.0, 0.0, -forearm, points[shoulder + 1], points[shoulder + 2])
        _along(
            fore, 0.0, 0.0, -forearm - size[HAND], points[shoulder + 1], points[shoulder + 3]
        )


@kernel(inline="always")
def _between(out: Vec, k: int, points: Vec, start: int, end: int) -> None:
    """Write the capsule between two points to column ``k``."""
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
def capsules(points: Vec, frames: Vec, size: Vec, floor_z: float, first: int, out: Vec) -> None:
    """Write the person's twelve capsules into columns ``first`` and on.

    Args:
        points: From :func:`points_and_frames` [m].
        frames: From :func:`points_and_frames`.
        size: The person's size [m], shape (N_SIZE,).
        floor_z: Height of the floor [m].
        first: Column of the first capsule.
        out: Capsules as columns, shape (9, n).
    """
    pelvis, torso, top = frames[F_PELVIS], frames[F_TORSO], points[PELVIS]
    girth, hip = size[GIRTH], size[HIP]
    _across(out, first + C_PELVIS, top, pelvis, 0.06 * girth)
    _across(out, first + C_CHEST, points[CHEST], torso, 0.07 * girth)
    abdomen, neck = size[TRUNK] * (0.24 / MEDIAN_TRUNK), size[HEAD_UP] * (0.06 / MEDIAN_HEAD)
    tip = size[HAND] * (HAND_TIP / MEDIAN_HAND)
    for i in range(3):
        out[i, first + C_ABDOMEN] = top[i]
        out[3 + i, first + C_ABDOMEN] = abdomen * torso[i, 2]
        start = points[NECK, i] + 0.01 * torso[i, 0] + neck * torso[i, 2]
        out[i, first + C_HEAD] = start
        out[3 + i, first + C_HEAD] = points[CROWN, i] - start
    for arm in range(2):
        shoulder = SHOULDER_R if arm == 0 else SHOULDER_L
        fore = frames[F_FOREARM_R if arm == 0 else F_FOREARM_L]
        _between(out, first + C_UPPER_ARM_R + arm, points, shoulder, shoulder + 1)
        _between(out, first + C_FOREARM_R + arm, points, shoulder + 1, shoulder + 2)
        hand, leg = first + C_HAND_R + arm, first + C_LEG_R + arm
        side = -hip if arm == 0 else hip
        for i in range(3):
            out[i, hand] = points[shoulder + 2, i]
            out[3 + i, hand] = -tip * fore[i, 2]
            out[i, leg] = top[i] + side * pelvis[i, 1]
            out[3 + i, leg] = 0.0
        out[2, leg] = top[2] - HIP_DROP
        out[5, leg] = floor_z + girth * RADII[C_LEG_R] - out[2, leg]
    for part in range(N_CAPSULES):
        k = first + part
        x, y, z = out[3, k], out[4, k], out[5, k]
        out[UU, k] = x * x + y * y + z * z
        out[RADIUS, k] = girth * RADII[part]
        out[INVERSE, k] = 1.0 / max(out[UU, k], 1e-12)


def new_body_capsules(n_people: int) -> Vec:
    """Return the capsules of people as columns, all nowhere until they are placed.

    Args:
        n_people: Number of people; each has twelve columns, then come columns nowhere.
    """
    n = padded_size(n_people * N_CAPSULES)
    return new_capsules(n, np.tile(RADII, n_people))
