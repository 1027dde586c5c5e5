"""Reachability of points of a cell by collision-free configurations.

The robot's capsules are checked against each other (``robot.capsules``), against the table's
plane, which is infinite in the simulator, and against the fixed obstacles, all by python-fcl.

At stations the tool points down (closed form, ``kernels.kinematics``); goals of docs/method.md
2.3 allow any orientation (damped least squares on Pinocchio's Jacobian from several starts).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.collision.fcl_reference import make_capsule, obstacle_box, place_capsule, touch
from app.sim.core.arrays import Vec
from app.sim.robot.capsules import load_robot_capsules, self_pairs
from app.sim.robot.inverse_kinematics import configuration_at
from app.sim.robot.ur10 import LINK_NAMES, Robot, reach_of

SHOULDER_LINK = LINK_NAMES.index("shoulder_link")
"""Links up to this one (base, shoulder) stand on the table and never leave it."""
N_STARTS = 16
"""Random starts of a search."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ContactPair:
    """Contact of a robot capsule with another body."""

    link: str
    """Capsule of the robot."""
    kind: str
    """``self``, ``table`` or ``obstacle``."""
    other: str
    """The other capsule, ``table`` or the obstacle's id."""

    @property
    def text(self) -> str:
        """The contact as text."""
        link = self.link.replace("_", " ")
        if self.kind == "obstacle":
            return f"the robot's {link} touches the obstacle {self.other}"
        other = "the table" if self.kind == "table" else f"its {self.other.replace('_', ' ')}"
        return f"the robot's {link} touches {other}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReachResult:
    """Result of an attempt to reach a point."""

    q: Vec | None
    """Joint positions [rad], shape (6,); None if no configuration was found."""
    reason: str = ""
    """Reason, if none was found."""


class Reach:
    """Search for configurations of the robot in one cell; not thread-safe.

    Args:
        cell: A cell whose robot and obstacles have no faults.
    """

    def __init__(self, cell: Cell) -> None:
        mount = cell.robot
        self._robot = Robot(mount.tool_length)
        self._capsules = load_robot_capsules(mount.tool_length, mount.tool_radius)
        self._pairs = self_pairs(self._capsules).tolist()
        ends = zip(self._capsules.p0, self._capsules.p1, self._capsules.radius, strict=True)
        self._bodies = [make_capsule(float(radius), p0, p1) for p0, p1, radius in ends]
        self._boxes = {one.id: obstacle_box(one) for one in cell.obstacles}
        self._q_min, self._q_max = np.array(mount.q_min), np.array(mount.q_max)
        self._home = np.array(mount.home_q)
        self._shoulder, self._longest = reach_of(self._robot.lengths())

    def contacts(self, q: Vec) -> Iterator[ContactPair]:
        """Yield the contacts of the robot at joint positions ``q`` [rad], shape (6,)."""
        shapes, names = self._capsules, self._capsules.name
        poses = self._robot.link_poses(np.asarray(q, dtype=np.float64))
        for k, body in enumerate(self._bodies):
            pose = poses[shapes.link[k]]
            p0, p1 = (pose[:3, :3] @ end + pose[:3, 3] for end in (shapes.p0[k], shapes.p1[k]))
            place_capsule(body, p0, p1)
            low = min(p0[2], p1[2]) - shapes.radius[k]
            if shapes.link[k] > SHOULDER_LINK and low <= 0.0:
                yield ContactPair(link=names[k], kind="table", other="table")
        for a, b in self._pairs:
            if touch(self._bodies[a], self._bodies[b]):
                yield ContactPair(link=names[b], kind="self", other=names[a])
        for name, box in self._boxes.items():
            for k, body in enumerate(self._bodies):
                if touch(body, box):
                    yield ContactPair(link=names[k], kind="obstacle", other=name)

    def tool_down(self, point: Vec) -> ReachResult:
        """Find the configuration with the tool pointing down at ``point`` [m], shape (3,)."""
        q = self._robot.ik_vertical(point, self._q_min, self._q_max)
        if q is None:
            return ReachResult(q=None, reason=self._why_not(point))
        for found in self.contacts(q):
            return ReachResult(q=None, reason=f"there {found.text}")
        return ReachResult(q=q)

    def _why_not(self, point: Vec) -> str:
        far = float(np.hypot(point[0], point[1]))
        loose = np.full(6, 2.0 * np.pi)
        if self._robot.ik_vertical(point, -loose, loose) is not None:
            return "its configuration is outside the joint limits"
        side = "too far from" if far > 0.6 else "too near to"
        return f"it lies {far:.2f} m from the robot's base, {side} it at that height"

    def any_configuration(self, point: Vec) -> ReachResult:
        """Find any configuration with the tcp at ``point`` [m], shape (3,)."""
        if np.linalg.norm(point - self._shoulder) > self._longest:
            return ReachResult(q=None, reason="it is farther than the arm is long")
        down = self.tool_down(point)
        if down.q is not None:
            return down
        rng = np.random.default_rng(0)
        starts = [self._home, *rng.uniform(self._q_min, self._q_max, (N_STARTS, 6))]
        reason = "no configuration inside the joint limits was found"
        for start in starts:
            q = configuration_at(self._robot, point, start, (self._q_min, self._q_max))
            if q is None:
                continue
            found = next(self.contacts(q), None)
            if found is None:
                return ReachResult(q=q)
            reason = f"every configuration found is in contact: {found.text}"
        return ReachResult(q=None, reason=reason)
