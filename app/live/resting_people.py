"""A live robot beside people at rest: blocked targets are left out, and a planner acts."""

from collections.abc import Sequence

import numpy as np

from app.live.arm import LiveArm
from app.live.people.workers import LiveWorkers
from app.sim.core.arrays import Vec
from app.sim.pick.batch import target_configurations
from app.sim.pick.resting_people import REST_S, PickTarget, RestingPeoplePlanner
from app.sim.pick.task_policy import Candidate, Decision, TaskPolicy
from app.sim.robot.trajectory_segment import TrajectorySegment


class RestingPeopleControl:
    """Candidates and planned action of the next period."""

    def __init__(self, robot: LiveArm) -> None:
        self._robot = robot
        self.reset()

    def reset(self) -> None:
        """Set the time for which people have been at rest to zero."""
        self._planner = RestingPeoplePlanner(self._robot.arm)
        self._rested = False
        self.act: Vec | None = None
        """The action, a straight motion (``LiveArm.segment``), shape (5,); None: the policy
        acts."""

    def message(self, goal: str) -> str | None:
        """Return how the robot moves to ``goal`` beside people at rest; None: by the policy."""
        if self.act is not None:
            return f"Moving to {goal} on a planned path: nobody has moved for {REST_S:.0f} s."
        return f"Waiting: a person at rest blocks {goal}." if self._planner.blocked else None

    def unblocked(
        self,
        people: LiveWorkers,
        policy: TaskPolicy | None,
        candidates: tuple[Candidate, ...],
        begun: str | None = None,
    ) -> tuple[Candidate, ...]:
        """Return the candidates that people at rest do not block; all where nobody is at rest.

        The candidate ``begun``, whose pick has begun, stays.
        """
        if not self._rested or policy is None or len(candidates) < 2:
            return candidates
        points = np.array([one.position for one in candidates])
        over, low, _ = target_configurations(self._robot.arm, policy.grasp, points)
        names = [one.id for one in candidates]
        place = names.index(begun) if begun in names else None
        shapes = self._robot.shapes(people)
        left = self._planner.offered(shapes, policy.grasp, over, low, place)
        return tuple(one for one, is_left in zip(candidates, left, strict=True) if is_left)

    def update(
        self,
        people: LiveWorkers,
        policy: TaskPolicy | None,
        decision: Decision | None,
        offered: Sequence[Candidate],
        phase: int,
    ) -> None:
        """Plan once per period.

        Args:
            people: The people in the cell; without any the policy acts.
            policy: The policy in whose place the planner acts where it picks objects up.
            decision: Its last decision; None: no target, or the policy acts.
            offered: The candidates of this decision.
            phase: Phase of the pick.
        """
        speeds = [float(np.abs(one.as_observed().qd).max()) for one in people]
        self._rested, self.act = self._planner.note(max(speeds, default=np.inf)), None
        self._rested &= policy is not None and policy.grasp.depth > 0.0
        if not self._rested or policy is None or decision is None:
            return
        robot, grasp = self._robot, policy.grasp
        point = offered[decision.index].position[None]
        over, low, _ = target_configurations(robot.arm, grasp, point)
        target = PickTarget(q_over=over[0], q_grasp=low[0], phase=phase)
        self.act = self._planner.act(robot.q, robot.qd, robot.shapes(people), target, grasp)

    def segment(self, decision: Decision) -> TrajectorySegment:
        """Return the planned motion of the next period, or that of a decision."""
        if self.act is not None:
            return self._robot.segment(self.act, straight=True)
        act = np.asarray(decision.actions[decision.index], dtype=np.float64)
        return self._robot.segment(act)
