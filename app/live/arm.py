"""The robot of a live cell: where it is, how it moves, what it touches.

One control period at a time: an action through the same kernels as training and their limits,
then a test for contact between the ends of the period too.
"""

from typing import NamedTuple, Protocol

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.collision.contact import Contact, contact, pedestrian_distances, worker_distances
from app.sim.core.arrays import Vec
from app.sim.human.kernels import kinematics as body
from app.sim.pick import batch as pick
from app.sim.robot.actions import ActionSettings
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.joints import JointPath
from app.sim.robot.trajectory_segment import TrajectorySegment
from app.sim.scene.scene import arm_of, people_of

GAIN = 3.0
"""Joint speed per joint error on the way to a posture [1/s]."""


class HumanGeometry(NamedTuple):
    """Where people are at one moment."""

    q: Vec
    """Joints of those who have some [m, rad], shape (W, 18)."""
    sizes: Vec
    """Their sizes [m], shape (W, N_SIZE)."""
    cylinders: Vec
    """x, y and radius of those who are cylinders [m], shape (C, 3)."""


class PeopleInCell(Protocol):
    """The people of a live cell, workers first."""

    @property
    def ids(self) -> tuple[int, ...]:
        """Ids of the people who are there, in order."""

    @property
    def bodies(self) -> HumanGeometry:
        """Where they are."""


class LiveArm:
    """Posture and speed of the robot.

    Args:
        cell: Work cell.
        action: What the actions of its policy mean.
    """

    def __init__(self, cell: Cell, action: ActionSettings) -> None:
        self.arm = arm_of(cell)
        """What the kernels know of it."""
        self.clearance_m: float | None = None
        """Least distance to people, as last tested [m]; None where nobody is."""
        self.action = action
        """What the actions of its policy mean."""
        self._people = people_of(cell)
        self.put(self.home)

    @property
    def home(self) -> Vec:
        """Home posture [rad], shape (6,)."""
        return self.arm.home.copy()

    @property
    def dt(self) -> float:
        """Control period [s]."""
        return float(self.arm.dt)

    def put(self, q: Vec) -> None:
        """Be at rest at ``q`` [rad], shape (6,)."""
        self.q, self.qd, self.qdd = q, np.zeros(6), np.zeros(6)

    def halt(self) -> None:
        """Stand still at once, as after a contact."""
        self.qd = np.zeros(6)

    def touches(self, people: PeopleInCell) -> bool:
        """Whether it touches anything where it is; the clearance is measured again."""
        rest, here = np.zeros(6), people.bodies
        return self._test(rest, rest, rest, here, here).kind != "none"

    def advance(
        self,
        act: Vec,
        people: PeopleInCell,
        before: HumanGeometry,
        *,
        straight: bool = False,
    ) -> Contact:
        """Carry out one action, unless something is touched: then stay at the start.

        Args:
            act: Action in [-1, 1], shape (5,) or (6,).
            people: The people, as they are at the end of the period.
            before: Where they were at its start.
            straight: Whether the action comes from :meth:`toward`, not from the policy.
        """
        return self.follow(self.piece(act, straight=straight), people, before)

    def piece(self, act: Vec, *, straight: bool = False) -> TrajectorySegment:
        """Return what an action asks for in the period to come; see :meth:`advance`."""
        rule = pick.DEFAULT_ACTION if straight else self.action
        return pick.step_robot(self.arm, self.q, self.qd, self.qdd, act, rule)

    def follow(
        self, piece: TrajectorySegment, people: PeopleInCell, before: HumanGeometry
    ) -> Contact:
        """Carry out a piece of motion, unless something is touched; see :meth:`advance`."""
        found = self._test(self.qd, piece.c, piece.d, before, people.bodies)
        if found.kind == "none":
            self.q, self.qd, self.qdd = piece.q, piece.qd, piece.qdd
        return found

    def _test(
        self, qd: Vec, c: Vec, d: Vec, before: HumanGeometry, after: HumanGeometry
    ) -> Contact:
        """Test a period that began with the robot here and the people as they were then."""
        found = contact(
            self.arm,
            self._people._replace(columns=body.capsule_columns(len(after.q))),
            JointPath(self.q, qd, c, d),
            (before.q, after.q),
            (before.cylinders, after.cylinders),
            sizes=(before.sizes, after.sizes),
        )
        anybody = len(after.q) + len(after.cylinders) > 0
        self.clearance_m = found.clearance_m if anybody else None
        return found

    def distances(self, people: PeopleInCell) -> dict[int, float]:
        """Return the distance to each person by id [m]."""
        here = people.bodies
        shared = self._people._replace(columns=body.capsule_columns(len(here.q)))
        found = [
            *worker_distances(self.arm, shared, self.q, here.q, here.sizes).tolist(),
            *pedestrian_distances(self.arm, shared, self.q, here.cylinders).tolist(),
        ]
        return dict(zip(people.ids, found, strict=True))

    def posture_at(self, point: Vec) -> tuple[Vec, bool]:
        """Return the posture with the tool pointing down at a point, and whether it is exact.

        Args:
            point: Where the tcp shall be [m], shape (3,).
        """
        q, arm = np.empty(6), self.arm
        exact = kinematics.ik_vertical(arm.lengths, arm.limits, point, q)
        return q, bool(exact)

    def toward(self, posture: Vec) -> Vec:
        """Return the action that goes straight to a posture, shape (5,)."""
        speed = GAIN * (posture - self.q) / self.arm.limits.qd_max
        return np.asarray(np.clip(speed[:5], -1.0, 1.0))

    def tcp(self) -> Vec:
        """Return the tool centre point [m], shape (3,)."""
        rotations, origins, point = np.empty((7, 3, 3)), np.empty((7, 3)), np.empty(3)
        kinematics.link_poses(self.arm.lengths, self.q, rotations, origins)
        kinematics.tcp_point(self.arm.lengths, rotations, origins, point)
        return point

    def reached(self, point: Vec) -> bool:
        """Whether the tool is at a point, upright and slow, as the pick scenario asks."""
        return pick.tool_state(self.arm, self.q, self.qd, point)[3]
