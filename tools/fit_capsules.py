"""Fit capsules that contain the UR10's collision meshes; run ``python -m tools.fit_capsules``.

A capsule is convex, so it contains a triangle when it contains its corners. Long links are cut
by planes across their axis: every triangle that straddles a plane is split *on* the plane, each
part gets the capsule of least volume around its corners, and the union contains the whole
surface, not just the vertices. The cuts are searched for the least sum of volumes.

The result is committed as ``app/sim/robot/data/ur10_capsules.json``;
``tests/sim/robot/test_capsules.py`` checks the containment again.
"""

import json
import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import ConvexHull

from app.sim.collision.fcl_reference import collision_mesh
from app.sim.core.arrays import Vec
from app.sim.robot.capsules import CAPSULE_FILE
from app.sim.robot.ur10 import LINK_NAMES
from tools.arguments import parser_of

Fit = tuple[Vec, Vec, float]
"""End points [m] and radius [m] of a fitted capsule."""

logger = logging.getLogger(__name__)

DECIMALS = 5
"""Numbers are written in steps of 10 micrometres; radii are rounded up after that."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkPlan:
    """How one link is covered."""

    link: str
    """Name of the link."""
    parts: tuple[str, ...]
    """Names of the capsules, along the cutting axis."""
    cut_grid: tuple[tuple[float, ...], ...] = ()
    """Positions tried for each cut along z of the link's frame [m]."""


PLANS = (
    LinkPlan(link="base_link", parts=("base",)),
    LinkPlan(link="shoulder_link", parts=("shoulder",)),
    LinkPlan(
        link="upper_arm_link",
        parts=("upper_arm_low", "upper_arm_mid", "upper_arm_high"),
        cut_grid=(
            (0.03, 0.045, 0.06, 0.07, 0.08, 0.09, 0.10, 0.12),
            (0.49, 0.51, 0.53, 0.545, 0.56, 0.575, 0.59, 0.61),
        ),
    ),
    LinkPlan(
        link="forearm_link",
        parts=("forearm_low", "forearm_mid", "forearm_high"),
        cut_grid=(
            (0.02, 0.035, 0.05, 0.065, 0.08, 0.10, 0.13, 0.16),
            (0.40, 0.44, 0.48, 0.50, 0.52, 0.535, 0.55, 0.57),
        ),
    ),
    LinkPlan(link="wrist_1_link", parts=("wrist_1",)),
    LinkPlan(link="wrist_2_link", parts=("wrist_2",)),
    LinkPlan(link="wrist_3_link", parts=("wrist_3",)),
)


def segment_distance(points: Vec, p0: Vec, p1: Vec) -> Vec:
    """Distance of points (n, 3) to the segment p0-p1 [m], shape (n,)."""
    axis = p1 - p0
    length2 = float(axis @ axis)
    if length2 < 1e-18:
        return np.asarray(np.linalg.norm(points - p0, axis=1))
    share = np.clip((points - p0) @ axis / length2, 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - p0 - share[:, None] * axis, axis=1))


def capsule_volume(radius: float, length: float) -> float:
    """Volume of a capsule [m^3]."""
    return math.pi * radius**2 * (length + 4.0 * radius / 3.0)


def clip_slab(triangles: Vec, low: float, high: float) -> Vec:
    """Corners of all triangles (n, 3, 3) clipped to ``low <= z <= high``, shape (m, 3)."""
    corners = triangles.reshape(-1, 3)
    inside = corners[(corners[:, 2] >= low) & (corners[:, 2] <= high)]
    points = [inside]
    for level in (low, high):
        for i, j in ((0, 1), (1, 2), (2, 0)):
            a, b = triangles[:, i], triangles[:, j]
            cross = (a[:, 2] - level) * (b[:, 2] - level) < 0.0
            share = (level - a[cross, 2]) / (b[cross, 2] - a[cross, 2])
            points.append(a[cross] + share[:, None] * (b[cross] - a[cross]))
    return np.concatenate(points)


def fit_capsule(points: Vec, restarts: int = 3) -> Fit:
    """Find a capsule of (nearly) least volume around points (n, 3).

    Nelder-Mead over the two end points, the radius being the greatest distance of a point;
    started along each principal and each coordinate axis.

    Returns:
        Both end points [m] and the radius [m], which contains every point.
    """
    hull = points[ConvexHull(points, qhull_options="QJ").vertices]
    centre = 0.5 * (hull.min(axis=0) + hull.max(axis=0))
    axes = np.vstack([np.linalg.svd(hull - hull.mean(axis=0))[2], np.eye(3)])

    def volume(x: Vec) -> float:
        radius = float(segment_distance(hull, x[:3], x[3:]).max())
        return capsule_volume(radius, float(np.linalg.norm(x[3:] - x[:3])))

    best = np.concatenate([centre, centre])
    for axis in axes:
        along = (hull - centre) @ axis
        across = np.linalg.norm(hull - centre - along[:, None] * axis, axis=1).max()
        half = max(0.5 * np.ptp(along) - across, 0.003)
        x = np.concatenate([centre - half * axis, centre + half * axis])
        for _ in range(restarts):
            x = minimize(
                volume,
                x,
                method="Nelder-Mead",
                options={"maxiter": 2000, "xatol": 1e-6, "fatol": 1e-10, "adaptive": True},
            ).x
        best = x if volume(x) < volume(best) else best
    p0, p1 = np.round(best[:3], DECIMALS), np.round(best[3:], DECIMALS)
    step = 10.0**-DECIMALS
    radius = math.ceil(float(segment_distance(points, p0, p1).max()) / step + 1e-6) * step
    return p0, p1, round(radius, DECIMALS)


def total_volume(fits: Sequence[Fit]) -> float:
    """Sum of the capsules' volumes [m^3]."""
    return sum(capsule_volume(r, float(np.linalg.norm(p1 - p0))) for p0, p1, r in fits)


def fit_link(plan: LinkPlan) -> list[Fit]:
    """Cover one link with ``len(plan.parts)`` capsules of least total volume."""
    triangles = np.asarray(collision_mesh(plan.link).triangles, dtype=np.float64)

    @cache
    def fit_slab(low: float, high: float, restarts: int) -> Fit:
        return fit_capsule(clip_slab(triangles, low, high), restarts)

    def fit_parts(cuts: Sequence[float], restarts: int) -> list[Fit]:
        edges = [-math.inf, *cuts, math.inf]
        return [fit_slab(low, high, restarts) for low, high in pairwise(edges)]

    cuts = [grid[len(grid) // 2] for grid in plan.cut_grid]
    for _ in range(2 if cuts else 0):
        for i, grid in enumerate(plan.cut_grid):
            trials = [[*cuts[:i], cut, *cuts[i + 1 :]] for cut in grid]
            sums = [total_volume(fit_parts(trial, 1)) for trial in trials]
            cuts = trials[int(np.argmin(sums))]
    fits = fit_parts(cuts, 3)
    logger.info("%s: cuts %s, %.3f l", plan.link, cuts, 1e3 * total_volume(fits))
    return fits


def main() -> None:
    """Fit all links and write the data file."""
    rows = []
    for plan in PLANS:
        for name, (p0, p1, radius) in zip(plan.parts, fit_link(plan), strict=True):
            rows.append(
                {
                    "name": name,
                    "link": plan.link,
                    "p0": p0.tolist(),
                    "p1": p1.tolist(),
                    "radius": radius,
                }
            )
    assert {row["link"] for row in rows} == set(LINK_NAMES)
    lines = ",\n  ".join(json.dumps(row) for row in rows)
    CAPSULE_FILE.write_text(
        '{"robot": "ur10", "unit": "m", "frame": "link", "capsules": [\n  ' + lines + "\n]}\n"
    )


if __name__ == "__main__":
    parser_of(__doc__).parse_args()
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    main()
