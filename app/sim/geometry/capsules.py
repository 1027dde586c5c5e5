"""Sets of capsules as structures of arrays, and exact distances between them, compiled.

A capsule is the set of points within ``radius`` of a segment. A set of n capsules is an array
of shape (9, n), one capsule per column: compilers vectorise the loops over columns, on which
the simulator's speed depends. The distance of two capsules is the distance of their segments
less both radii; segments by Ericson, *Real-Time Collision Detection* (2005), section 5.1.9,
without branches: the point on the second segment nearest to a first guess on the first,
clamped, then the point on the first nearest to that. Tests compare with python-fcl to 1e-6 m.
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR, FAST, kernel
from app.sim.geometry.segments import Point

Span = tuple[float, float, float, float, float]
"""Second end of a segment less the first [m], its square [m^2], and its inverse [1/m^2]."""
X, Y, Z, UX, UY, UZ, UU, RADIUS, INVERSE = range(9)
"""Rows: first end [m], second end less first [m], its square [m^2], radius [m], 1 / UU (0 where
the segment is a point)."""
N_ROWS = 9
WIDTH = 8
"""Number of columns of sets in inner loops is a multiple of this."""
NOWHERE = 1e3
"""Coordinate of padding columns [m]."""


def padded_size(n: int) -> int:
    """Return n rounded up to a multiple of WIDTH."""
    return -(-n // WIDTH) * WIDTH


def new_capsules(n: int, radius: Vec, length2: Vec | None = None) -> Vec:
    """Return a set of ``n`` capsules, all at NOWHERE until they are placed.

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
    """Return capsules given by their ends as a structure of arrays.

    Args:
        ends: Ends of the segments [m], shape (k, 2, 3).
        radius: Radii [m], shape (k,).
        n: Number of columns; k where None.
    """
    span = ends[:, 1] - ends[:, 0]
    out = new_capsules(len(radius) if n is None else n, radius, (span**2).sum(1))
    out[X:UX, : len(radius)] = ends[:, 0].T
    out[UX:UU, : len(radius)] = span.T
    return out


def ends_of(capsules: Vec, n: int) -> Vec:
    """Return the ends of the first ``n`` capsules [m], shape (n, 2, 3)."""
    start = capsules[X:UX, :n].T
    return np.stack([start, start + capsules[UX:UU, :n].T], axis=1)


@kernel(inline="always")
def start_of(a: Vec, i: int) -> Point:
    """Return the first end of column ``i`` [m]."""
    return a[X, i], a[Y, i], a[Z, i]


@kernel(inline="always")
def span_of(a: Vec, i: int) -> Span:
    """Return the second end less the first of column ``i`` [m], its square and the inverse."""
    return a[UX, i], a[UY, i], a[UZ, i], a[UU, i], a[INVERSE, i]


@kernel(inline="always", error_model="numpy", fastmath=FAST)
def segment_distance(p: Point, u: Span, q: Point, v: Span) -> float:
    """Return the distance of two segments [m], given by their starts and spans."""
    ux, uy, uz, uu, iu = u
    vx, vy, vz, vv, iv = v
    wx, wy, wz = p[0] - q[0], p[1] - q[1], p[2] - q[2]
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
def distances(a: Vec, i: int, b: Vec, out: Vec) -> None:
    """Write the distance of column ``i`` of ``a`` to every column of ``b`` [m].

    Args:
        a: Capsules, shape (9, n).
        i: One of them.
        b: Other capsules, shape (9, m).
        out: Filled, shape (m,).
    """
    p, u, radius = start_of(a, i), span_of(a, i), a[RADIUS, i]
    for j in range(b.shape[1]):
        axes = segment_distance(p, u, start_of(b, j), span_of(b, j))
        out[j] = axes - radius - b[RADIUS, j]


@kernel(error_model="numpy", fastmath=FAST)
def capsule_clearances(a: Vec, b: Vec, out: Vec) -> None:
    """Write, for every column of ``b``, its distance to the nearest column of ``a`` [m].

    Args:
        a: Capsules, shape (9, n).
        b: Other capsules, shape (9, m); m best a multiple of WIDTH.
        out: Filled, shape (m,).
    """
    for j in range(b.shape[1]):
        out[j] = FAR
    for i in range(a.shape[1]):
        p, u, radius = start_of(a, i), span_of(a, i), a[RADIUS, i]
        for j in range(b.shape[1]):
            axes = segment_distance(p, u, start_of(b, j), span_of(b, j))
            d = axes - radius - b[RADIUS, j]
            out[j] = d if d < out[j] else out[j]


@kernel(error_model="numpy", fastmath=FAST)
def nearest_parts(
    a: Vec, n: int, b: Vec, first: int, last: int, out: Vec, part: Vec | None
) -> None:
    """Write, for the first n columns of ``a``, the nearest of a range of columns of ``b``.

    Args:
        a: Capsules, shape (9, n) or larger.
        n: Number of columns, best a multiple of half of WIDTH.
        b: Other capsules, shape (9, m).
        first: First column of ``b`` in the range.
        last: Last column of ``b`` in the range.
        out: Filled with distances [m], shape (n,) or longer.
        part: Filled with columns of ``b``, shape (n,) or longer; None: distances only.
    """
    for j in range(n):
        out[j] = FAR
        if part is not None:
            part[j] = first
    for i in range(first, last + 1):
        p, u, radius = start_of(b, i), span_of(b, i), b[RADIUS, i]
        for j in range(n):
            axes = segment_distance(p, u, start_of(a, j), span_of(a, j))
            d = axes - radius - a[RADIUS, j]
            if part is not None:
                part[j] = i if d < out[j] else part[j]
            out[j] = d if d < out[j] else out[j]


@kernel()
def least(values: Vec) -> tuple[float, int]:
    """Return the least value and its index; (FAR, 0) without values."""
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
        axes = segment_distance(start_of(a, i), span_of(a, i), start_of(a, j), span_of(a, j))
        out[k] = axes - a[RADIUS, i] - a[RADIUS, j]


@kernel(inline="always")
def _square_displacement(before: Vec, after: Vec, k: int) -> float:
    """Return the square of the greater displacement of the two ends of column ``k`` [m^2]."""
    x, y, z = (
        after[X, k] - before[X, k],
        after[Y, k] - before[Y, k],
        after[Z, k] - before[Z, k],
    )
    ux = x + after[UX, k] - before[UX, k]
    uy = y + after[UY, k] - before[UY, k]
    uz = z + after[UZ, k] - before[UZ, k]
    return float(max(x * x + y * y + z * z, ux * ux + uy * uy + uz * uz))


@kernel(error_model="numpy", fastmath=FAST)
def greatest_displacement(before: Vec, after: Vec) -> float:
    """Return the greatest displacement of any capsule end [m]; both sets of shape (9, n)."""
    longest = 0.0
    for k in range(before.shape[1]):
        longest = max(longest, _square_displacement(before, after, k))
    return math.sqrt(longest)


@kernel(error_model="numpy", fastmath=FAST)
def displacements(before: Vec, after: Vec, out: Vec) -> None:
    """Write the greater displacement of the two ends of each capsule [m].

    Args:
        before: Capsules, shape (9, n).
        after: The same moved, shape (9, n).
        out: Filled, shape (n,).
    """
    for k in range(before.shape[1]):
        out[k] = math.sqrt(_square_displacement(before, after, k))


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
