"""Verification of whole trajectories by FCL on the raw meshes.

Evaluations use it to find contacts that the kernels missed. Capsule distances (plain numpy, not
the kernels under test) exclude distant pairs; pairs nearer than ``MARGIN`` are checked on the
meshes, which is fast enough for hundreds of episodes.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.cells.cell import Cell
from app.sim.collision.fcl_reference import (
    BODY_NAMES,
    CollisionReference,
    Kind,
    MeshContact,
    walker_name,
)
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.robot.capsules import TOOL, RobotCapsules, load_robot_capsules, self_pairs
from app.sim.robot.ur10 import LINK_NAMES, Robot

MARGIN = 0.03
"""Clearance of capsules above which meshes are not checked [m]. Capsules contain the meshes, so
that 0 would be sufficient; the margin also finds errors of the capsules."""

Pairs = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """Robot and person at several times."""

    q_robot: Vec
    """Robot joint positions [rad], shape (n_steps, 6)."""
    q_human: Vec
    """Joint positions of the person [m, rad], shape (n_steps, 18); far away where there is
    none with joints."""
    sizes: Vec | None = None
    """The person's size in each row [m], shape (n_steps, 12); None: the cell's person."""
    cylinders: Vec | None = None
    """x, y and radius of the upright cylinders who walk about [m], shape (n_steps, C, 3); None
    without any."""

    @property
    def walkers(self) -> Vec:
        """Cylinders, shape (n_steps, C, 3); C may be 0."""
        return np.zeros((len(self.q_robot), 0, 3)) if self.cylinders is None else self.cylinders

    def size(self, row: int, cell: Cell) -> Vec:
        """Return the person's size in one row [m], shape (12,)."""
        return np.asarray(cell.body if self.sizes is None else self.sizes[row])


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstContact:
    """First contact of a trajectory."""

    index: int
    """Row of the trajectory."""
    contacts: tuple[MeshContact, ...]
    """All contacts in that row."""


class _Near(NamedTuple):
    """Pairs nearer than MARGIN, per row."""

    person: Pairs
    """Capsules of robot and person, shape (n_steps, n, m)."""
    cell: Pairs
    """Capsules of the robot and what stands in the cell, shape (n_steps, n)."""
    itself: Pairs
    """Pairs of the robot's capsules, shape (n_steps, n_pairs)."""
    walkers: Pairs
    """Capsules of the robot and cylinders, shape (n_steps, n, C)."""


def segment_distances(a0: Vec, a1: Vec, b0: Vec, b1: Vec) -> Vec:
    """Distance of the segments a0-a1 and b0-b1 [m]; shapes (..., 3) that broadcast.

    Source: Ericson, Real-Time Collision Detection, section 5.1.9.
    """
    u, v, w = a1 - a0, b1 - b0, a0 - b0
    uu, vv, uv = (u * u).sum(-1), (v * v).sum(-1), (u * v).sum(-1)
    uw, vw = (u * w).sum(-1), (v * w).sum(-1)
    scale = uu * vv - uv * uv
    flat = scale <= 1e-16
    s = np.where(flat, 0.0, (uv * vw - uw * vv) / np.where(flat, 1.0, scale))
    s = np.clip(s, 0.0, 1.0)
    t = np.clip((uv * s + vw) / np.maximum(vv, 1e-30), 0.0, 1.0)
    s = np.clip((uv * t - uw) / np.maximum(uu, 1e-30), 0.0, 1.0)
    gap = w + s[..., None] * u - t[..., None] * v
    return np.asarray(np.sqrt((gap * gap).sum(-1)))


def robot_ends(robot: Robot, capsules: RobotCapsules, q: Vec) -> tuple[Vec, Vec]:
    """Return both end points of all capsules along a path [m], each of shape (n_steps, n, 3).

    Args:
        robot: Its kinematics.
        q: Joint positions [rad], shape (n_steps, 6).
    """
    poses = np.stack([robot.link_poses(row) for row in q])[:, capsules.link]
    rotation, origin = poses[..., :3, :3], poses[..., :3, 3]
    p0 = np.einsum("tnij,nj->tni", rotation, capsules.p0) + origin
    p1 = np.einsum("tnij,nj->tni", rotation, capsules.p1) + origin
    return p0, p1


class Recheck:
    """Looks for the first contact of trajectories by FCL on raw meshes; not thread-safe."""

    def __init__(self, cell: Cell) -> None:
        self._cell = cell
        self._reference = CollisionReference(cell)
        self._robot = Robot(cell.robot.tool_length)
        self._capsules = load_robot_capsules(cell.robot.tool_length, cell.robot.tool_radius)
        self._self_pairs = self_pairs(self._capsules)
        boxes = (f"obstacle {box.id}" for box in cell.obstacles)
        self._standing = ("table", "floor", *boxes)
        self._body_of = [
            TOOL if name == TOOL else LINK_NAMES[link]
            for name, link in zip(self._capsules.name, self._capsules.link, strict=True)
        ]

    def first_contact(self, trajectory: Trajectory) -> FirstContact | None:
        """Return the first row of a trajectory with contact of raw meshes."""
        near = self._near(trajectory)
        rows = near.person.any((1, 2)) | near.cell.any(1) | near.itself.any(1)
        rows |= near.walkers.any((1, 2))
        for index in np.flatnonzero(rows).tolist():
            pairs = self._suspects(_Near(*(part[index] for part in near)))
            contacts = self._ask(trajectory, index, pairs)
            if contacts:
                return FirstContact(index=index, contacts=contacts)
        return None

    def _near(self, trajectory: Trajectory) -> _Near:
        """Return the pairs of capsules nearer than MARGIN, per row of the trajectory."""
        cell, radius = self._cell, self._capsules.radius
        a0, a1 = robot_ends(self._robot, self._capsules, trajectory.q_robot)
        ends = np.stack(
            [
                human.capsules(q, trajectory.size(row, cell), cell.floor_z)
                for row, q in enumerate(trajectory.q_human)
            ]
        )
        thick = human.capsule_radii(trajectory.size(0, cell))
        gap = segment_distances(
            a0[:, :, None], a1[:, :, None], ends[:, None, :, 0], ends[:, None, :, 1]
        )
        near_person = gap < radius[:, None] + thick + MARGIN
        near_cell = np.minimum(a0[..., 2], a1[..., 2]) < radius + MARGIN
        for box in cell.obstacles:
            away = np.linalg.norm(0.5 * (a0 + a1) - box.center, axis=-1)
            half = 0.5 * np.linalg.norm(a1 - a0, axis=-1) + np.linalg.norm(box.half_size)
            near_cell |= away < half + radius + MARGIN
        i, j = self._self_pairs.T
        gap = segment_distances(a0[:, i], a1[:, i], a0[:, j], a1[:, j])
        near_self = gap < radius[i] + radius[j] + MARGIN
        return _Near(near_person, near_cell, near_self, self._near_walkers(trajectory, a0, a1))

    def _near_walkers(self, trajectory: Trajectory, a0: Vec, a1: Vec) -> Pairs:
        """Return the pairs of capsules and cylinders near each other in plan view."""
        flat, walkers = np.array([1.0, 1.0, 0.0]), trajectory.walkers
        axes = (walkers * flat)[:, None]
        gap = segment_distances((a0 * flat)[:, :, None], (a1 * flat)[:, :, None], axes, axes)
        return np.asarray(
            gap < self._capsules.radius[:, None] + walkers[:, None, :, 2] + MARGIN
        )

    def _suspects(self, near: _Near) -> set[tuple[str, str, Kind]]:
        """Return the pairs of bodies of one row that are checked on meshes."""
        body_of = self._body_of
        pairs: set[tuple[str, str, Kind]] = set()
        for capsule, part in np.argwhere(near.person):
            pairs.add((body_of[capsule], human.CAPSULE_NAMES[part], "human"))
        for capsule, who in np.argwhere(near.walkers):
            pairs.add((body_of[capsule], walker_name(int(who)), "human"))
        for capsule in np.flatnonzero(near.cell):
            if body_of[capsule] != LINK_NAMES[0]:
                pairs |= {(body_of[capsule], body, "cell") for body in self._standing}
        for i, j in self._self_pairs[near.itself]:
            pairs.add((body_of[i], body_of[j], "self"))
        return pairs

    def _ask(
        self, trajectory: Trajectory, row: int, pairs: set[tuple[str, str, Kind]]
    ) -> tuple[MeshContact, ...]:
        if not pairs:
            return ()
        self._reference.place_robot(trajectory.q_robot[row])
        if any(kind == "human" for _, _, kind in pairs):
            size = trajectory.size(row, self._cell)
            self._reference.place_person(trajectory.q_human[row], size)
            self._reference.place_walkers(trajectory.walkers[row])
        order = sorted(pairs, key=lambda pair: (BODY_NAMES.index(pair[0]), pair[1]))
        return tuple(
            MeshContact(kind=kind, link=link, body=body)
            for link, body, kind in order
            if self._reference.touching(link, body)
        )
