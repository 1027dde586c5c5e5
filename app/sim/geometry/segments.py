"""Nearest points of two segments, compiled; one pair at a time, for directions and names.

Source: Ericson, *Real-Time Collision Detection* (2005), section 5.1.9. Distances of sets of
capsules are in ``capsules.py``.
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAST, kernel

Point = tuple[float, float, float]


@kernel(error_model="numpy", fastmath=FAST)
def segment_parameters(u: Point, v: Point, w: Point) -> tuple[float, float]:
    """Return the nearest points of two segments, as fractions of their lengths.

    Args:
        u: End of the first segment less its start [m].
        v: End of the second segment less its start [m].
        w: Start of the first less start of the second [m].
    """
    ux, uy, uz = u
    vx, vy, vz = v
    wx, wy, wz = w
    a = ux * ux + uy * uy + uz * uz
    e = vx * vx + vy * vy + vz * vz
    f = vx * wx + vy * wy + vz * wz
    c = ux * wx + uy * wy + uz * wz
    if a <= 1e-12:
        return 0.0, min(1.0, max(0.0, f / e)) if e > 1e-12 else 0.0
    if e <= 1e-12:
        return min(1.0, max(0.0, -c / a)), 0.0
    b = ux * vx + uy * vy + uz * vz
    denominator = a * e - b * b
    s = 0.0
    if denominator > 1e-12 * a * e:
        s = min(1.0, max(0.0, (b * f - c * e) / denominator))
    t = (b * s + f) / e
    if t < 0.0:
        return min(1.0, max(0.0, -c / a)), 0.0
    if t > 1.0:
        return min(1.0, max(0.0, (b - c) / a)), 1.0
    return s, t


@kernel(error_model="numpy", fastmath=FAST)
def segment_nearest(a: Vec, i: int, b: Vec, j: int, out: Vec) -> float:
    """Write the vector between the nearest points of two segments; return its length [m].

    Args:
        a: Capsules as columns, shape (9, n).
        i: The first segment is this column of ``a``.
        b: Capsules as columns, shape (9, m).
        j: The second segment is this column of ``b``.
        out: Filled with the vector from the first to the second [m], shape (3,).
    """
    ux, uy, uz = a[3, i], a[4, i], a[5, i]
    vx, vy, vz = b[3, j], b[4, j], b[5, j]
    wx, wy, wz = a[0, i] - b[0, j], a[1, i] - b[1, j], a[2, i] - b[2, j]
    s, t = segment_parameters((ux, uy, uz), (vx, vy, vz), (wx, wy, wz))
    out[0] = t * vx - wx - s * ux
    out[1] = t * vy - wy - s * uy
    out[2] = t * vz - wz - s * uz
    return math.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])
