"""Interpolation weights of a goal between training targets (compiled).

A goal inside a grid lies in a box of eight targets (trilinear weights), among scattered targets
in a tetrahedron of four (barycentric weights). Both kinds of weights sum to one and are
continuous across boxes; at a target its own weight is exactly one.

Source: (4.29). Deviates: the source divides ``p`` by the grid's spacing only in ``1 - p/l``, so
that its weights do not sum to one (docs/method.md 2.4).
"""

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel

Indices = NDArray[np.int64]

N_BOX = 8
"""Corners of a box of the grid."""
N_SIMPLEX = 4
"""Corners of a tetrahedron."""
_ROUNDING = 1e-12
"""Barycentric weights below this become zero."""


@kernel(error_model="numpy")
def _place(axis: Vec, value: float) -> tuple[int, int, float]:
    """Return the grid planes below and above a coordinate and its fraction between them."""
    n = axis.shape[0]
    if n < 2:
        return 0, 0, 0.0
    i = 0
    while i < n - 2 and axis[i + 1] <= value:
        i += 1
    p = (value - axis[i]) / (axis[i + 1] - axis[i])
    return i, i + 1, min(1.0, max(0.0, p))


@kernel(error_model="numpy")
def box_weights(x: Vec, y: Vec, z: Vec, goals: Vec, which: Indices, weights: Vec) -> None:
    """Write the corners of each goal's box and their trilinear weights.

    Args:
        x: x coordinates of the grid's planes [m], ascending, shape (n_x,).
        y: y coordinates of the grid's planes [m], ascending, shape (n_y,).
        z: z coordinates of the grid's planes [m], ascending, shape (n_z,); targets are
            numbered with z varying fastest, then y.
        goals: Inside the grid [m], shape (n, 3).
        which: Filled with the numbers of targets, shape (n, N_BOX).
        weights: Filled, shape (n, N_BOX).
    """
    n_y, n_z = y.shape[0], z.shape[0]
    for k in range(goals.shape[0]):
        x0, x1, px = _place(x, goals[k, 0])
        y0, y1, py = _place(y, goals[k, 1])
        z0, z1, pz = _place(z, goals[k, 2])
        for corner in range(N_BOX):
            on_x, on_y, on_z = corner & 4, corner & 2, corner & 1
            i = x1 if on_x else x0
            j = y1 if on_y else y0
            which[k, corner] = (i * n_y + j) * n_z + (z1 if on_z else z0)
            weights[k, corner] = (
                (px if on_x else 1.0 - px)
                * (py if on_y else 1.0 - py)
                * (pz if on_z else 1.0 - pz)
            )


@kernel(error_model="numpy")
def _barycentric(inverse: Vec, last: Vec, goal: Vec, out: Vec) -> float:
    """Write a goal's barycentric coordinates in a tetrahedron; return the least one."""
    x, y, z = goal[0] - last[0], goal[1] - last[1], goal[2] - last[2]
    rest, least = 1.0, 1.0
    for i in range(3):
        out[i] = inverse[i, 0] * x + inverse[i, 1] * y + inverse[i, 2] * z
        rest -= out[i]
        least = min(least, out[i])
    out[3] = rest
    return min(least, rest)


@kernel(error_model="numpy")
def simplex_weights(
    corners: Indices, inverse: Vec, last: Vec, goals: Vec, which: Indices, weights: Vec
) -> None:
    """Write the corners of each goal's tetrahedron and their barycentric weights.

    Args:
        corners: Numbers of each tetrahedron's targets, shape (m, 4).
        inverse: Maps ``goal - last`` to the first three coordinates [1/m], shape (m, 3, 3).
        last: Fourth target of each [m], shape (m, 3).
        goals: Inside the hull [m], shape (n, 3).
        which: Filled with the numbers of targets, shape (n, N_SIMPLEX).
        weights: Filled, shape (n, N_SIMPLEX).
    """
    for k in range(goals.shape[0]):
        best, chosen = -np.inf, 0
        for m in range(corners.shape[0]):
            least = _barycentric(inverse[m], last[m], goals[k], weights[k])
            if least > best:
                best, chosen = least, m
        _barycentric(inverse[chosen], last[chosen], goals[k], weights[k])
        total = 0.0
        for i in range(N_SIMPLEX):
            which[k, i] = corners[chosen, i]
            if weights[k, i] < _ROUNDING:
                weights[k, i] = 0.0
            total += weights[k, i]
        for i in range(N_SIMPLEX):
            weights[k, i] /= total
