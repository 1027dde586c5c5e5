"""Forward and inverse kinematics of robots of the UR family, compiled.

A UR is a planar three-joint arm on a pan joint: in the URDF's frames ``R_1 = Rz(q0)``, then
three turns about the common lateral axis, ``Ry(q1 + pi/2)``, ``Ry(q2)``, ``Ry(q3 + pi/2)``,
then ``Rz(q4)`` and ``Ry(q5)``. Lengths are read from the robot's Pinocchio model
(``Robot.lengths``); tests compare this file with Pinocchio to 1e-9 m.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAST, kernel
from app.sim.core.kernels.trig import sincos
from app.sim.robot.kernels.joints import JointLimits


class LinkLengths(NamedTuple):
    """Lengths of a robot of the UR family [m]; Denavit-Hartenberg parameters in brackets."""

    base_height: float
    """Height of the shoulder's lift axis above the base (d1)."""
    shoulder_offset: float
    """Lateral offset of the upper arm."""
    elbow_offset: float
    """Lateral offset of the forearm, relative to the upper arm."""
    upper_arm: float
    """Length of the upper arm (-a2)."""
    forearm: float
    """Length of the forearm (-a3)."""
    wrist_1_offset: float
    """Lateral offset of wrist 2; with shoulder and elbow offset d4."""
    wrist_2_length: float
    """Distance from wrist 2 to wrist 3 (d5)."""
    flange: float
    """Distance from wrist 3 to the flange (d6)."""
    tool: float
    """Distance from the flange to the tcp."""


@kernel(error_model="numpy", fastmath=FAST)
def link_poses(lengths: LinkLengths, q: Vec, rot: Vec, pos: Vec) -> None:
    """Write the poses of base and six links.

    Args:
        lengths: Lengths of the robot.
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
    pos[1, 0], pos[1, 1], pos[1, 2] = 0.0, 0.0, lengths.base_height
    pitch = q[1] + 0.5 * math.pi
    _pan_then_pitch(c0, s0, pitch, rot[2])
    _along(rot[1], 0.0, lengths.shoulder_offset, 0.0, pos[1], pos[2])
    pitch += q[2]
    _pan_then_pitch(c0, s0, pitch, rot[3])
    _along(rot[2], 0.0, lengths.elbow_offset, lengths.upper_arm, pos[2], pos[3])
    pitch += q[3] + 0.5 * math.pi
    _pan_then_pitch(c0, s0, pitch, rot[4])
    _along(rot[3], 0.0, 0.0, lengths.forearm, pos[3], pos[4])
    s4, c4 = sincos(q[4])
    for i in range(3):
        x, y = rot[4, i, 0], rot[4, i, 1]
        rot[5, i, 0], rot[5, i, 1], rot[5, i, 2] = (
            c4 * x + s4 * y,
            c4 * y - s4 * x,
            rot[4, i, 2],
        )
    _along(rot[4], 0.0, lengths.wrist_1_offset, 0.0, pos[4], pos[5])
    s5, c5 = sincos(q[5])
    for i in range(3):
        x, z = rot[5, i, 0], rot[5, i, 2]
        rot[6, i, 0], rot[6, i, 1], rot[6, i, 2] = (
            c5 * x - s5 * z,
            rot[5, i, 1],
            s5 * x + c5 * z,
        )
    _along(rot[5], 0.0, 0.0, lengths.wrist_2_length, pos[5], pos[6])


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
def tcp_point(lengths: LinkLengths, rot: Vec, pos: Vec, out: Vec) -> None:
    """Write the tcp [m] of poses from :func:`link_poses` into ``out``, shape (3,)."""
    _along(rot[6], 0.0, lengths.flange + lengths.tool, 0.0, pos[6], out)


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
def ik_vertical(lengths: LinkLengths, limits: JointLimits, target: Vec, out: Vec) -> bool:
    """Find the configuration with the tool pointing down at ``target``, wrist 3 at 0.

    With the tool axis down, ``cos(q4) = 0`` and the pitch sum ``q1 + q2 + q3 + pi`` is a right
    angle; the remaining planar two-link arm has a closed form. Of the mirror solutions the one
    with the arm in front, elbow up and ``q4 = -pi/2`` is returned.

    Args:
        lengths: Lengths of the robot.
        target: Position of the tcp [m], shape (3,).
        out: Filled with the configuration [rad], shape (6,); the nearest one where none exists.

    Returns:
        Whether the configuration reaches the target inside the limits.
    """
    upper, fore = lengths.upper_arm, lengths.forearm
    lateral = lengths.shoulder_offset + lengths.elbow_offset + lengths.wrist_1_offset
    q_min, q_max = limits.q_min, limits.q_max
    planar2 = target[0] ** 2 + target[1] ** 2 - lateral**2
    reached = planar2 > 0.0
    radial = math.sqrt(max(planar2, 1e-12))
    out[0] = math.atan2(target[1], target[0]) - math.atan2(lateral, radial)
    out[0] = (out[0] + math.pi) % (2.0 * math.pi) - math.pi
    x = radial - lengths.wrist_2_length
    z = target[2] + lengths.flange + lengths.tool - lengths.base_height
    reach2 = x * x + z * z
    cosine = (reach2 - upper**2 - fore**2) / (2.0 * upper * fore)
    if cosine > 1.0 or cosine < -1.0:
        reached = False
        cosine = min(1.0, max(-1.0, cosine))
    out[2] = math.acos(cosine)
    out[1] = -math.atan2(z, x) - math.atan2(fore * math.sin(out[2]), upper + fore * cosine)
    out[3] = -0.5 * math.pi - out[1] - out[2]
    out[4] = -0.5 * math.pi
    out[5] = 0.0
    for j in range(6):
        if out[j] < q_min[j] and out[j] + 2.0 * math.pi <= q_max[j]:
            out[j] += 2.0 * math.pi
        elif out[j] > q_max[j] and out[j] - 2.0 * math.pi >= q_min[j]:
            out[j] -= 2.0 * math.pi
        if out[j] < q_min[j] or out[j] > q_max[j]:
            reached = False
            out[j] = min(q_max[j], max(q_min[j], out[j]))
    return bool(reached)


@njit(cache=True)
def ik_vertical_batch(
    lengths: LinkLengths, limits: JointLimits, targets: Vec
) -> tuple[Vec, NDArray[np.bool_]]:
    """Apply :func:`ik_vertical` to targets of shape (n, 3).

    Returns:
        Configurations [rad], shape (n, 6), and whether each reaches its target, shape (n,).
    """
    n = targets.shape[0]
    found = np.empty((n, 6))
    reached = np.empty(n, dtype=np.bool_)
    for i in range(n):
        reached[i] = ik_vertical(lengths, limits, targets[i], found[i])
    return found, reached
