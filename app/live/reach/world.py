"""Live reach world: the robot moves from goal to goal beside walking people.

A reached goal is replaced by another (``jump``) or stays until a visitor drags it (``follow``).
Every goal has a time limit; a goal that times out is counted and tried again. The robot does
not return home in between: goals follow each other from its present configuration, and goals
may move, neither of which is part of training.

The longer time limit of docs/method.md 2.6 holds while the safety layer is enabled.

Source: docs/method.md 2.1 to 2.3, 2.6, 2.7.
"""

from dataclasses import replace

import numpy as np

from app.live import status_messages
from app.live.arm import HumanGeometry
from app.live.base_world import BaseWorld
from app.live.command_checks import Command, check_inference_mode
from app.live.commands import PeopleCommand, SetPolicy, SetSafety
from app.live.people.pedestrians import LivePedestrians
from app.live.reach import commands as reach_commands
from app.live.reach import explanation
from app.live.reach.controller import TIME_LIMIT_S, ReachController
from app.live.reach.goal import LiveGoal
from app.live.reach.interfaces import LiveReachPolicy
from app.live.reach.snapshot import ReachCounters, ReachSnapshot
from app.live.read_model import frozen
from app.live.snapshot import Status, WorldSnapshot
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR
from app.sim.reach.batch import DEFAULT_ACTION
from app.sim.robot.trajectory_segment import TrajectorySegment
from app.sim.scenario.kernels.episode import SUCCESS_DISTANCE

LONG_LIMIT_S = 25.0
"""Time limit of a goal with the safety layer [s] (docs/method.md 2.6)."""
REACHED_S = 0.5
"""Time for which a reached goal is shown [s]."""
LEFT_M = 0.02
"""Distance beyond the tolerance from which the robot follows a dragged goal [m]."""


class LiveReachWorld(BaseWorld[LivePedestrians]):
    """One live reach cell.

    Args:
        cell: Cell with a goal region, see ``reach_commands.lacks_for_reaching``.
        policy: Moves the robot; None: straight motion in joint space.
        seed: Seed of goals and walks.
    """

    def __init__(
        self, cell: Cell, policy: LiveReachPolicy | None, seed: int, id: str = "main"
    ) -> None:
        super().__init__(cell, None, id, LivePedestrians(cell, seed))
        self._goal = LiveGoal(cell, seed)
        self._controller = ReachController(cell, None)
        self._change_policy(policy)
        self._reset()
        self._plan()

    # Starts and ends.

    def _reset_scenario(self) -> None:
        self._counts, self.decided_s = ReachCounters(), None
        self.people.robot_q = self.robot.home
        self.people.restart()
        self._goal.restart()

    def _begin(self, status: Status = "moving") -> None:
        self.enter(status)
        self.time_left = LONG_LIMIT_S if self.safety.on else TIME_LIMIT_S

    # Commands.

    def _change_people(self, command: PeopleCommand) -> None:
        self.people.robot_q = self.robot.q
        super()._change_people(command)

    def _change(self, command: Command) -> None:
        match command:
            case reach_commands.MoveGoal():
                self._goal.put(command.position)
                self._follow_goal()
            case reach_commands.NewGoal():
                self._goal.jump()
                self._follow_goal()
            case reach_commands.SetGoalMode():
                self._goal.mode = command.mode
            case reach_commands.SetInferenceMode():
                check_inference_mode(command.inference_mode, self._controller.inference_modes)
                self._controller.inference_mode = command.inference_mode
                self._goal.among = self._goals_drawn()
            case reach_commands.SetWalkingSpeed():
                self.people.set_speed(command.speed)
            case SetPolicy():
                self._change_policy(command.loaded)
                self._follow_goal()
            case _:
                pass

    def _change_policy(self, policy: LiveReachPolicy | None) -> None:
        self._controller.use(policy)
        self.robot.action = DEFAULT_ACTION if policy is None else policy.action
        self.decided_s = None
        self._goal.among = self._goals_drawn()

    def _change_safety(self, command: SetSafety) -> None:
        super()._change_safety(command)
        self._follow_goal()

    def _goals_drawn(self) -> Vec | None:
        """Return the goals to draw from: the policy's training targets, or None for any."""
        policy, mode = self._controller.policy, self._controller.inference_mode
        return None if policy is None or "interpolated" in mode else policy.targets

    def _follow_goal(self) -> None:
        """Restart the time limit, unless the robot is at the goal or cannot move."""
        if self.status == "moving" or (
            self.status == "reached" and self._distance() > SUCCESS_DISTANCE + LEFT_M
        ):
            self._begin()

    # Time.

    def _move_robot(self, before: HumanGeometry) -> None:
        if self.follow_plan(before):
            return
        if self.status == "moving":
            self._end_motion()
        elif self.status_s >= REACHED_S and self._goal.mode == "jump":
            self._goal.jump()
            self._begin()

    def _end_motion(self) -> None:
        """Count the period; end the motion at the goal or at the time limit."""
        self.safety.count(self.robot.dt)
        self.time_left -= self.robot.dt
        if self._distance() < SUCCESS_DISTANCE:
            self.count(reached=1)
            took = self._counts.reaching_s + self.status_s
            self._counts = replace(self._counts, reaching_s=took)
            self.enter("reached")
        elif self.time_left <= 0.0:
            self.count(timeouts=1)
            self._begin()

    def _distance(self) -> float:
        """Return the distance of the tcp to the goal [m]."""
        return float(np.linalg.norm(self.robot.tcp() - self._goal.position))

    # Deciding.

    def _wanted(self) -> TrajectorySegment:
        robot = self.robot
        if self.status != "moving":
            return robot.segment(np.zeros(6), straight=True)
        act = self._controller.act(
            robot,
            self.people.rows,
            self._goal.position,
            FAR if robot.clearance_m is None else robot.clearance_m,
            min(self.time_left, TIME_LIMIT_S),
            self.status_s,
            self.safety.settings if self.safety.on else None,
        )
        self.decided_s = self.t
        return robot.segment(act)

    # Read model.

    def _message(self, view: ReachSnapshot) -> str:
        if self.status == "contact" and self.contact is not None:
            return status_messages.contact_message(self.contact, final=False)
        has_policy = self._controller.policy is not None
        return explanation.motion(
            self.status,
            view,
            self.safety.snapshot(self.people.ids),
            has_policy=has_policy,
            n_people=len(self.people),
        )

    def snapshot(self) -> WorldSnapshot:
        """Return the read model of the present state."""
        goal, controller = self._goal, self._controller
        view = ReachSnapshot(
            goal=frozen(goal.position),
            goal_mode=goal.mode,
            on_target=goal.on_target,
            distance=self._distance(),
            tolerance=SUCCESS_DISTANCE,
            time_left_s=self.time_left,
            inference_mode=controller.inference_mode,
            inference_modes=controller.inference_modes,
            walk_speed=self.people.speed,
            counters=self._counts,
        )
        known = self._snapshot(self.status, self._message(view), reach=view)
        policy = controller.policy
        if policy is None:
            return known
        return replace(
            known,
            checkpoint=policy.checkpoint,
            policy_title=policy.title,
            observed_people=controller.observed_people,
            elapsed_ms=controller.elapsed_ms,
            outside=controller.outside,
            decided_s=self.decided_s,
        )
