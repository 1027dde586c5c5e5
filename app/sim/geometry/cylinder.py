"""Exact distances of capsules to a solid vertical cylinder that stands on the floor, compiled.

The cylinder of docs/method.md 2.1 extends from far below up to ``top``. A capsule is the set of
points within its radius of a segment, so its distance is that of its segment less the radius.
In the horizontal plane, the distance of a segment to the axis less ``r`` is never more than the
true distance, and equals it where the nearest point lies below ``top``, the usual case.
Otherwise the nearest point lies between there and the lowest point of the segment that is not
below ``top``, where the squared distance to the disc is convex: a bracketed Newton search.
Tests compare with python-fcl.
"""

import math

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR, FAST, kernel
from app.sim.geometry.capsules import RADIUS, UX, UY, UZ, X, Y, Z, segment_distance

UPRIGHT = 1e-12
"""Squared length in the plane below which a segment is upright [m^2]."""
_TOLERANCE = 1e-11
"""Bracket at which the search above the cylinder ends [m]."""
_MOST_STEPS = 80
"""Steps of that search at most; halving alone needs half of them."""


@kernel(error_model="numpy", fastmath=FAST)
def cylinder_clearance(
    robot: Vec, first: int, x: float, y: float, r: float, top: float, within: float = FAR
) -> tuple[float, int]:
    """Return the least distance of capsules to a cylinder [m] and the nearest capsule.

    Exact where they are apart. Negative exactly where they overlap; the penetration depth then
    counts sideways only, not over the top.

    Args:
        robot: Capsules as columns, shape (>= 8, n).
        first: First column that counts.
        x: Axis [m].
        y: Axis [m].
        r: Radius of the cylinder [m].
        top: Height of its top [m].
        within: Distance that counts as far away [m].

    Returns:
        Distance and column; (within, first) where all are farther away than that.
    """
    best, near = within, first
    for k in range(first, robot.shape[1]):
        ux, uy = robot[UX, k], robot[UY, k]
        wx, wy = robot[X, k] - x, robot[Y, k] - y
        uu, wu = ux * ux + uy * uy, wx * ux + wy * uy
        # Upright segments count from their lower end.
        s = -wu / uu if uu > UPRIGHT else (1.0 if robot[UZ, k] < 0.0 else 0.0)
        s = min(1.0, max(0.0, s))
        px, py = wx + s * ux, wy + s * uy
        away = r + robot[RADIUS, k]
        reach = best + away
        if reach <= 0.0 or px * px + py * py >= reach * reach:
            continue
        d = math.sqrt(px * px + py * py) - away
        if robot[Z, k] + s * robot[UZ, k] > top:
            h = robot[Z, k] - top
            d = _over_the_top(wx, wy, h, ux, uy, robot[UZ, k], s, r) - robot[RADIUS, k]
            if d >= best:
                continue
        best, near = d, k
    return best, near


@kernel(error_model="numpy", fastmath=FAST)
def swept_clearance(robot: Vec, x: float, y: float, sx: float, sy: float, r: float) -> float:
    """Return the least distance of capsules to a cylinder swept along a straight line [m].

    Computed in the plane, as if the cylinder had no top: never more than the true distance.

    Args:
        robot: Capsules as columns, shape (>= 8, n).
        x: Start of the axis [m].
        y: Start of the axis [m].
        sx: Displacement of the axis [m].
        sy: Displacement of the axis [m].
        r: Radius of the cylinder [m].
    """
    best, square = FAR, sx * sx + sy * sy
    path = (sx, sy, 0.0, square, 1.0 / square if square > UPRIGHT else 0.0)
    origin = (0.0, 0.0, 0.0)
    for k in range(robot.shape[1]):
        ux, uy = robot[UX, k], robot[UY, k]
        uu = ux * ux + uy * uy
        inverse_u = 1.0 / uu if uu > UPRIGHT else 0.0
        start = (robot[X, k] - x, robot[Y, k] - y, 0.0)
        d = segment_distance(start, (ux, uy, 0.0, uu, inverse_u), origin, path)
        best = min(best, d - robot[RADIUS, k] - r)
    return best


@kernel(error_model="numpy", fastmath=FAST)
def _over_the_top(
    wx: float, wy: float, h: float, ux: float, uy: float, uz: float, end: float, r: float
) -> float:
    """Return the distance of a segment to the cylinder near its rim or over its top [m].

    Args:
        wx: Start of the segment relative to the axis [m].
        wy: See wx.
        h: Start of the segment above the top [m].
        ux: Direction of the segment [m].
        uy: See ux.
        uz: See ux.
        end: Point of the segment nearest to the axis, above the top, as a fraction.
        r: Radius of the cylinder [m].
    """
    start = 0.0 if uz > 0.0 else 1.0
    if h + start * uz < 0.0:  # The segment comes up through the plane of the top.
        start = -h / uz
        edge = math.hypot(wx + start * ux, wy + start * uy) - r
        if edge <= 0.0:
            return edge
    uu, wu = ux * ux + uy * uy, wx * ux + wy * uy
    length = math.sqrt(uu + uz * uz)
    s, down, up = start, start, end  # Going from start to end, the distance falls at ``down``.
    value = 0.0
    for step in range(_MOST_STEPS):
        px, py, pz = wx + s * ux, wy + s * uy, h + s * uz
        rho = math.sqrt(px * px + py * py)
        over = max(0.0, rho - r)
        value = math.sqrt(over * over + pz * pz)
        slope, bend = pz * uz, uz * uz
        if over > 0.0:
            inward = (wu + s * uu) / rho
            slope += over * inward
            bend += inward * inward + over * (uu - inward * inward) / rho
        if (slope < 0.0) == (end > start):
            down = s
        else:
            up = s
        if abs(up - down) * length < _TOLERANCE or slope == 0.0:
            break
        then = s - slope / bend
        if not min(down, up) < then < max(down, up):
            then = 0.5 * (down + up)
        if step == 0:
            then = end
        if abs(then - s) * length < 0.1 * _TOLERANCE:
            break
        s = then
    return value
