"""Exact distances of capsules to boxes rotated about the vertical, compiled.

In the frame of the box the squared distance of the point at fraction ``s`` of a segment is
``sum_i max(0, |p_i(s)| - half_i)^2``: convex, and quadratic between the places, six at most,
where a coordinate passes a face. Its slope is therefore continuous, non-decreasing and linear
between those places, so the least distance follows from the two places around the slope's zero,
without iteration. Tests compare with python-fcl.
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR, FAST, kernel
from app.sim.geometry.capsules import RADIUS, UX, UY, UZ, X, Y, Z
from app.sim.geometry.segments import Point


@kernel(error_model="numpy", fastmath=FAST)
def box_clearance(robot: Vec, first: int, boxes: Vec) -> tuple[float, int, int]:
    """Return the least distance of capsules to boxes [m], the nearest capsule and its box.

    The distance is exact for capsules apart from the box. It is not positive exactly where they
    touch; a segment inside the box yields minus its radius, not the penetration depth.

    Args:
        robot: Capsules as columns, shape (>= 8, n).
        first: First column that counts.
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
            d = _segment_to_box((px, py, pz), (vx, vy, uz), (hx, hy, hz)) - robot[RADIUS, k]
            if d < best:
                best, near, which = d, k, b
    return best, near, which


@kernel(error_model="numpy", fastmath=FAST)
def _segment_to_box(p: Point, v: Point, h: Point) -> float:
    """Return the distance of a segment to a box around the origin [m].

    Args:
        p: Start of the segment [m].
        v: End less start [m].
        h: Half sizes of the box [m].
    """
    low, high = 0.0, 1.0
    slope_low, slope_high = _slope(low, p, v, h), _slope(high, p, v, h)
    if slope_low < 0.0 < slope_high:
        for face in range(6):
            axis = face >> 1
            p_i = p[0] if axis == 0 else (p[1] if axis == 1 else p[2])
            v_i = v[0] if axis == 0 else (v[1] if axis == 1 else v[2])
            h_i = h[0] if axis == 0 else (h[1] if axis == 1 else h[2])
            if v_i == 0.0:
                continue
            s = ((h_i if face & 1 else -h_i) - p_i) / v_i
            if low < s < high:
                slope = _slope(s, p, v, h)
                if slope < 0.0:
                    low, slope_low = s, slope
                else:
                    high, slope_high = s, slope
        low -= slope_low * (high - low) / (slope_high - slope_low)
    elif slope_low < 0.0:
        low = 1.0
    x = max(0.0, abs(p[0] + low * v[0]) - h[0])
    y = max(0.0, abs(p[1] + low * v[1]) - h[1])
    z = max(0.0, abs(p[2] + low * v[2]) - h[2])
    return math.sqrt(x * x + y * y + z * z)


@kernel(inline="always", error_model="numpy", fastmath=FAST)
def _slope(s: float, p: Point, v: Point, h: Point) -> float:
    """Return half the slope of the squared distance at fraction ``s`` [m^2]."""
    x, y, z = p[0] + s * v[0], p[1] + s * v[1], p[2] + s * v[2]
    return (
        v[0] * (x - min(h[0], max(-h[0], x)))
        + v[1] * (y - min(h[1], max(-h[1], y)))
        + v[2] * (z - min(h[2], max(-h[2], z)))
    )
