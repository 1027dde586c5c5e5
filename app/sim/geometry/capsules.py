"""Sets of capsules as columns, and exact distances between them, compiled.

A capsule is all points within ``radius`` of a segment. A set of n capsules is an array of shape
(9, n), a structure of arrays: compilers turn the loops over columns into vector instructions,
which is what the simulator's speed rests on. The distance of two capsules is the distance of
their segments less both radii; segments by Ericson, *Real-Time Collision Detection* (2005),
section 5.1.9, written without branches: the point on the second segment nearest to a first
guess on the first, clamped, then the point on the first nearest to that. Tests hold this file
against python-fcl to 1e-6 m.
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.segments import FAR, FAST

X, Y, Z, UX, UY, UZ, UU, RADIUS, INVERSE = range(9)
"""Rows: first end [m], second end less first [m], its square [m^2], radius [m], 1 / UU (0 where
the segment is a point)."""
N_ROWS = 9
WIDTH = 8
"""Columns of sets that inner loops run over come in multiples of this."""
NOWHERE = 1e3
"""Coordinate of columns that only fill up a set [m]."""


def padded(n: int) -> int:
    """Return the number of columns of a set of n capsules that an inner loop runs over."""
    return -(-n // WIDTH) * WIDTH


def new_columns(n: int, radius: Vec, length2: Vec | None = None) -> Vec:
    """Return a set of ``n`` columns, all nowhere until they are placed.

    Args:
        n: Number of columns, at least ``len(radius)``.
        radius: Radii of the real capsules [m], shape (k,).
        length2: Squares of their lengths [m^2], shape (k,), where they never change.
    """
    out = np.zeros((N_ROWS, n))
    out[X:UX] = NOWHERE
    out[RADIUS, : len(radius)] = radius
    if length2 is not None:
        out[UU, : len(radius)] = length2
        np.divide(1.0, out[UU], out=out[INVERSE], where=out[UU] > 1e-12)
    return out


def capsules_soa(ends: Vec, radius: Vec, n: int | None = None) -> Vec:
    """Return capsules given by their ends as columns.

    Args:
        ends: Ends of the segments [m], shape (k, 2, 3).
        radius: Radii [m], shape (k,).
        n: Number of columns; k where None.
    """
    span = ends[:, 1] - ends[:, 0]
    out = new_columns(len(radius) if n is None else n, radius, (span**2).sum(1))
    out[X:UX, : len(radius)] = ends[:, 0].T
    out[UX:UU, : len(radius)] = span.T
    return out


def ends_of(columns: Vec, n: int) -> Vec:
    """Return the ends of the first ``n`` columns [m], shape (n, 2, 3)."""
    start = columns[X:UX, :n].T
    return np.stack([start, start + columns[UX:UU, :n].T], axis=1)


@kernel(error_model="numpy", fastmath=FAST)
def distances(a: Vec, i: int, b: Vec, out: Vec) -> None:
    """Write the distance of column ``i`` of ``a`` to every column of ``b`` [m].

    Args:
        a: Capsules, shape (9, n).
        i: One of them.
        b: Other capsules, shape (9, m).
        out: Filled, shape (m,).
    """
    ax, ay, az, ux, uy, uz = a[X, i], a[Y, i], a[Z, i], a[UX, i], a[UY, i], a[UZ, i]
    uu, radius, inverse = a[UU, i], a[RADIUS, i], a[INVERSE, i]
    for j in range(b.shape[1]):
        out[j] = (
            segment_distance(
                ax - b[X, j], ay - b[Y, j], az - b[Z, j],
                ux, uy, uz, uu, inverse,
                b[UX, j], b[UY, j], b[UZ, j], b[UU, j], b[INVERSE, j],
            )
            - radius
            - b[RADIUS, j]
        )  # fmt: skip


@kernel(inline="always", error_model="numpy", fastmath=FAST)
def segment_distance(
    wx: float, wy: float, wz: float,
    ux: float, uy: float, uz: float, uu: float, iu: float,
    vx: float, vy: float, vz: float, vv: float, iv: float,
) -> float:  # fmt: skip
    """Return the distance of two segments [m]: w joins their starts, u and v their ends."""
    f = vx * wx + vy * wy + vz * wz
    c = ux * wx + uy * wy + uz * wz
    b = ux * vx + uy * vy + uz * vz
    det = uu * vv - b * b
    s = (b * f - c * vv) / (det if det > 1e-12 * uu * vv else 1e30)
    s = s if s > 0.0 else 0.0
    s = s if s < 1.0 else 1.0
    t = (b * s + f) * iv
    t = t if t > 0.0 else 0.0
    t = t if t < 1.0 else 1.0
    s = (b * t - c) * iu
    s = s if s > 0.0 else 0.0
    s = s if s < 1.0 else 1.0
    x = wx + s * ux - t * vx
    y = wy + s * uy - t * vy
    z = wz + s * uz - t * vz
    return math.sqrt(x * x + y * y + z * z)


@kernel(error_model="numpy", fastmath=FAST)
def gaps(a: Vec, b: Vec, out: Vec) -> None:
    """Write, for every column of ``b``, its distance to the nearest column of ``a`` [m].

    Args:
        a: Capsules, shape (9, n).
        b: Other capsules, shape (9, m); m best a multiple of WIDTH.
        out: Filled, shape (m,).
    """
    for j in range(b.shape[1]):
        out[j] = FAR
    for i in range(a.shape[1]):
        ax, ay, az, ux, uy, uz = a[X, i], a[Y, i], a[Z, i], a[UX, i], a[UY, i], a[UZ, i]
        uu, radius, inverse = a[UU, i], a[RADIUS, i], a[INVERSE, i]
        for j in range(b.shape[1]):
            d = (
                segment_distance(
                    ax - b[X, j], ay - b[Y, j], az - b[Z, j],
                    ux, uy, uz, uu, inverse,
                    b[UX, j], b[UY, j], b[UZ, j], b[UU, j], b[INVERSE, j],
                )
                - radius
                - b[RADIUS, j]
            )  # fmt: skip
            out[j] = d if d < out[j] else out[j]


@kernel(error_model="numpy", fastmath=FAST)
def nearest_parts(a: Vec, b: Vec, first: int, last: int, out: Vec, part: Vec) -> None:
    """Write, for every column of ``a``, the nearest of some columns of ``b``.

    Args:
        a: Capsules, shape (9, n); n best a multiple of WIDTH.
        b: Other capsules, shape (9, m).
        first: First column of ``b`` to look at.
        last: Last one.
        out: Filled with distances [m], shape (n,).
        part: Filled with columns of ``b``, shape (n,).
    """
    for j in range(a.shape[1]):
        out[j], part[j] = FAR, first
    for i in range(first, last + 1):
        bx, by, bz, vx, vy, vz = b[X, i], b[Y, i], b[Z, i], b[UX, i], b[UY, i], b[UZ, i]
        vv, radius, inverse = b[UU, i], b[RADIUS, i], b[INVERSE, i]
        for j in range(a.shape[1]):
            d = (
                segment_distance(
                    bx - a[X, j], by - a[Y, j], bz - a[Z, j],
                    vx, vy, vz, vv, inverse,
                    a[UX, j], a[UY, j], a[UZ, j], a[UU, j], a[INVERSE, j],
                )
                - radius
                - a[RADIUS, j]
            )  # fmt: skip
            part[j] = i if d < out[j] else part[j]
            out[j] = d if d < out[j] else out[j]


@kernel()
def least(values: Vec) -> tuple[float, int]:
    """Return the least of some values and its place; (FAR, 0) where there are none."""
    best, place = FAR, 0
    for j in range(values.shape[0]):
        if values[j] < best:
            best, place = values[j], j
    return best, place


@kernel(error_model="numpy", fastmath=FAST)
def pair_distances(
    a: Vec, first: NDArray[np.int64], second: NDArray[np.int64], out: Vec
) -> None:
    """Write the distances of chosen pairs of columns of one set [m].

    Args:
        a: Capsules, shape (9, n).
        first: One column of each pair, shape (m,).
        second: The other, shape (m,).
        out: Filled, shape (m,).
    """
    for k in range(first.shape[0]):
        i, j = first[k], second[k]
        out[k] = (
            segment_distance(
                a[X, i] - a[X, j], a[Y, i] - a[Y, j], a[Z, i] - a[Z, j],
                a[UX, i], a[UY, i], a[UZ, i], a[UU, i], a[INVERSE, i],
                a[UX, j], a[UY, j], a[UZ, j], a[UU, j], a[INVERSE, j],
            )
            - a[RADIUS, i]
            - a[RADIUS, j]
        )  # fmt: skip


@kernel(error_model="numpy", fastmath=FAST)
def greatest_displacement(before: Vec, after: Vec) -> float:
    """Return the farthest any end of a set's capsules moved [m]; both of shape (9, n)."""
    longest = 0.0
    for k in range(before.shape[1]):
        x, y, z = (
            after[X, k] - before[X, k],
            after[Y, k] - before[Y, k],
            after[Z, k] - before[Z, k],
        )
        ux = x + after[UX, k] - before[UX, k]
        uy = y + after[UY, k] - before[UY, k]
        uz = z + after[UZ, k] - before[UZ, k]
        longest = max(longest, x * x + y * y + z * z, ux * ux + uy * uy + uz * uz)
    return math.sqrt(longest)


@kernel(inline="always")
def copy_values(values: NDArray[np.floating], out: NDArray[np.floating]) -> None:
    """Copy an array of shape (n,); a slice would have to count references."""
    for i in range(values.shape[0]):
        out[i] = values[i]


@kernel(inline="always")
def copy_rows(values: Vec, out: Vec) -> None:
    """Copy an array of shape (n, m)."""
    for i in range(values.shape[0]):
        for j in range(values.shape[1]):
            out[i, j] = values[i, j]
