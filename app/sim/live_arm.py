"""The robot of a live cell: where it is, how it moves, what it touches.

One control period at a time: an action through the same kernels as training and their limits,
then a test for contact between the ends of the period too.
"""

import numpy as np

from app.sim import pick
from app.sim.actions import ActionSettings
from app.sim.cells import Cell
from app.sim.contact import Contact, contact, worker_distances
from app.sim.kernels import body, kinematics
from app.sim.live_people import LivePeople
from app.sim.ports import Vec
from app.sim.scene import arm_of, people_of

GAIN = 3.0
"""Joint speed per joint error on the way to a posture [1/s]."""


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

    def touches(self, people: LivePeople) -> bool:
        """Whether it touches anything where it is; the clearance is measured anew."""
        rest = np.zeros(6)
        found = self._test(rest, rest, rest, people, people.q, people.sizes)
        return found.kind != "none"

    def advance(
        self,
        act: Vec,
        people: LivePeople,
        human_q: Vec,
        sizes: Vec,
        *,
        straight: bool = False,
    ) -> Contact:
        """Carry out one action, unless something is touched: then stay at the start.

        Args:
            act: Action in [-1, 1], shape (5,).
            people: The people, as they are at the end of the period.
            human_q: Their joints at its start [m, rad], shape (n, 18).
            sizes: Their sizes then [m], shape (n, N_SIZE).
            straight: Whether the action comes from :meth:`toward`, not from the policy.
        """
        rule = pick.DEFAULT_ACTION if straight else self.action
        piece = pick.step_robot(self.arm, self.q, self.qd, self.qdd, act, rule)
        found = self._test(self.qd, piece.c, piece.d, people, human_q, sizes)
        if found.kind == "none":
            self.q, self.qd, self.qdd = piece.q, piece.qd, piece.qdd
        return found

    def _test(
        self, qd: Vec, c: Vec, d: Vec, people: LivePeople, human_q: Vec, sizes: Vec
    ) -> Contact:
        """Test a period that began with the robot here and the people as they were then."""
        found = contact(
            self.arm,
            self._people._replace(columns=body.capsule_columns(len(people))),
            self.q,
            qd,
            c,
            d,
            (human_q, people.q),
            sizes=(sizes, people.sizes),
        )
        self.clearance_m = found.clearance_m if len(people) else None
        return found

    def distances(self, people: LivePeople) -> dict[int, float]:
        """Return the distance to each person by id [m]."""
        found = worker_distances(
            self.arm,
            self._people._replace(columns=body.capsule_columns(len(people))),
            self.q,
            people.q,
            people.sizes,
        )
        return dict(zip(people.ids, found.tolist(), strict=True))

    def posture_at(self, point: Vec) -> tuple[Vec, bool]:
        """Return the posture with the tool pointing down at a point, and whether it is exact.

        Args:
            point: Where the tcp shall be [m], shape (3,).
        """
        q, arm = np.empty(6), self.arm
        exact = kinematics.ik_vertical(point, arm.tool_length, arm.q_min, arm.q_max, q)
        return q, bool(exact)

    def toward(self, posture: Vec) -> Vec:
        """Return the action that goes straight to a posture, shape (5,)."""
        speed = GAIN * (posture - self.q) / self.arm.qd_max
        return np.asarray(np.clip(speed[:5], -1.0, 1.0))

    def tcp(self) -> Vec:
        """Return the tool centre point [m], shape (3,)."""
        rotations, origins, point = np.empty((7, 3, 3)), np.empty((7, 3)), np.empty(3)
        kinematics.link_poses(self.q, rotations, origins)
        kinematics.tcp_point(rotations, origins, self.arm.tool_length, point)
        return point

    def reached(self, point: Vec) -> bool:
        """Whether the tool is at a point, upright and slow, as the pick scenario asks."""
        return pick.tool_state(self.arm, self.q, self.qd, point)[3]
