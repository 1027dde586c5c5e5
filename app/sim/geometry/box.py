"""Exact distances of capsules to boxes that are turned about the vertical, compiled.

In the box's own frame the squared distance of the point at fraction ``s`` of a segment is
``sum_i max(0, |p_i(s)| - half_i)^2``: convex, and quadratic between the places, six at most,
where a coordinate passes a face. Its slope is therefore continuous, never falls and is linear
between those places, so the least distance follows from the two places around the slope's zero,
without iteration. Tests hold this file against python-fcl.
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.capsules import RADIUS, UX, UY, UZ, X, Y, Z
from app.sim.geometry.segments import FAR, FAST


@kernel(error_model="numpy", fastmath=FAST)
def box_clearance(robot: Vec, first: int, boxes: Vec) -> tuple[float, int, int]:
    """Return the least distance of capsules to boxes [m], the nearest capsule and its box.

    Exact where they are apart; at most zero exactly where they touch, and then the radius of
    the segment that is inside, negative: not how deep.

    Args:
        robot: Capsules as columns, shape (>= 8, n).
        first: First column to look at.
        boxes: Centre x, y, z, half sizes [m] and yaw [rad], shape (n_boxes, 7).

    Returns:
        Distance, column and row; (FAR, first, 0) where all are farther away than that.
    """
    best, near, which = FAR, first, 0
    for b in range(boxes.shape[0]):
        x, y, z = boxes[b, 0], boxes[b, 1], boxes[b, 2]
        hx, hy, hz, yaw = boxes[b, 3], boxes[b, 4], boxes[b, 5], boxes[b, 6]
        c, s = 1.0, 0.0
        if yaw != 0.0:
            c, s = math.cos(yaw), math.sin(yaw)
        for k in range(first, robot.shape[1]):
            ux, uy, uz = robot[UX, k], robot[UY, k], robot[UZ, k]
            wx, wy, wz = robot[X, k] - x, robot[Y, k] - y, robot[Z, k] - z
            px, py, pz = c * wx + s * wy, c * wy - s * wx, wz
            vx, vy = c * ux + s * uy, c * uy - s * ux
            # The box around the segment, faces along the other's, is never farther away.
            ex = max(0.0, abs(px + 0.5 * vx) - 0.5 * abs(vx) - hx)
            ey = max(0.0, abs(py + 0.5 * vy) - 0.5 * abs(vy) - hy)
            ez = max(0.0, abs(pz + 0.5 * uz) - 0.5 * abs(uz) - hz)
            reach = best + robot[RADIUS, k]
            if reach <= 0.0 or ex * ex + ey * ey + ez * ez >= reach * reach:
                continue
            d = _segment_to_box(px, py, pz, vx, vy, uz, hx, hy, hz) - robot[RADIUS, k]
            if d < best:
                best, near, which = d, k, b
    return best, near, which


@kernel(error_model="numpy", fastmath=FAST)
def _segment_to_box(
    px: float, py: float, pz: float,
    vx: float, vy: float, vz: float,
    hx: float, hy: float, hz: float,
) -> float:  # fmt: skip
    """Return the distance of a segment to a box around the origin [m].

    Args:
        px: Start of the segment [m]; then py, pz.
        py: See px.
        pz: See px.
        vx: End less start [m]; then vy, vz.
        vy: See vx.
        vz: See vx.
        hx: Half sizes of the box [m]; then hy, hz.
        hy: See hx.
        hz: See hx.
    """
    low, high = 0.0, 1.0
    slope_low = _slope(low, px, py, pz, vx, vy, vz, hx, hy, hz)
    slope_high = _slope(high, px, py, pz, vx, vy, vz, hx, hy, hz)
    if slope_low < 0.0 < slope_high:
        for face in range(6):
            axis = face >> 1
            p = px if axis == 0 else (py if axis == 1 else pz)
            v = vx if axis == 0 else (vy if axis == 1 else vz)
            h = hx if axis == 0 else (hy if axis == 1 else hz)
            if v == 0.0:
                continue
            s = ((h if face & 1 else -h) - p) / v
            if low < s < high:
                slope = _slope(s, px, py, pz, vx, vy, vz, hx, hy, hz)
                if slope < 0.0:
                    low, slope_low = s, slope
                else:
                    high, slope_high = s, slope
        low -= slope_low * (high - low) / (slope_high - slope_low)
    elif slope_low < 0.0:
        low = 1.0
    x = max(0.0, abs(px + low * vx) - hx)
    y = max(0.0, abs(py + low * vy) - hy)
    z = max(0.0, abs(pz + low * vz) - hz)
    return math.sqrt(x * x + y * y + z * z)


@kernel(inline="always", error_model="numpy", fastmath=FAST)
def _slope(
    s: float,
    px: float, py: float, pz: float,
    vx: float, vy: float, vz: float,
    hx: float, hy: float, hz: float,
) -> float:  # fmt: skip
    """Return half the slope of the squared distance at fraction ``s`` [m^2]."""
    x, y, z = px + s * vx, py + s * vy, pz + s * vz
    return (
        vx * (x - min(hx, max(-hx, x)))
        + vy * (y - min(hy, max(-hy, y)))
        + vz * (z - min(hz, max(-hz, z)))
    )
