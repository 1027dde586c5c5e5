"""Live reach world: the robot moves from goal to goal beside walking people.

A reached goal is replaced by another (``jump``) or stays until a visitor drags it (``follow``).
Every goal has a time limit; a goal that times out is counted and tried again. The robot does
not return home in between: goals follow each other from its present configuration, and goals
may move, neither of which is part of training.

Speed and separation monitoring (docs/method.md 2.7) limits the motion of the policy. It can be
disabled; then a contact is shown for two seconds and the robot starts again from home. Contacts
with a standing robot are counted apart, and the robot waits until the person has moved on. The
longer time limit of docs/method.md 2.6 holds while the safety layer is enabled.

Source: docs/method.md 2.1 to 2.3, 2.6, 2.7.
"""

from dataclasses import replace

import numpy as np

from app.live import status_messages
from app.live.arm import HumanGeometry
from app.live.base_world import BaseWorld
from app.live.command_checks import Command, check_inference_mode
from app.live.commands import PeopleCommand, SetPolicy
from app.live.people.pedestrians import LivePedestrians
from app.live.reach import commands as reach_commands
from app.live.reach import explanation
from app.live.reach.controller import TIME_LIMIT_S, ReachController
from app.live.reach.goal import LiveGoal
from app.live.reach.interfaces import LiveReachPolicy
from app.live.reach.snapshot import ReachCounters, ReachSnapshot, SafetySnapshot
from app.live.read_model import frozen
from app.live.snapshot import Status, WorldSnapshot
from app.sim.cells.cell import Cell
from app.sim.collision.checker import Shapes, no_people
from app.sim.collision.contact import Contact
from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR
from app.sim.people.kernels.pedestrian import GROWTH, VX, VY
from app.sim.robot.trajectory_segment import TrajectorySegment
from app.sim.safety.decision import SafetyDecision, SeparationTerms
from app.sim.safety.layer import SafetyLayer, safety_settings
from app.sim.safety.separation_zone import separation_zone
from app.sim.scenario.kernels.episode import SUCCESS_DISTANCE

LONG_LIMIT_S = 25.0
"""Time limit of a goal with the safety layer [s] (docs/method.md 2.6)."""
REACHED_S = 0.5
"""Time for which a reached goal is shown [s]."""
LEFT_M = 0.02
"""Distance beyond the tolerance from which the robot follows a dragged goal [m]."""
MOVING = 1e-3
"""Joint speed from which the robot counts as moving [rad/s]."""
APART_M = 0.02
"""Separation distance from which a contact at standstill is over [m]."""


class LiveReachWorld(BaseWorld[LivePedestrians]):
    """One live reach cell.

    Args:
        cell: Cell with a goal region, see ``reach_commands.lacks_for_reaching``.
        policy: Moves the robot; None: straight motion in joint space.
        seed: Seed of goals and walks.
        id: Name of the world in URLs.
    """

    def __init__(
        self, cell: Cell, policy: LiveReachPolicy | None, seed: int, id: str = "main"
    ) -> None:
        super().__init__(cell, None, id, LivePedestrians(cell, seed))
        self._goal = LiveGoal(cell, seed)
        self._controller = ReachController(cell, policy)
        self._layer = SafetyLayer(self.robot.arm, safety_settings(cell))
        self._top = cell.floor_z + self.people.height
        self._obeys = True
        self._touching = False
        self._goal.among = self._goals_drawn()
        self._reset()

    # Starts and ends.

    def _reset_scenario(self) -> None:
        self._counts = ReachCounters()
        self.people.robot_q = self.robot.home
        self.people.restart()
        self._goal.restart()

    def _prepare_restart(self) -> None:
        self._touching = False

    def _begin(self, status: Status = "moving") -> None:
        self.enter(status)
        self.time_left = LONG_LIMIT_S if self._obeys else TIME_LIMIT_S
        self._decide()

    def _refresh(self) -> None:
        self._decide()

    def _after_period(self) -> None:
        self._decide()

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
            case reach_commands.SetSafety():
                self._set_safety(command)
            case reach_commands.SetInferenceMode():
                check_inference_mode(command.inference_mode, self._controller.inference_modes)
                self._controller.inference_mode = command.inference_mode
                self._goal.among = self._goals_drawn()
            case reach_commands.SetWalkingSpeed():
                self.people.set_speed(command.speed)
            case SetPolicy():
                self._controller.use(command.loaded)
                self._goal.among = self._goals_drawn()
                self._follow_goal()
            case _:
                pass
        self._decide()

    def _set_safety(self, command: reach_commands.SetSafety) -> None:
        self._obeys, measured = command.on, command.use_measured_velocity
        if measured is not None:
            settings = replace(self._layer.settings, use_measured_velocity=measured)
            self._layer = SafetyLayer(self._layer.arm, settings)
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
        at_standstill = _at_standstill(self.robot.qd) and _at_standstill(self._segment.qd)
        found = self.robot.follow(self._segment, self.people, before)
        if found.kind == "human" and at_standstill:
            self._note_standstill_contact(found)
        elif found.kind != "none":
            self.note_contact(found)
            return
        elif (self.robot.clearance_m or FAR) > APART_M:
            self._touching = False
        if self.status == "moving":
            self._end_motion()
        elif self.status_s >= REACHED_S and self._goal.mode == "jump":
            self._goal.jump()
            self._begin()

    def _note_standstill_contact(self, found: Contact) -> None:
        """Count a contact with the standing robot."""
        self.robot.halt()
        if not self._touching:
            self._counts = replace(self._counts, touched=self._counts.touched + 1)
        self._touching = True

    def _end_motion(self) -> None:
        """Count the period; end the motion at the goal or at the time limit."""
        counts, dt = self._counts, self.robot.dt
        self.time_left -= dt
        override = self._safety.override
        self._counts = replace(
            counts,
            moving_s=counts.moving_s + dt,
            slowed_s=counts.slowed_s + (dt if override < 0.5 else 0.0),
            stopped_s=counts.stopped_s + (dt if override <= 0.0 else 0.0),
        )
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

    def _decide(self) -> None:
        robot, shapes = self.robot, self._shapes()
        if self.status == "moving":
            clear = robot.clearance_m if robot.clearance_m is not None else FAR
            left = min(self.time_left, TIME_LIMIT_S)
            act = self._controller.act(
                robot,
                self.people.rows,
                self._goal.position,
                clear,
                left,
                self.status_s,
                self._layer.settings if self._obeys else None,
            )
            wanted = robot.segment(act, straight=self._controller.policy is None)
        else:
            wanted = robot.segment(np.zeros(6), straight=True)
        filtered = self._layer.decide(robot.q, robot.qd, wanted.c, wanted.d, shapes)
        self._segment = (
            _executed(robot.q, robot.qd, filtered, robot.dt) if self._obeys else wanted
        )
        self._safety = self._safety_view(filtered, shapes)

    def _shapes(self) -> Shapes:
        people = self.people
        top = np.full((len(people), 1), self._top)
        return replace(
            no_people(),
            cylinders=np.hstack([people.cylinders, top]),
            going=people.rows[:, [VX, VY, GROWTH]],
        )

    def _safety_view(self, filtered: SafetyDecision, shapes: Shapes) -> SafetySnapshot:
        """Return the layer's decision with the terms of S_p."""
        layer, robot = self._layer, self.robot
        found = layer.terms(filtered, robot.qd, shapes)
        nearest, terms = (None, None) if found is None else found
        return SafetySnapshot(
            on=self._obeys,
            override=filtered.override if self._obeys else 1.0,
            advised=filtered.override,
            person=None if nearest is None else self.people.ids[nearest],
            link=terms.link if terms else None,
            separation=terms.separation if terms else None,
            required=terms.required if terms else None,
            person_distance=_person_distance(terms) if terms else None,
            robot_distance=terms.robot_speed * terms.reaction_time + terms.braking
            if terms
            else None,
            margin=layer.settings.margin,
            use_measured_velocity=layer.settings.use_measured_velocity,
            human_speed=layer.settings.other_speed,
            stop_time=filtered.stop_time,
            zone=frozen(separation_zone(layer.arm, layer.settings, robot.q, robot.qd)),
        )

    # Read model.

    def _message(self, view: ReachSnapshot) -> str:
        if self.status == "contact" and self.contact is not None:
            return status_messages.touched(self.contact, final=False)
        has_policy = self._controller.policy is not None
        return explanation.doing(
            self.status, view, has_policy=has_policy, n_people=len(self.people)
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
            safety=self._safety,
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
            elapsed_ms=controller.elapsed_ms,
        )


def _person_distance(terms: SeparationTerms) -> float:
    """Return the distance a person covers until the robot has stopped [m]."""
    return terms.human_speed * (terms.reaction_time + terms.stop_time)


def _at_standstill(qd: Vec) -> bool:
    return bool(np.abs(qd).max() < MOVING)


def _executed(q: Vec, qd: Vec, filtered: SafetyDecision, dt: float) -> TrajectorySegment:
    """Return the filtered motion of a period as a trajectory segment with the same ends.

    Within the period it differs from the filtered motion by less than 0.1 mrad.
    """
    c = (filtered.q - q - qd * dt) / dt**2
    return TrajectorySegment(c=c, d=np.zeros(6), q=filtered.q, qd=filtered.qd, qdd=filtered.qdd)
