"""How much the robot's capsules add to its raw meshes: exact distances to triangles.

FCL measures distances of raw meshes in tens of milliseconds and ends its search early on round
bodies, so the reference is arithmetic on the triangles: a segment is nearest to a triangle at
one of the triangle's edges, at one of its own ends, or where it passes through.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.collision.fcl_recheck import robot_ends, segment_distances
from app.sim.collision.fcl_reference import collision_mesh
from app.sim.human import model as human
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.robot.capsules import TOOL, load_robot_capsules
from app.sim.robot.kernels.arm import Arm
from app.sim.robot.ur10 import LINK_NAMES, Robot

FARTHEST = 0.5
"""Postures with more clearance than this are left out: nothing depends on their gap [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Gap:
    """One posture of robot and person."""

    capsules: float
    """Distance of the robot's capsules to the person [m]."""
    meshes: float
    """Distance of its raw meshes and its tool to the person [m]."""
    nearest: str
    """The robot's capsule that is nearest."""


@cache
def triangles(link: str) -> np.ndarray:
    """One link's collision mesh in the link's frame [m], shape (n, 3, 3)."""
    return np.asarray(collision_mesh(link).triangles)


def segment_to_triangles(p0: np.ndarray, p1: np.ndarray, corners: np.ndarray) -> float:
    """Least distance of a segment to triangles, shape (n, 3, 3) [m]."""
    corners = _candidates(p0, p1, corners)
    edges = segment_distances(p0, p1, corners, corners[:, [1, 2, 0]])
    best = float(edges.min())
    origin, u, v = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(u, v)
    area2 = (normal**2).sum(axis=1)
    proper = area2 > 1e-24
    origin, u, v = origin[proper], u[proper], v[proper]
    normal = normal[proper] / np.sqrt(area2[proper])[:, None]
    height = [((p - origin) * normal).sum(axis=1) for p in (p0, p1)]
    for p, h in zip((p0, p1), height, strict=True):
        over = _inside(p - h[:, None] * normal - origin, u, v)
        best = min(best, float(np.abs(h[over]).min(initial=np.inf)))
    crosses = height[0] * height[1] < 0.0
    share = height[0][crosses] / (height[0][crosses] - height[1][crosses])
    places = p0 + share[:, None] * (p1 - p0) - origin[crosses]
    return 0.0 if _inside(places, u[crosses], v[crosses]).any() else best


def _candidates(p0: np.ndarray, p1: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Leave out triangles whose surrounding sphere is farther away than some triangle is."""
    middle = corners.mean(axis=1)
    size = np.sqrt(((corners - middle[:, None]) ** 2).sum(axis=2).max(axis=1))
    away = segment_distances(p0, p1, middle, middle)
    return np.asarray(corners[away - size <= away.min()])


def _inside(place: np.ndarray, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Whether places in the planes of triangles with sides u, v lie inside them."""
    uu, vv, uv = (u * u).sum(axis=1), (v * v).sum(axis=1), (u * v).sum(axis=1)
    pu, pv = (place * u).sum(axis=1), (place * v).sum(axis=1)
    scale = uu * vv - uv * uv
    a, b = (vv * pu - uv * pv) / scale, (uu * pv - uv * pu) / scale
    return (a >= 0.0) & (b >= 0.0) & (a + b <= 1.0)


def postures(cell: Cell, arm: Arm, n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Working postures: the tool down over the table and a little off, a person at work.

    Returns:
        The robot's joints [rad], shape (n, 6), and the person's [m, rad], shape (n, 18).
    """
    rng, robot = np.random.default_rng(seed), Robot(cell.robot.tool_length)
    batch = PickBatch(cell, n, seed, PickSettings(observation="state"))
    batch.reset()
    q = np.empty((n, 6))
    for row in q:
        found = None
        while found is None:
            target = rng.uniform([-0.7, 0.4, 0.05], [0.7, 0.85, 0.45])
            found = robot.ik_vertical(target, arm.limits.q_min, arm.limits.q_max)
        row[:] = np.clip(found + rng.normal(0.0, 0.15, 6), arm.limits.q_min, arm.limits.q_max)
    return q, batch.state.people.q[:, 0].copy()


def gaps(cell: Cell, arm: Arm, n: int, seed: int) -> list[Gap]:
    """Return the gaps of those of n working postures in which robot and person are near."""
    q, human_q = postures(cell, arm, n, seed)
    capsules, robot = (
        load_robot_capsules(cell.robot.tool_length, cell.robot.tool_radius),
        Robot(),
    )
    p0, p1 = robot_ends(robot, capsules, q)
    found = []
    for k in range(n):
        person = human.capsules(human_q[k], cell.body, cell.floor_z)
        d = segment_distances(p0[k, :, None], p1[k, :, None], person[:, 0], person[:, 1])
        d = d - capsules.radius[:, None] - human.CAPSULE_RADII
        if not 0.0 < d.min() < FARTHEST:
            continue
        i = int(d.min(axis=1).argmin())
        meshes = _meshes(robot.link_poses(q[k]), capsules.name, capsules.link, d, person)
        found.append(Gap(capsules=float(d.min()), meshes=meshes, nearest=capsules.name[i]))
    return found


def _meshes(
    poses: np.ndarray,
    names: tuple[str, ...],
    links: np.ndarray,
    d: np.ndarray,
    person: np.ndarray,
) -> float:
    """Distance of meshes and tool to a person [m], from the distances of all capsules.

    Capsules contain the meshes, so a pair whose capsules are farther apart than the best found
    so far cannot be nearer.
    """
    best = float(d[names.index(TOOL)].min())
    for flat in d.argsort(axis=None):
        i, j = np.unravel_index(flat, d.shape)
        if d[i, j] >= best:
            break
        if names[i] == TOOL:
            continue
        pose = poses[links[i]]
        ends = (person[j] - pose[:3, 3]) @ pose[:3, :3]
        distance = segment_to_triangles(*ends, triangles(LINK_NAMES[links[i]]))
        best = min(best, max(distance - float(human.CAPSULE_RADII[j]), 0.0))
    return best
