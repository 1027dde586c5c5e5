"""Planned motion beside people at rest, in place of a pick policy's.

A learned policy waits beside a person who stands still close to its target, because the person
may move again. Where all people have been at rest for ``REST_S``, blocked targets are not
offered while another is free, and a motion planner (``planning/replanning.py``) moves the robot
around the people through the phases of the pick. It brakes where a person enters its path. As
soon as a person moves, the policy acts again.

Source: ours; docs/method.md 3.1.
"""

from dataclasses import dataclass, field

import numpy as np

from app.sim.collision.checker import Checker, Shapes
from app.sim.core.arrays import Vec
from app.sim.pick.batch import Flags
from app.sim.pick.kernels.grasp import DESCEND, GraspRules
from app.sim.planning.ompl_planners import PlanSettings, is_installed
from app.sim.planning.replanning import EXTRA_MARGIN, ReplanningExecutor, ReplanningSettings
from app.sim.robot.kernels.arm import CONTROLLED, Arm

REST_S = 3.0
"""Time at rest after which a planner moves the robot [s]; about 3 % of the rests of working
people at a cube or dock are longer (docs/people.md)."""
AT_REST = 0.1
"""Greatest joint speed of a person at rest [m/s, rad/s]."""
MAX_POSES = 3000
"""Configurations that one plan may check; it then takes at most about 50 ms."""
MOVING = ("following", "arrived")
"""States of the executor in which its motion is used."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PickTarget:
    """Target of a pick as configurations of the robot."""

    q_over: Vec
    """Joint positions over the object [rad], shape (6,)."""
    q_grasp: Vec
    """Joint positions at the object [rad], shape (6,)."""
    phase: int
    """Phase of the pick (``kernels/grasp.py``)."""

    @property
    def q(self) -> Vec:
        """Joint positions that the phase asks for [rad], shape (6,)."""
        return self.q_grasp if self.phase == DESCEND else self.q_over


@dataclass(slots=True)
class RestingPeoplePlanner:
    """Moves one robot while all people are at rest; :meth:`note` is called in every period.

    ``people`` are those of this moment. ``q_over`` and ``q_grasp`` are joint positions over the
    objects of n targets and at them [rad], shape (n, 6).
    """

    arm: Arm
    """Robot in its cell."""
    blocked: bool = False
    """Whether people at rest block the target of the last :meth:`act`."""
    _rest_s: float = 0.0
    _t: float = 0.0
    _goal: Vec = field(default_factory=lambda: np.full(6, np.nan))
    _executor: ReplanningExecutor | None = None
    _beside: tuple[bytes, bytes, float] = (b"", b"", 0.0)
    """People and least clearance [m] of the answers."""
    _free: dict[bytes, bool] = field(default_factory=dict)
    """Answers of :meth:`free` beside these people."""

    def note(self, speed: float) -> bool:
        """Note one control period; return whether people have been at rest for ``REST_S``.

        Args:
            speed: Greatest joint speed of all people [m/s, rad/s]; inf without people.
        """
        self._t += self.arm.dt
        self._rest_s = self._rest_s + self.arm.dt if speed <= AT_REST else 0.0
        if self._rest_s < REST_S - 1e-9 or not is_installed():
            self._executor, self.blocked = None, False
            return False
        return True

    def free(self, people: Shapes, grasp: GraspRules, q_over: Vec, q_grasp: Vec) -> Flags:
        """Return which targets are as far from people as a grasp demands, shape (n,).

        Args:
            people: People at this moment.
            q_over: Joint positions over the objects [rad], shape (n, 6).
            q_grasp: Joint positions at the objects [rad], shape (n, 6).
        """
        least = grasp.start_clearance
        beside = people.capsules.tobytes(), people.cylinders.tobytes(), least
        if beside != self._beside:
            self._beside, self._free = beside, {}
        found = np.empty(len(q_over), dtype=np.bool_)
        for k, pair in enumerate(zip(q_over, q_grasp, strict=True)):
            key = b"".join(at.tobytes() for at in pair)
            if key not in self._free:
                checker = Checker(self.arm, people, least)
                self._free[key] = all(checker.is_free(at) for at in pair)
            found[k] = self._free[key]
        return found

    def offered(
        self, people: Shapes, grasp: GraspRules, q_over: Vec, q_grasp: Vec, begun: int | None
    ) -> Flags:
        """Return which targets a policy may choose, shape (n,).

        Those that are free, and the one whose pick has begun; all where none is left.

        Args:
            people: People at this moment.
            q_over: Joint positions over the objects [rad], shape (n, 6).
            q_grasp: Joint positions at the objects [rad], shape (n, 6).
            begun: Index of the target whose pick has begun; None: of no target.
        """
        left = self.free(people, grasp, q_over, q_grasp)
        if begun is not None:
            left[begun] = True
        return left if left.any() else np.ones_like(left)

    def act(
        self, q: Vec, qd: Vec, people: Shapes, target: PickTarget, grasp: GraspRules
    ) -> Vec | None:
        """Return the action of a planned motion, shape (5,); None: the policy acts.

        There is none where the target is closer to people than a grasp permits, and where no
        path was found.

        Args:
            q: Joint positions [rad], shape (6,).
            qd: Joint speeds [rad/s], shape (6,).
            target: Target and phase of the pick.
        """
        free = self.free(people, grasp, target.q_over[None], target.q_grasp[None])
        self.blocked = not free[0]
        if self.blocked:
            self._executor = None
            return None
        if self._executor is None or not np.array_equal(target.q, self._goal):
            settings = ReplanningSettings(
                role="replan-on-blocked",
                plan=PlanSettings(max_poses=MAX_POSES),
                margin=grasp.start_clearance - EXTRA_MARGIN,
            )
            self._goal = target.q.copy()
            self._executor = ReplanningExecutor(self.arm, self._goal[None], settings)
        speeds = self._executor.act(q, qd, people, self._t)
        if self._executor.state not in MOVING:
            return None
        return np.asarray((speeds / self.arm.limits.qd_max)[:CONTROLLED])
