"""Clearances of several configurations, each to its own cylinder, as vector lanes (compiled).

Number ``m`` of each row of a flat array belongs to configuration ``m``, so that the innermost
loops run over configurations and compile to vector instructions. Rows have a constant length,
from which the compiler knows that they do not overlap. The formulas are those of
``kinematics.link_poses``, ``arm.place_capsules`` and ``cylinder_clearance``.
"""

import math

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR, FAST, kernel
from app.sim.core.kernels.trig import sincos
from app.sim.geometry.capsules import RADIUS
from app.sim.geometry.cylinder import UPRIGHT, cylinder_clearance
from app.sim.robot.kernels.arm import Arm, RobotPose, place_robot
from app.sim.robot.kernels.kinematics import LinkLengths

N_LANES = 32
"""Length of a row: the most configurations of one call."""
JOINTS = 0
"""Place of the first joint position [rad]; the others follow, a row each."""
AXIS_X, AXIS_Y, AXIS_R = 6 * N_LANES, 7 * N_LANES, 8 * N_LANES
"""Places of axis and radius of the cylinders [m]."""
CLEARANCE = 9 * N_LANES
"""Place of the least clearances to the cylinders measured so far [m]."""
_NOW, _HIGHEST = 10 * N_LANES, 11 * N_LANES
"""Places of the clearances to the present cylinders in the plane, and of the highest of the
points nearest to their axes [m]."""
_FRAMES, _FRAME = 12 * N_LANES, 12 * N_LANES
"""Place of the links' frames, and length of one: origin and the three axes, three rows each."""
_N_LINKS = 7


def new_lanes() -> Vec:
    """Return rows without configurations, shape (n_rows * N_LANES,)."""
    lanes = np.zeros(_FRAMES + _N_LINKS * _FRAME)
    base = lanes[_FRAMES : _FRAMES + _FRAME].reshape(4, 3, N_LANES)
    base[1:] = np.eye(3)[..., None]
    return lanes


@kernel(inline="always")
def _put(x: float, y: float, z: float, place: int, lanes: Vec) -> None:
    """Write a vector of one configuration."""
    lanes[place], lanes[place + N_LANES], lanes[place + 2 * N_LANES] = x, y, z


@kernel(error_model="numpy", fastmath=FAST)
def place_lanes(lengths: LinkLengths, n: int, lanes: Vec) -> None:
    """Place the first ``n`` configurations, whose clearances become FAR; n <= N_LANES."""
    first = _FRAMES + _FRAME
    for m in range(n):
        lanes[CLEARANCE + m] = FAR
        sin, cos = sincos(lanes[JOINTS + m])
        z = lengths.base_height
        _put(0.0, 0.0, z, first + m, lanes)
        _put(cos, sin, 0.0, first + 3 * N_LANES + m, lanes)
        _put(-sin, cos, 0.0, first + 6 * N_LANES + m, lanes)
        _put(0.0, 0.0, 1.0, first + 9 * N_LANES + m, lanes)
        pitch = lanes[JOINTS + N_LANES + m] + 0.5 * math.pi
        s, c = sincos(pitch)
        x, y = -sin * lengths.shoulder_offset, cos * lengths.shoulder_offset
        _put(x, y, z, first + _FRAME + m, lanes)
        _put(cos * c, sin * c, -s, first + _FRAME + 3 * N_LANES + m, lanes)
        _put(-sin, cos, 0.0, first + _FRAME + 6 * N_LANES + m, lanes)
        _put(cos * s, sin * s, c, first + _FRAME + 9 * N_LANES + m, lanes)
        offset, upper = lengths.elbow_offset, lengths.upper_arm
        x = x - sin * offset + (cos * s) * upper
        y = y + cos * offset + (sin * s) * upper
        z = z + c * upper
        pitch += lanes[JOINTS + 2 * N_LANES + m]
        s, c = sincos(pitch)
        _put(x, y, z, first + 2 * _FRAME + m, lanes)
        _put(cos * c, sin * c, -s, first + 2 * _FRAME + 3 * N_LANES + m, lanes)
        _put(-sin, cos, 0.0, first + 2 * _FRAME + 6 * N_LANES + m, lanes)
        _put(cos * s, sin * s, c, first + 2 * _FRAME + 9 * N_LANES + m, lanes)
        fore = lengths.forearm
        x, y, z = x + (cos * s) * fore, y + (sin * s) * fore, z + c * fore
        pitch += lanes[JOINTS + 3 * N_LANES + m] + 0.5 * math.pi
        s, c = sincos(pitch)
        ax, ay, az, cx, cy = cos * c, sin * c, -s, cos * s, sin * s
        _put(x, y, z, first + 3 * _FRAME + m, lanes)
        _put(ax, ay, az, first + 3 * _FRAME + 3 * N_LANES + m, lanes)
        _put(-sin, cos, 0.0, first + 3 * _FRAME + 6 * N_LANES + m, lanes)
        _put(cx, cy, c, first + 3 * _FRAME + 9 * N_LANES + m, lanes)
        offset = lengths.wrist_1_offset
        x, y = x - sin * offset, y + cos * offset
        s4, c4 = sincos(lanes[JOINTS + 4 * N_LANES + m])
        dx, dy, dz = c4 * ax - s4 * sin, c4 * ay + s4 * cos, c4 * az
        bx, by, bz = -c4 * sin - s4 * ax, c4 * cos - s4 * ay, -s4 * az
        _put(x, y, z, first + 4 * _FRAME + m, lanes)
        _put(dx, dy, dz, first + 4 * _FRAME + 3 * N_LANES + m, lanes)
        _put(bx, by, bz, first + 4 * _FRAME + 6 * N_LANES + m, lanes)
        _put(cx, cy, c, first + 4 * _FRAME + 9 * N_LANES + m, lanes)
        wrist = lengths.wrist_2_length
        x, y, z = x + cx * wrist, y + cy * wrist, z + c * wrist
        s5, c5 = sincos(lanes[JOINTS + 5 * N_LANES + m])
        ax, ay, az = c5 * dx - s5 * cx, c5 * dy - s5 * cy, c5 * dz - s5 * c
        cx, cy, cz = s5 * dx + c5 * cx, s5 * dy + c5 * cy, s5 * dz + c5 * c
        _put(x, y, z, first + 5 * _FRAME + m, lanes)
        _put(ax, ay, az, first + 5 * _FRAME + 3 * N_LANES + m, lanes)
        _put(bx, by, bz, first + 5 * _FRAME + 6 * N_LANES + m, lanes)
        _put(cx, cy, cz, first + 5 * _FRAME + 9 * N_LANES + m, lanes)


@kernel(error_model="numpy", fastmath=FAST)
def _approach_capsule(arm: Arm, k: int, frame: Vec, n: int, lanes: Vec) -> None:
    """Lower the clearances in the plane to those of capsule ``k``, raise the highest points.

    Args:
        k: The capsule.
        frame: Frames of its link, shape (_FRAME,).
        n: Number of configurations.
        lanes: The configurations.
    """
    px, py, pz = arm.p0[k, 0], arm.p0[k, 1], arm.p0[k, 2]
    sx, sy, sz, radius = arm.span[k, 0], arm.span[k, 1], arm.span[k, 2], arm.capsules[RADIUS, k]
    for m in range(n):
        ax, ay, az = frame[3 * N_LANES + m], frame[4 * N_LANES + m], frame[5 * N_LANES + m]
        bx, by, bz = frame[6 * N_LANES + m], frame[7 * N_LANES + m], frame[8 * N_LANES + m]
        cx, cy, cz = frame[9 * N_LANES + m], frame[10 * N_LANES + m], frame[11 * N_LANES + m]
        x = frame[m] + ax * px + bx * py + cx * pz
        y = frame[N_LANES + m] + ay * px + by * py + cy * pz
        z = frame[2 * N_LANES + m] + az * px + bz * py + cz * pz
        ux = ax * sx + bx * sy + cx * sz
        uy = ay * sx + by * sy + cy * sz
        uz = az * sx + bz * sy + cz * sz
        wx, wy = x - lanes[AXIS_X + m], y - lanes[AXIS_Y + m]
        uu, wu = ux * ux + uy * uy, wx * ux + wy * uy
        lower = 1.0 if uz < 0.0 else 0.0
        s = -wu / uu
        s = s if uu > UPRIGHT else lower
        s = s if s > 0.0 else 0.0
        s = s if s < 1.0 else 1.0
        dx, dy, height = wx + s * ux, wy + s * uy, z + s * uz
        d = math.sqrt(dx * dx + dy * dy) - (lanes[AXIS_R + m] + radius)
        lanes[_NOW + m] = d if d < lanes[_NOW + m] else lanes[_NOW + m]
        lanes[_HIGHEST + m] = height if height > lanes[_HIGHEST + m] else lanes[_HIGHEST + m]


@kernel()
def measure_lanes(
    arm: Arm, top: float, n: int, within: float, q: Vec, pose: RobotPose, lanes: Vec
) -> None:
    """Lower the clearances of the first ``n`` configurations to those to their cylinders.

    Where a point nearest to the axis is above the cylinder, the configuration is placed alone.

    Args:
        top: Height of the tops of the cylinders [m].
        n: Number of configurations.
        within: Distance that counts as far away [m]; clearances above it may be too small, but
            stay above it.
        q: Work space, shape (6,).
        pose: Work space.
        lanes: The configurations, placed by :func:`place_lanes`, and the cylinders.
    """
    for m in range(n):
        lanes[_NOW + m], lanes[_HIGHEST + m] = FAR, -FAR
    for k in range(arm.link.shape[0]):
        first = _FRAMES + arm.link[k] * _FRAME
        _approach_capsule(arm, k, lanes[first : first + _FRAME], n, lanes)
    for m in range(n):
        d = lanes[_NOW + m]
        if lanes[_HIGHEST + m] > top and d < within:
            for j in range(6):
                q[j] = lanes[JOINTS + j * N_LANES + m]
            place_robot(arm, q, pose)
            x, y, r = lanes[AXIS_X + m], lanes[AXIS_Y + m], lanes[AXIS_R + m]
            d, _ = cylinder_clearance(pose.capsules, 0, x, y, r, top)
        lanes[CLEARANCE + m] = min(lanes[CLEARANCE + m], d)
