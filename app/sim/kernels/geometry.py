"""Exact distances between capsules, and of capsules to the table, compiled.

A capsule is all points within ``radius`` of a segment, so the distance of two capsules is the
distance of their segments less both radii. Segments by Ericson, *Real-Time Collision
Detection* (2005), section 5.1.9. Tests hold this file against python-fcl to 1e-6 m.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from app.sim.ports import Vec

FAST = {"contract", "nsz", "arcp"}
"""Freedoms given to the compiler: fused multiply-add, signs of zero, reciprocals.
Never those that assume away NaN and infinity."""
FAR = 1e3
"""A distance that stands for "nothing there" [m]."""


@njit(cache=True, error_model="numpy", fastmath=FAST)
def segment_parameters(
    ux: float,
    uy: float,
    uz: float,
    vx: float,
    vy: float,
    vz: float,
    wx: float,
    wy: float,
    wz: float,
) -> tuple[float, float]:
    """Return where two segments are nearest, as fractions of their lengths.

    Scalars, not arrays: a function that compilers inline is several times faster here.

    Args:
        ux: Direction of the first segment, end less start [m]; then uy, uz.
        uy: See ux.
        uz: See ux.
        vx: Direction of the second segment [m]; then vy, vz.
        vy: See vx.
        vz: See vx.
        wx: Start of the first less start of the second [m]; then wy, wz.
        wy: See wx.
        wz: See wx.
    """
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


@njit(cache=True, error_model="numpy", fastmath=FAST)
def pair_distance2(a: Vec, b: Vec) -> float:
    """Return the squared distance of two segments [m^2], each of shape (2, 3)."""
    ux, uy, uz = a[1, 0] - a[0, 0], a[1, 1] - a[0, 1], a[1, 2] - a[0, 2]
    vx, vy, vz = b[1, 0] - b[0, 0], b[1, 1] - b[0, 1], b[1, 2] - b[0, 2]
    wx, wy, wz = a[0, 0] - b[0, 0], a[0, 1] - b[0, 1], a[0, 2] - b[0, 2]
    s, t = segment_parameters(ux, uy, uz, vx, vy, vz, wx, wy, wz)
    x, y, z = wx + s * ux - t * vx, wy + s * uy - t * vy, wz + s * uz - t * vz
    return float(x * x + y * y + z * z)


@njit(cache=True, error_model="numpy", fastmath=FAST)
def bounding_spheres(segments: Vec, centre: Vec, half: Vec) -> None:
    """Write centre [m], shape (n, 3), and half length [m], (n,), of segments (n, 2, 3)."""
    for k in range(segments.shape[0]):
        square = 0.0
        for i in range(3):
            centre[k, i] = 0.5 * (segments[k, 0, i] + segments[k, 1, i])
            square += (segments[k, 1, i] - segments[k, 0, i]) ** 2
        half[k] = 0.5 * math.sqrt(square)


@njit(cache=True, error_model="numpy", fastmath=FAST)
def spheres_apart(a: Vec, b: Vec) -> float:
    """Return the distance of the bounding spheres of two segments, shape (2, 3) each [m].

    Never more than the distance of the segments; negative where the spheres overlap.
    """
    gap, long_a, long_b = 0.0, 0.0, 0.0
    for i in range(3):
        between = 0.5 * (a[0, i] + a[1, i] - b[0, i] - b[1, i])
        gap += between * between
        long_a += (a[1, i] - a[0, i]) ** 2
        long_b += (b[1, i] - b[0, i]) ** 2
    return math.sqrt(gap) - 0.5 * (math.sqrt(long_a) + math.sqrt(long_b))


@njit(cache=True, error_model="numpy", fastmath=FAST)
def set_clearance(
    a: Vec, radius_a: Vec, b: Vec, radius_b: Vec, first: int, last: int, cap: float
) -> tuple[float, int, int]:
    """Return the least distance between two sets of capsules [m] and the nearest pair.

    Bounding spheres pass over pairs that cannot be nearer than the best so far.

    Args:
        a: Segments of the first set [m], shape (n, 2, 3).
        radius_a: Their radii [m], shape (n,).
        b: Segments of the second set [m], shape (m, 2, 3).
        radius_b: Their radii [m], shape (m,).
        first: First capsule of the second set to look at.
        last: Last one to look at.
        cap: Distances from here on are of no interest [m]; returned where none is less.
    """
    n = a.shape[0]
    centre_a, half_a = np.empty((n, 3)), np.empty(n)
    bounding_spheres(a, centre_a, half_a)
    best, near_a, near_b = cap, 0, first
    for h in range(last, first - 1, -1):
        x = 0.5 * (b[h, 0, 0] + b[h, 1, 0])
        y = 0.5 * (b[h, 0, 1] + b[h, 1, 1])
        z = 0.5 * (b[h, 0, 2] + b[h, 1, 2])
        dx, dy, dz = b[h, 1, 0] - x, b[h, 1, 1] - y, b[h, 1, 2] - z
        half = math.sqrt(dx * dx + dy * dy + dz * dz)
        for k in range(n):
            radii = radius_a[k] + radius_b[h]
            reach = best + radii + half + half_a[k]
            ex, ey, ez = centre_a[k, 0] - x, centre_a[k, 1] - y, centre_a[k, 2] - z
            if reach <= 0.0 or ex * ex + ey * ey + ez * ez >= reach * reach:
                continue
            d = math.sqrt(pair_distance2(a[k], b[h])) - radii
            if d < best:
                best, near_a, near_b = d, k, h
    return best, near_a, near_b


@njit(cache=True, error_model="numpy", fastmath=FAST)
def segment_nearest(a: Vec, b: Vec, out: Vec) -> float:
    """Write the vector between the nearest points of two segments; return its length [m].

    Args:
        a: First segment [m], shape (2, 3).
        b: Second segment [m], shape (2, 3).
        out: Filled with the vector from a to b [m], shape (3,).
    """
    ux, uy, uz = a[1, 0] - a[0, 0], a[1, 1] - a[0, 1], a[1, 2] - a[0, 2]
    vx, vy, vz = b[1, 0] - b[0, 0], b[1, 1] - b[0, 1], b[1, 2] - b[0, 2]
    wx, wy, wz = a[0, 0] - b[0, 0], a[0, 1] - b[0, 1], a[0, 2] - b[0, 2]
    s, t = segment_parameters(ux, uy, uz, vx, vy, vz, wx, wy, wz)
    out[0] = t * vx - wx - s * ux
    out[1] = t * vy - wy - s * uy
    out[2] = t * vz - wz - s * uz
    return math.sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2])


@njit(cache=True)
def capsule_distance(a: Vec, radius_a: float, b: Vec, radius_b: float) -> float:
    """Return the distance of two capsules [m], negative where their tubes overlap.

    Args:
        a: Segment of the first [m], shape (2, 3).
        radius_a: Its radius [m].
        b: Segment of the second [m], shape (2, 3).
        radius_b: Its radius [m].
    """
    return math.sqrt(pair_distance2(a, b)) - radius_a - radius_b


@njit(cache=True)
def place_capsules(
    rot: Vec, pos: Vec, link: NDArray[np.int64], p0: Vec, p1: Vec, first: int, out: Vec
) -> None:
    """Write the end points of capsules tied to links.

    Args:
        rot: R_world_link, shape (7, 3, 3).
        pos: Origins of the links [m], shape (7, 3).
        link: Link of each capsule, integers of shape (n,).
        p0: Ends in the link's frame [m], shape (n, 3).
        p1: Other ends in the link's frame [m], shape (n, 3).
        first: Capsules before this one are left as they are (the base never moves).
        out: Filled [m], shape (n, 2, 3).
    """
    for k in range(first, link.shape[0]):
        body = link[k]
        for i in range(3):
            out[k, 0, i] = (
                pos[body, i]
                + rot[body, i, 0] * p0[k, 0]
                + rot[body, i, 1] * p0[k, 1]
                + rot[body, i, 2] * p0[k, 2]
            )
            out[k, 1, i] = (
                pos[body, i]
                + rot[body, i, 0] * p1[k, 0]
                + rot[body, i, 1] * p1[k, 1]
                + rot[body, i, 2] * p1[k, 2]
            )
