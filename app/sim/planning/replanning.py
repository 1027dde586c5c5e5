"""Replanning executors: planners in three roles, in place of a policy (docs/method.md 2.6).

``plan-once`` plans among the people at their initial positions and follows that path; only a
safety layer slows it down. ``replan-on-blocked`` checks the rest of its path periodically;
where people are nearer to it than the margin it brakes along the path, plans again from the
point at which it comes to rest, and switches to the new path when ready. ``replan-every-cycle``
plans again every period within a small budget, and switches where its path is blocked or the
new one is shorter.

Planning takes time: a path planned at ``t`` is used from ``t`` plus the budget on (at least one
period), and checked again among the people at that time. The first plan is free of charge: the
robot is at rest and the episode has not begun. New paths begin where a straight stop from the
current state ends; the timed motion turns toward them without standing still where possible
(``time_parameterization.py``). Without a plan the robot brakes to rest, and the report says so.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from app.errors import InvalidInput
from app.sim.collision.checker import Checker, Shapes
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.planning.ompl_planners import MotionPlan, PlanSettings, plan
from app.sim.planning.path_tracking import PathFollower, straight_stop
from app.sim.planning.time_parameterization import stopping_point, time_free_path
from app.sim.robot.kernels import acceleration_bounds
from app.sim.robot.kernels.arm import Arm
from app.sim.robot.kernels.joints import JointState

REPLAN_BUDGET_S = {"plan-once": 0.0, "replan-on-blocked": 0.2, "replan-every-cycle": 0.02}
"""Budget of later plans by role [s]; ours."""
ROLES = tuple(REPLAN_BUDGET_S)
REDUCTION = 0.005
"""Reduction of the margin below the current clearance, if that is below the margin [m], so that
the robot can leave."""
EXTRA_MARGIN = 0.02
"""Distance beyond the margin in plans [m], so that new paths are not blocked."""
CHECK_EVERY_S = 0.1
"""Interval at which ``replan-on-blocked`` checks the rest of its path [s]."""
BETTER_SHARE = 0.05
"""Least share of the time left that a new path saves in ``replan-every-cycle``."""
ARRIVED_RAD = 1e-3
"""Largest joint distance to the end of the path at arrival [rad]."""
LOST_RAD = 0.1
"""Joint distance from the path that counts as lost [rad]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplanningSettings:
    """Settings of a replanning executor."""

    role: str = "plan-once"
    """One of ROLES."""
    plan: PlanSettings = field(default_factory=PlanSettings)
    """Settings of the first plan."""
    margin: float = 0.05
    """Distance at which people block the path [m]."""


class ReplanningExecutor:
    """Planner with the interface of a policy: state and people in, target joint speeds out.

    In all methods ``q`` and ``qd`` are joint positions [rad] and speeds [rad/s], shape (6,),
    ``people`` those of this moment, and ``t`` is the time since the start [s].

    Args:
        arm: From ``scene.arm_of``.
        goals: Goal configurations, of which one is to be reached [rad], shape (k, 6).
        settings: Role, margins, budgets.
        seed: Seed of the first plan; each later one adds 1.

    Raises:
        InvalidInput: The role is not known.
    """

    def __init__(
        self, arm: Arm, goals: Vec, settings: ReplanningSettings, seed: int = 1
    ) -> None:
        if settings.role not in ROLES:
            raise InvalidInput("role", settings.role, "is not known", ROLES)
        self.arm, self.goals, self.settings, self.seed = arm, goals, settings, seed
        self.state = "waiting"
        """``waiting`` (no plan, at rest or braking), ``following``, ``braking`` (path
        blocked), ``arrived``, or ``lost`` (farther from the path than LOST_RAD, braking)."""
        self.outcome = ""
        """Outcome of the last plan, one of ``ompl_planners.OUTCOMES``."""
        self.n_plans = 0
        """Number of plans."""
        self.error_rad = 0.0
        """Greatest distance from the path so far [rad]."""
        self.path_follower: PathFollower | None = None
        self.blocked = False
        self.pending: tuple[float, MotionPlan] | None = None
        self.next_check = -math.inf

    def act(self, q: Vec, qd: Vec, people: Shapes, t: float) -> Vec:
        """Return the target joint speeds after this period [rad/s], shape (6,)."""
        if self.n_plans == 0:
            first = self.plan_from(people, stopping_point(q, qd, self.arm), self.settings.plan)
            self.turn_to(first, q, qd, people)
        if self.path_follower is not None:
            self.path_follower.locate(q)
            self.error_rad = max(self.error_rad, self.path_follower.error_rad)
        if self.settings.role == "replan-on-blocked" and self.state != "arrived":
            self._replan_on_blocked(q, qd, people, t)
        elif self.settings.role == "replan-every-cycle" and self.state != "arrived":
            self._replan_every_cycle(q, qd, people, t)
        return self._order(q, qd)

    def plan_from(self, people: Shapes, start: Vec, settings: PlanSettings) -> MotionPlan:
        """Plan from a configuration at rest [rad], shape (6,), among the current people."""
        checker = self.checker(people, start, self.settings.margin + EXTRA_MARGIN)
        answer = plan(checker, start, self.goals, settings, self.seed + self.n_plans)
        self.outcome = answer.outcome
        self.n_plans += 1
        return answer

    def replan(self, people: Shapes, q: Vec, qd: Vec, t: float) -> None:
        """Plan from the end of a straight stop; the plan is used after the budget."""
        budget = REPLAN_BUDGET_S[self.settings.role]
        later = replace(self.settings.plan, budget_s=budget)
        answer = self.plan_from(people, stopping_point(q, qd, self.arm), later)
        if answer.solved:
            self.pending = (t + max(budget, self.arm.dt), answer)

    def checker(self, people: Shapes, q: Vec, margin: float) -> Checker:
        """Return the checker for a margin [m], reduced where the robot is nearer to people."""
        clearance = Checker(self.arm, people).clearance(q).people_m
        return Checker(self.arm, people, max(0.0, min(margin, clearance - REDUCTION)))

    def is_blocked(self, people: Shapes, q: Vec) -> bool:
        """Return whether people are nearer to the rest of the path than the margin."""
        if self.path_follower is None:
            return True
        checker = self.checker(people, q, self.settings.margin)
        timed, first = self.path_follower.timed, self.path_follower.period
        return checker.first_blocked(timed.q, timed.qd, first) < timed.n_periods

    def turn_to(
        self, answer: MotionPlan, q: Vec, qd: Vec, people: Shapes, within_s: float = math.inf
    ) -> bool:
        """Follow a plan from the present state if its motion is free and short enough.

        Args:
            answer: Plan from the configuration where the robot was to stop.
            within_s: Longest duration of the motion [s].
        """
        if not answer.solved:
            return False
        stop = stopping_point(q, qd, self.arm)
        checker = self.checker(people, stop, self.settings.margin)
        for rest in (answer.path[1:], answer.path):
            path = np.vstack([stop, rest])
            if checker.path_free(path):
                timed = time_free_path(checker, path, qd)
                if timed is None or timed.duration > within_s:
                    return False
                self.path_follower, self.blocked = PathFollower(timed, self.arm), False
                return True
        return False

    def _order(self, q: Vec, qd: Vec) -> Vec:
        """Return the target speeds for the present state of the executor."""
        path_follower = self.path_follower
        if path_follower is None:
            self.state = "waiting"
            return straight_stop(qd, self.arm)
        if path_follower.error_rad > LOST_RAD:
            self.state, self.path_follower = "lost", None
            return straight_stop(qd, self.arm)
        near = float(np.abs(q - path_follower.timed.q[-1]).max()) <= ARRIVED_RAD
        if near and float(np.abs(qd).max()) <= ARRIVED_RAD:
            self.state = "arrived"
        else:
            self.state = "braking" if self.blocked else "following"
        return path_follower.target_speeds(q, qd, brake=self.state == "braking")

    def _replan_on_blocked(self, q: Vec, qd: Vec, people: Shapes, t: float) -> None:
        """Check the rest of the path; replan if it is blocked."""
        if self.pending is not None and t >= self.pending[0] - 1e-9:
            answer, self.pending = self.pending[1], None
            if self.blocked or self.path_follower is None:
                self.turn_to(answer, q, qd, people)
        if t < self.next_check - 1e-9:
            return
        self.next_check = t + CHECK_EVERY_S
        self.blocked = self.is_blocked(people, q)
        if self.blocked and self.pending is None:
            self.replan(people, q, qd, t)

    def _replan_every_cycle(self, q: Vec, qd: Vec, people: Shapes, t: float) -> None:
        """Plan for the state after this period; switch to the plan for this one."""
        self.blocked = self.is_blocked(people, q)
        if self.pending is not None and t >= self.pending[0] - 1e-9:
            answer, self.pending = self.pending[1], None
            left = math.inf
            if self.path_follower is not None and not self.blocked:
                left = self.path_follower.remaining * (1.0 - BETTER_SHARE)
            self.turn_to(answer, q, qd, people, left)
        if self.pending is None:
            self.replan(people, *self._after_period(q, qd), t)

    def _after_period(self, q: Vec, qd: Vec) -> tuple[Vec, Vec]:
        """Return positions and speeds after this period without a safety layer."""
        if self.path_follower is None:
            wanted = straight_stop(qd, self.arm)
        else:
            wanted = self.path_follower.target_speeds(q, qd, brake=self.blocked)
        start = JointState(as_kernel_array(q), as_kernel_array(qd), np.zeros(6))
        end, limits, dt = JointState(*np.empty((3, 6))), self.arm.limits, self.arm.dt
        acceleration_bounds.advance_to_speeds(limits, dt, start, wanted, np.empty(6), end)
        return end.q, end.qd
