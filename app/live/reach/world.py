"""One live reach cell: the robot goes from goal to goal beside people who walk about.

A goal that is reached is left for another one (``jump``), or stays until somebody drags it away
(``follow``). Every goal has its time limit; what is not reached in time counts and is tried
again. The robot is not brought home in between: goals follow each other from where it is, which
training did not see, and neither did it see goals that move.

Between what the policy wants and what is executed stands the safety layer (METHOD 2.7). It can
be switched off, to see what the policy does alone; then a contact is shown for two seconds and
the robot starts again from home. With the layer nobody is met while the robot moves, inside
its assumptions; whoever walks into it while it stands is counted apart, and it waits until
they have gone on. Since it makes the robot wait, it comes with the longer time of METHOD 2.6.

Source: METHOD 2.1 to 2.3, 2.6, 2.7.
"""

from dataclasses import replace

import numpy as np

from app.errors import InvalidInput
from app.live import commands
from app.live.arm import Bodies
from app.live.base_world import CONTACT_HOLD_S, ClockCommand, LiveStage, PeopleCommand
from app.live.commands import Command
from app.live.people.pedestrians import LiveWalkers
from app.live.people.worker import frozen
from app.live.pick import explanation
from app.live.reach import commands as reach_commands
from app.live.reach import explanation as reach_explanation
from app.live.reach.commands import ReachCommand
from app.live.reach.controller import TIME_LIMIT_S, LiveReacher
from app.live.reach.goal import LiveGoal
from app.live.reach.interfaces import ReachPilot
from app.live.reach.snapshot import ReachCounters, ReachView, SafetyView
from app.live.snapshot import Counters, Status, WorldSnapshot
from app.sim.cells.cell import Cell
from app.sim.collision.checker import Shapes, no_people
from app.sim.collision.contact import Contact
from app.sim.core.arrays import Vec
from app.sim.geometry.segments import FAR
from app.sim.people.kernels.pedestrian import GROWTH, VX, VY
from app.sim.pick.batch import Piece
from app.sim.safety.decision import SafetyDecision, SeparationTerms
from app.sim.safety.layer import SafetyLayer, safety_settings
from app.sim.safety.separation_zone import separation_zone
from app.sim.scenario.kernels.episode import SUCCESS_DISTANCE

LONG_LIMIT_S = 25.0
"""Time to reach a goal while the safety layer is obeyed [s] (METHOD 2.6)."""
REACHED_S = 0.5
"""How long a reached goal is shown before the next one follows [s]."""
LEFT_M = 0.02
"""How far beyond the tolerance a goal is dragged before the robot follows it [m]."""
MOVING = 1e-3
"""Joint speed from which on the robot moves [rad/s]."""
APART_M = 0.02
"""Clearance from which on a touch is over [m]."""


class ReachWorld:
    """One live reach cell; see ``live_world.py``.

    Args:
        cell: Cell with a goal region, see ``reach_commands.lacks_for_reaching``.
        pilot: Moves the robot; None goes straight to the goal's posture.
        seed: Seed of goals and walks.
        id: Name of the world in URLs.
    """

    def __init__(
        self, cell: Cell, pilot: ReachPilot | None, seed: int, id: str = "main"
    ) -> None:
        self.cell, self.id = cell, id
        self._stage = LiveStage(cell, None, id, LiveWalkers(cell, seed))
        self._goal = LiveGoal(cell, seed)
        self._reacher = LiveReacher(cell, pilot)
        self._layer = SafetyLayer(self._stage.robot.arm, safety_settings(cell))
        self._top = cell.floor_z + self._stage.people.height
        self._obeys = True
        self._goal.among = self._goals_drawn()
        self._reset()

    # Starts and ends.

    def _reset(self) -> None:
        stage = self._stage
        stage.t, stage.counters, self._counts = 0.0, Counters(), ReachCounters()
        stage.robot.put(stage.robot.home)
        stage.people.robot_q = stage.robot.q
        stage.people.restart()
        self._goal.restart()
        self._restart_robot()

    def _restart_robot(self) -> None:
        stage = self._stage
        stage.robot.put(stage.robot.home)
        stage.contact, self._touching = None, False
        self._begin("blocked" if stage.touches_here() else "moving")

    def _begin(self, status: Status = "moving") -> None:
        """Give the robot all its time for the goal."""
        stage = self._stage
        stage.enter(status)
        stage.time_left = LONG_LIMIT_S if self._obeys else TIME_LIMIT_S
        self._decide()

    # Commands.

    def apply(self, command: Command) -> None:
        """Carry out one command.

        Raises:
            ServiceError: The command does not fit this cell; nothing has changed.
        """
        stage = self._stage
        commands.check(command, self.cell, stage.people.ids)
        match command:
            case commands.Pause() | commands.Resume() | commands.StepOnce() | commands.Reset():
                self._control_clock(command)
            case _ if isinstance(command, PeopleCommand):
                stage.people.robot_q = stage.robot.q
                stage.change_people(command)
                self._decide()
            case _ if isinstance(command, reach_commands.REACH_COMMANDS):
                self._change(command)
            case _:
                pass

    def _control_clock(self, command: ClockCommand) -> None:
        match command:
            case commands.Pause() | commands.Resume():
                self._stage.paused = isinstance(command, commands.Pause)
            case commands.StepOnce():
                self._stage.paused = True
                self._advance()
            case commands.Reset():
                self._reset()

    def _change(self, command: ReachCommand) -> None:
        """Change goal, safety layer, people's speed or policy."""
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
                self._obeys = command.on
                self._go_by(command.measured)
                self._follow_goal()
            case reach_commands.SetWay():
                check_way(command.way, self._reacher.ways)
                self._reacher.way = command.way
                self._goal.among = self._goals_drawn()
            case reach_commands.SetWalk():
                self._stage.people.set_speed(command.speed)
            case reach_commands.SetPilot():
                self._use(command.pilot)
        self._decide()

    def _use(self, pilot: ReachPilot | None) -> None:
        self._reacher.use(pilot)
        self._goal.among = self._goals_drawn()
        self._follow_goal()

    def _go_by(self, measured: bool | None) -> None:
        """Let the safety layer go by measured velocities or not; None leaves it."""
        if measured is not None:
            settings = replace(self._layer.settings, use_measured_velocity=measured)
            self._layer = SafetyLayer(self._layer.arm, settings)

    def _goals_drawn(self) -> Vec | None:
        """Return the goals to draw from: those the policy was trained on, or None for any."""
        pilot, way = self._reacher.pilot, self._reacher.way
        return None if pilot is None or "interpolated" in way else pilot.targets

    def _follow_goal(self) -> None:
        """Give the robot all its time again, unless it stands at the goal or cannot move."""
        stage = self._stage
        if stage.status == "moving" or (
            stage.status == "reached" and self._distance() > SUCCESS_DISTANCE + LEFT_M
        ):
            self._begin()

    # Time.

    def step(self) -> None:
        """Advance by one control period; while paused only dragged people move."""
        stage = self._stage
        if not stage.paused:
            self._advance()
        elif stage.people.move_while_paused(stage.robot.dt):
            stage.touches_here()
            self._decide()

    def _advance(self) -> None:
        stage = self._stage
        before = stage.pass_period()
        if stage.status in ("contact", "blocked"):
            self._wait()
        else:
            self._move_robot(before)
        self._decide()

    def _wait(self) -> None:
        stage = self._stage
        if stage.status == "contact" and stage.status_s >= CONTACT_HOLD_S:
            self._restart_robot()
        elif stage.status == "blocked" and not stage.touches_here():
            self._begin()

    def _move_robot(self, before: Bodies) -> None:
        """Carry out the piece that was decided, the people having moved meanwhile."""
        stage = self._stage
        stands = _stands(stage.robot.qd) and _stands(self._piece.qd)
        found = stage.robot.follow(self._piece, stage.people, before)
        if found.kind == "human" and stands:
            self._note_touch(found)
        elif found.kind != "none":
            stage.note_contact(found)
            return
        elif (stage.robot.clearance_m or FAR) > APART_M:
            self._touching = False
        if stage.status == "moving":
            self._judge()
        elif stage.status_s >= REACHED_S and self._goal.mode == "jump":
            self._goal.jump()
            self._begin()

    def _note_touch(self, found: Contact) -> None:
        """Count somebody who walks into the robot while it stands."""
        self._stage.robot.halt()
        if not self._touching:
            self._counts = replace(self._counts, touched=self._counts.touched + 1)
        self._touching = True

    def _judge(self) -> None:
        """See whether the way to the goal ends at this state."""
        stage, counts, dt = self._stage, self._counts, self._stage.robot.dt
        stage.time_left -= dt
        override = self._safety.override
        self._counts = replace(
            counts,
            moving_s=counts.moving_s + dt,
            slowed_s=counts.slowed_s + (dt if override < 0.5 else 0.0),
            stopped_s=counts.stopped_s + (dt if override <= 0.0 else 0.0),
        )
        if self._distance() < SUCCESS_DISTANCE:
            stage.count(reached=1)
            took = self._counts.reaching_s + stage.status_s
            self._counts = replace(self._counts, reaching_s=took)
            stage.enter("reached")
        elif stage.time_left <= 0.0:
            stage.count(timeouts=1)
            self._begin()

    def _distance(self) -> float:
        """Return how far the tcp is from the goal [m]."""
        return float(np.linalg.norm(self._stage.robot.tcp() - self._goal.position))

    # Deciding.

    def _decide(self) -> None:
        """Ask policy and safety layer about this very state."""
        stage = self._stage
        robot, shapes = stage.robot, self._shapes()
        if stage.status == "moving":
            clear = robot.clearance_m if robot.clearance_m is not None else FAR
            left = min(stage.time_left, TIME_LIMIT_S)
            act = self._reacher.act(
                robot,
                stage.people.rows,
                self._goal.position,
                clear,
                left,
                stage.status_s,
                self._layer.settings if self._obeys else None,
            )
            wanted = robot.piece(act, straight=self._reacher.pilot is None)
        else:
            wanted = robot.piece(np.zeros(6), straight=True)
        told = self._layer.decide(robot.q, robot.qd, wanted.c, wanted.d, shapes)
        self._piece = _executed(robot.q, robot.qd, told, robot.dt) if self._obeys else wanted
        self._safety = self._seen(told, shapes)

    def _shapes(self) -> Shapes:
        people = self._stage.people
        top = np.full((len(people), 1), self._top)
        return replace(
            no_people(),
            cylinders=np.hstack([people.cylinders, top]),
            going=people.rows[:, [VX, VY, GROWTH]],
        )

    def _seen(self, told: SafetyDecision, shapes: Shapes) -> SafetyView:
        """Return the layer's decision with the terms of S_p."""
        layer, robot = self._layer, self._stage.robot
        found = layer.terms(told, robot.qd, shapes)
        who, terms = (None, None) if found is None else found
        return SafetyView(
            on=self._obeys,
            override=told.override if self._obeys else 1.0,
            advised=told.override,
            person=None if who is None else self._stage.people.ids[who],
            link=terms.link if terms else None,
            separation=terms.separation if terms else None,
            required=terms.required if terms else None,
            person_way=_person_way(terms) if terms else None,
            robot_way=terms.robot_speed * terms.reaction_time + terms.braking
            if terms
            else None,
            margin=layer.settings.margin,
            measured=layer.settings.use_measured_velocity,
            human_speed=layer.settings.other_speed,
            stop_time=told.stop_time,
            zone=frozen(separation_zone(layer.arm, layer.settings, robot.q, robot.qd)),
        )

    # What is seen.

    def _message(self, view: ReachView) -> str:
        stage = self._stage
        if stage.status == "contact" and stage.contact is not None:
            return explanation.touched(stage.contact, final=False)
        piloted = self._reacher.pilot is not None
        return reach_explanation.doing(
            stage.status, view, piloted=piloted, n_people=len(stage.people)
        )

    def snapshot(self) -> WorldSnapshot:
        """Return what is known now, frozen."""
        stage, goal, reacher = self._stage, self._goal, self._reacher
        view = ReachView(
            goal=frozen(goal.position),
            goal_mode=goal.mode,
            on_target=goal.on_target,
            distance=self._distance(),
            tolerance=SUCCESS_DISTANCE,
            time_left_s=stage.time_left,
            way=reacher.way,
            ways=reacher.ways,
            walk_speed=stage.people.speed,
            safety=self._safety,
            counters=self._counts,
        )
        known = stage.snapshot(
            stage.status,
            self._message(view),
            gripping=False,
            selected=(),
            case=None,
            reach=view,
        )
        pilot = reacher.pilot
        if pilot is None:
            return known
        return replace(
            known,
            checkpoint=pilot.checkpoint,
            policy_title=pilot.title,
            elapsed_ms=reacher.elapsed_ms,
        )


def check_way(way: str, ways: tuple[str, ...]) -> None:
    """Refuse a way in which the policy cannot be asked.

    Raises:
        InvalidInput: It is none of them.
    """
    if way not in ways:
        rule = "is no way to ask this policy" if ways else "needs a policy: none acts here"
        raise InvalidInput("way", way, rule, ways)


def _person_way(terms: SeparationTerms) -> float:
    """Return what a person covers until the robot rests [m]."""
    return terms.human_speed * (terms.reaction_time + terms.stop_time)


def _stands(qd: Vec) -> bool:
    return bool(np.abs(qd).max() < MOVING)


def _executed(q: Vec, qd: Vec, told: SafetyDecision, dt: float) -> Piece:
    """Return what the layer lets happen in a period, as a piece with the same ends.

    Within the period it is nearer to the layer's motion than 0.1 mrad.
    """
    c = (told.q - q - qd * dt) / dt**2
    return Piece(c=c, d=np.zeros(6), q=told.q, qd=told.qd, qdd=told.qdd)
