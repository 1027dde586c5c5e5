"""Motion of a live robot beside people at rest: a planner acts in place of the policy."""

from collections.abc import Sequence

import numpy as np

from app.live.arm import LiveArm
from app.live.people.interfaces import MovingPeople
from app.sim.core.arrays import Vec
from app.sim.pick.batch import target_configurations
from app.sim.pick.resting_people import PickTarget, RestingPeoplePlanner
from app.sim.pick.task_policy import Candidate, Decision, TaskPolicy


class PlannedMotion:
    """Planned action of the next period.

    Args:
        robot: The robot it moves.
    """

    def __init__(self, robot: LiveArm) -> None:
        self._robot = robot
        self.reset()

    def reset(self) -> None:
        """Forget for how long people have been at rest."""
        self._planner = RestingPeoplePlanner(self._robot.arm)
        self.act: Vec | None = None
        """The action, shape (5,); None: the policy acts."""

    def update(
        self,
        people: MovingPeople,
        policy: TaskPolicy | None,
        decision: Decision | None,
        offered: Sequence[Candidate],
        phase: int,
    ) -> None:
        """Plan once per period.

        Args:
            people: The people in the cell; without any the policy acts.
            policy: The policy in whose place the planner acts where it picks objects up.
            decision: Its last decision; None: the robot pursues nothing, or the policy acts.
            offered: The candidates of this decision.
            phase: Phase of the pick.
        """
        speeds = [float(np.abs(one.seen().qd).max()) for one in people]
        rested, robot = self._planner.note(max(speeds, default=np.inf)), self._robot
        self.act = None
        if not rested or policy is None or decision is None or policy.grasp.depth == 0.0:
            return
        grasp, point = policy.grasp, offered[decision.index].position[None]
        over, low, _ = target_configurations(robot.arm, grasp, point)
        target = PickTarget(q_over=over[0], q_grasp=low[0], phase=phase)
        self.act = self._planner.act(robot.q, robot.qd, robot.shapes(people), target, grasp)

    def or_of(self, decision: Decision) -> Vec:
        """Return the planned action, or that of a decision, shape (5,)."""
        if self.act is not None:
            return self.act
        return np.asarray(decision.actions[decision.index], dtype=np.float64)
