"""Forward and inverse kinematics of the UR10, compiled.

The UR10 is a planar three-joint arm on a pan joint: in the URDF's frames
``R_1 = Rz(q0)``, then three turns about the common lateral axis, ``Ry(q1 + pi/2)``, ``Ry(q2)``,
``Ry(q3 + pi/2)``, then ``Rz(q4)`` and ``Ry(q5)``. Lengths are those of example-robot-data's
``ur10_robot.urdf``; tests hold this file against Pinocchio to 1e-9 m.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels.trig import sincos
from app.sim.geometry.segments import FAST

BASE_HEIGHT = 0.1273
"""Height of the shoulder's lift axis above the base [m]."""
SHOULDER_OFFSET = 0.220941
"""Lateral offset of the upper arm [m]."""
ELBOW_OFFSET = -0.1719
"""Lateral offset of the forearm, relative to the upper arm [m]."""
UPPER_ARM = 0.612
"""Length of the upper arm [m]."""
FOREARM = 0.5723
"""Length of the forearm [m]."""
WRIST_1_OFFSET = 0.1149
"""Lateral offset of wrist 2 [m]."""
WRIST_2_LENGTH = 0.1157
"""Distance from wrist 2 to wrist 3 [m]."""
FLANGE = 0.0922
"""Distance from wrist 3 to the flange [m]."""
LATERAL = SHOULDER_OFFSET + ELBOW_OFFSET + WRIST_1_OFFSET
"""Distance of the tool's plane from the pan axis [m]."""


@kernel(error_model="numpy", fastmath=FAST)
def link_poses(q: Vec, rot: Vec, pos: Vec) -> None:
    """Write the poses of base and six links.

    Args:
        q: Joint positions [rad], shape (6,).
        rot: Filled with R_world_link, shape (7, 3, 3).
        pos: Filled with the origins [m], shape (7, 3).
    """
    s0, c0 = sincos(q[0])
    rot[0] = 0.0
    pos[0] = 0.0
    for i in range(3):
        rot[0, i, i] = 1.0
    _pan_then_pitch(c0, s0, 0.0, rot[1])
    pos[1, 0], pos[1, 1], pos[1, 2] = 0.0, 0.0, BASE_HEIGHT
    pitch = q[1] + 0.5 * math.pi
    _pan_then_pitch(c0, s0, pitch, rot[2])
    _along(rot[1], 0.0, SHOULDER_OFFSET, 0.0, pos[1], pos[2])
    pitch += q[2]
    _pan_then_pitch(c0, s0, pitch, rot[3])
    _along(rot[2], 0.0, ELBOW_OFFSET, UPPER_ARM, pos[2], pos[3])
    pitch += q[3] + 0.5 * math.pi
    _pan_then_pitch(c0, s0, pitch, rot[4])
    _along(rot[3], 0.0, 0.0, FOREARM, pos[3], pos[4])
    s4, c4 = sincos(q[4])
    for i in range(3):
        x, y = rot[4, i, 0], rot[4, i, 1]
        rot[5, i, 0], rot[5, i, 1], rot[5, i, 2] = (
            c4 * x + s4 * y,
            c4 * y - s4 * x,
            rot[4, i, 2],
        )
    _along(rot[4], 0.0, WRIST_1_OFFSET, 0.0, pos[4], pos[5])
    s5, c5 = sincos(q[5])
    for i in range(3):
        x, z = rot[5, i, 0], rot[5, i, 2]
        rot[6, i, 0], rot[6, i, 1], rot[6, i, 2] = (
            c5 * x - s5 * z,
            rot[5, i, 1],
            s5 * x + c5 * z,
        )
    _along(rot[5], 0.0, 0.0, WRIST_2_LENGTH, pos[5], pos[6])


@kernel(inline="always")
def _pan_then_pitch(c0: float, s0: float, pitch: float, out: Vec) -> None:
    """Write ``Rz(pan) Ry(pitch)`` into ``out``, shape (3, 3)."""
    s, c = sincos(pitch)
    out[0, 0], out[0, 1], out[0, 2] = c0 * c, -s0, c0 * s
    out[1, 0], out[1, 1], out[1, 2] = s0 * c, c0, s0 * s
    out[2, 0], out[2, 1], out[2, 2] = -s, 0.0, c


@kernel(inline="always")
def _along(rot: Vec, x: float, y: float, z: float, origin: Vec, out: Vec) -> None:
    """Write ``origin + rot (x, y, z)`` into ``out``, shape (3,)."""
    for i in range(3):
        out[i] = origin[i] + rot[i, 0] * x + rot[i, 1] * y + rot[i, 2] * z


@kernel()
def tcp_point(rot: Vec, pos: Vec, tool_length: float, out: Vec) -> None:
    """Write the tcp [m] of poses from :func:`link_poses` into ``out``, shape (3,)."""
    _along(rot[6], 0.0, FLANGE + tool_length, 0.0, pos[6], out)


@kernel()
def tcp_jacobian(rot: Vec, pos: Vec, tcp: Vec, out: Vec) -> None:
    """Write the tcp's linear Jacobian [m/rad] into ``out``, shape (3, 6)."""
    for j in range(6):
        link = j + 1
        column = 2 if j == 0 or j == 4 else 1
        ax, ay, az = rot[link, 0, column], rot[link, 1, column], rot[link, 2, column]
        dx = tcp[0] - pos[link, 0]
        dy = tcp[1] - pos[link, 1]
        dz = tcp[2] - pos[link, 2]
        out[0, j] = ay * dz - az * dy
        out[1, j] = az * dx - ax * dz
        out[2, j] = ax * dy - ay * dx


@kernel()
def ik_vertical(target: Vec, tool_length: float, q_min: Vec, q_max: Vec, out: Vec) -> bool:
    """Find the posture with the tool pointing down at ``target``, wrist 3 at 0.

    With the tool axis down, ``cos(q4) = 0`` and the pitch sum ``q1 + q2 + q3 + pi`` is a right
    angle, so what is left is a planar two-link arm in closed form. Of the mirror postures the
    one with the arm in front, elbow up and ``q4 = -pi/2`` is taken, as a UR over a table works.

    Args:
        target: Where the tcp shall be [m], shape (3,).
        tool_length: From flange to tcp [m].
        q_min: Lower joint limits [rad], shape (6,).
        q_max: Upper joint limits [rad], shape (6,).
        out: Filled with the posture [rad], shape (6,); the nearest one where none exists.

    Returns:
        Whether the posture reaches the target inside the limits.
    """
    planar2 = target[0] ** 2 + target[1] ** 2 - LATERAL**2
    reached = planar2 > 0.0
    radial = math.sqrt(max(planar2, 1e-12))
    out[0] = math.atan2(target[1], target[0]) - math.atan2(LATERAL, radial)
    out[0] = (out[0] + math.pi) % (2.0 * math.pi) - math.pi
    x = radial - WRIST_2_LENGTH
    z = target[2] + FLANGE + tool_length - BASE_HEIGHT
    reach2 = x * x + z * z
    cosine = (reach2 - UPPER_ARM**2 - FOREARM**2) / (2.0 * UPPER_ARM * FOREARM)
    if cosine > 1.0 or cosine < -1.0:
        reached = False
        cosine = min(1.0, max(-1.0, cosine))
    out[2] = math.acos(cosine)
    out[1] = -math.atan2(z, x) - math.atan2(
        FOREARM * math.sin(out[2]), UPPER_ARM + FOREARM * cosine
    )
    out[3] = -0.5 * math.pi - out[1] - out[2]
    out[4] = -0.5 * math.pi
    out[5] = 0.0
    for j in range(6):
        if out[j] < q_min[j] or out[j] > q_max[j]:
            reached = False
            out[j] = min(q_max[j], max(q_min[j], out[j]))
    return bool(reached)


@njit(cache=True)
def ik_vertical_batch(
    targets: Vec, tool_length: float, q_min: Vec, q_max: Vec
) -> tuple[Vec, NDArray[np.bool_]]:
    """Apply :func:`ik_vertical` to targets of shape (n, 3).

    Returns:
        Postures [rad], shape (n, 6), and whether each reaches its target, shape (n,).
    """
    n = targets.shape[0]
    postures = np.empty((n, 6))
    reached = np.empty(n, dtype=np.bool_)
    for i in range(n):
        reached[i] = ik_vertical(targets[i], tool_length, q_min, q_max, postures[i])
    return postures, reached
