"""Robot of a live cell: state, motion of one control period, contact.

Actions pass through the kernels and limits of training; contact is tested over the whole
period.
"""

from typing import NamedTuple, Protocol

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.collision.checker import Shapes
from app.sim.collision.contact import Contact, contact, pedestrian_distances, worker_distances
from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR
from app.sim.human.kernels import kinematics as body
from app.sim.pick import batch as pick
from app.sim.pick.kernels.grasp import ToolState
from app.sim.robot.actions import ActionSettings
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.joints import JointPath
from app.sim.robot.trajectory_segment import TrajectorySegment
from app.sim.scene.scene import arm_of, capsule_speeds_of, people_geometry_of, people_of

GAIN = 3.0
"""Proportional gain from joint error to joint speed [1/s]."""


class HumanGeometry(NamedTuple):
    """Collision geometry of people at one time."""

    q: Vec
    """Joint positions of workers [m, rad], shape (W, 18)."""
    qd: Vec
    """Joint speeds of workers [m/s, rad/s], shape (W, 18)."""
    sizes: Vec
    """Body lengths of workers [m], shape (W, N_SIZE)."""
    cylinders: Vec
    """x, y and radius of cylinders [m], shape (C, 3)."""
    velocities: Vec
    """vx, vy and growth of the radius of cylinders [m/s], shape (C, 3)."""


class PeopleInCell(Protocol):
    """The people of a live cell, workers first."""

    @property
    def ids(self) -> tuple[int, ...]:
        """Ids of the people, ascending."""

    @property
    def geometry(self) -> HumanGeometry:
        """Their collision geometry."""


class LiveArm:
    """State of the robot: joint positions, speeds and accelerations.

    Args:
        action: Meaning of the actions of its policy.
    """

    def __init__(self, cell: Cell, action: ActionSettings) -> None:
        self.arm = arm_of(cell)
        """Robot as kernels use it."""
        self.clearance_m: float | None = None
        """Separation distance at the last contact test [m]; None without people."""
        self.action = action
        """Interpretation of the actions of its policy."""
        self._people = people_of(cell)
        self.place(self.home)

    @property
    def home(self) -> Vec:
        """Home configuration [rad], shape (6,)."""
        return self.arm.home.copy()

    @property
    def dt(self) -> float:
        """Control period [s]."""
        return float(self.arm.dt)

    def place(self, q: Vec) -> None:
        """Set the configuration to ``q`` [rad], shape (6,), at rest."""
        self.q, self.qd, self.qdd = q, np.zeros(6), np.zeros(6)

    def halt(self) -> None:
        """Set speeds and accelerations to 0, as after a contact."""
        self.qd, self.qdd = np.zeros(6), np.zeros(6)

    def in_contact(self, people: PeopleInCell) -> bool:
        """Return whether the robot is in contact; updates the separation distance."""
        rest, here = np.zeros(6), people.geometry
        return self._test(rest, rest, rest, here, here).kind != "none"

    def segment(self, act: Vec, *, straight: bool = False) -> TrajectorySegment:
        """Return the trajectory segment of an action in the next period.

        Args:
            act: Action in [-1, 1], shape (5,) or (6,).
            straight: Whether the action is a share of the joint speeds, whatever the policy's
                actions mean.
        """
        rule = pick.DEFAULT_ACTION if straight else self.action
        return pick.step_robot(self.arm, self.q, self.qd, self.qdd, act, rule)

    def follow(
        self, segment: TrajectorySegment, people: PeopleInCell, before: HumanGeometry
    ) -> Contact:
        """Execute a trajectory segment; on contact the state stays that of the start."""
        found = self._test(self.qd, segment.c, segment.d, before, people.geometry)
        if found.kind == "none":
            self.q, self.qd, self.qdd = segment.q, segment.qd, segment.qdd
        return found

    def _test(
        self, qd: Vec, c: Vec, d: Vec, before: HumanGeometry, after: HumanGeometry
    ) -> Contact:
        """Test the period from the present state for contact."""
        found = contact(
            self.arm,
            self._people._replace(capsules=body.new_body_capsules(len(after.q))),
            JointPath(self.q, qd, c, d),
            (before.q, after.q),
            (before.cylinders, after.cylinders),
            sizes=(before.sizes, after.sizes),
        )
        anybody = len(after.q) + len(after.cylinders) > 0
        self.clearance_m = found.clearance_m if anybody else None
        return found

    def shapes(self, people: PeopleInCell) -> Shapes:
        """Return the people as shapes, for the safety layer."""
        here = people.geometry
        capsules = body.new_body_capsules(len(here.q))
        shared = self._people._replace(capsules=capsules)
        geometry = people_geometry_of(shared, here.q, here.cylinders, here.sizes)
        top = np.full((len(here.cylinders), 1), self._people.top_z)
        return Shapes(
            capsules=geometry.capsules,
            cylinders=np.hstack([here.cylinders, top]),
            going=here.velocities,
            speed=capsule_speeds_of(shared, geometry, here.q, here.qd),
        )

    def distances(self, people: PeopleInCell) -> dict[int, float]:
        """Return the distance to each person by id [m]."""
        here = people.geometry
        shared = self._people._replace(capsules=body.new_body_capsules(len(here.q)))
        found = [
            *worker_distances(self.arm, shared, self.q, here.q, here.sizes).tolist(),
            *pedestrian_distances(self.arm, shared, self.q, here.cylinders).tolist(),
        ]
        return dict(zip(people.ids, found, strict=True))

    def configuration_at(self, point: Vec) -> tuple[Vec, bool]:
        """Return the configuration with vertical tool at a point, and whether it is exact.

        Args:
            point: Target of the tcp [m], shape (3,).
        """
        q, arm = np.empty(6), self.arm
        exact = kinematics.ik_vertical(arm.lengths, arm.limits, point, q)
        return q, bool(exact)

    def toward(self, target: Vec) -> Vec:
        """Return the action straight to a configuration [rad], joint by joint, shape (5,)."""
        speed = GAIN * (target - self.q) / self.arm.limits.qd_max
        return np.asarray(np.clip(speed[:5], -1.0, 1.0))

    def tcp(self) -> Vec:
        """Return the tool centre point [m], shape (3,)."""
        rotations, origins, point = np.empty((7, 3, 3)), np.empty((7, 3)), np.empty(3)
        kinematics.link_poses(self.arm.lengths, self.q, rotations, origins)
        kinematics.tcp_point(self.arm.lengths, rotations, origins, point)
        return point

    def tool(self, point: Vec) -> ToolState:
        """Return the tool and the separation distance, for the phases of a pick.

        Args:
            point: Target of the tool [m], shape (3,).
        """
        _, tilt, speed, _ = pick.tool_state(self.arm, self.q, self.qd, point)
        clearance = FAR if self.clearance_m is None else self.clearance_m
        return ToolState(self.tcp(), tilt, speed, clearance)

    def reached(self, point: Vec) -> bool:
        """Return whether the tool is at a point [m], shape (3,), vertical and slow."""
        return pick.tool_state(self.arm, self.q, self.qd, point)[3]
