"""Base class of live worlds: clock, people, robot, decisions of the policy, contacts.

A world advances in control periods of ``cell.robot.dt``. In each period the people move, the
robot executes the motion decided for the previous state, contact is tested over the whole
period, and the policy decides again (docs/method.md 3.1). The safety layer (docs/method.md 2.7)
lies between policy and robot. A contact of the moving robot is shown for two seconds, and the
robot starts again; one of the robot at standstill is counted apart, and the robot waits until
the person has moved on. Pure numpy: no thread, no screen.
"""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, Generic, TypeVar

import numpy as np

from app.errors import ServiceError
from app.live import commands
from app.live.arm import HumanGeometry, LiveArm
from app.live.command_checks import Command, check
from app.live.people.pedestrians import LivePedestrians
from app.live.people.workers import LiveWorkers
from app.live.read_model import frozen
from app.live.resting_people import RestingPeopleControl
from app.live.safety import explanation
from app.live.safety.layer import LiveSafety
from app.live.snapshot import (
    PICK_PHASES,
    ContactSnapshot,
    Counters,
    PersonSnapshot,
    Status,
    WorldSnapshot,
    candidate_snapshots,
)
from app.sim.cells.cell import Cell
from app.sim.collision.contact import Contact
from app.sim.core.arrays import Vec
from app.sim.pick import batch as pick
from app.sim.pick.kernels.grasp import DESCEND
from app.sim.pick.task_policy import NOT_BEGUN, Candidate, Decision, TaskPolicy
from app.sim.robot.trajectory_segment import TrajectorySegment

TIME_LIMIT_S = 20.0
"""Time limit of one motion of the policy [s] (thesis table 5.2)."""
CONTACT_HOLD_S = 2.0
"""Time for which a contact is shown [s]."""
NOTE_S = 2.5
"""Time for which a note is shown [s]."""
NEAR_M = 0.25
"""Separation distance below which a motion by inverse kinematics ends [m]."""
STANDSTILL = 1e-3
"""Joint speed below which the robot is at standstill [rad/s]."""
APART_M = 0.02
"""Separation distance from which a contact at standstill is over [m]."""

P = TypeVar("P", bound=LivePedestrians | LiveWorkers)


class BaseWorld(ABC, Generic[P]):
    """Clock, people and robot of one live cell; scenarios fill in the hooks."""

    def __init__(self, cell: Cell, policy: TaskPolicy | None, id: str, people: P) -> None:
        self.cell, self.id, self.policy = cell, id, policy
        self.people = people
        self.robot = LiveArm(cell, pick.DEFAULT_ACTION if policy is None else policy.action)
        self.safety = LiveSafety(self.robot, cell)
        self._planned: TrajectorySegment
        self.planner = RestingPeopleControl(self.robot)
        self._touching = False
        self.paused = False
        self.status: Status = "moving"
        self.status_s = 0.0
        self.contact: ContactSnapshot | None = None
        self.counters = Counters()
        self.time_left = TIME_LIMIT_S
        self.offered: tuple[Candidate, ...] = ()
        self.decision: Decision | None = None
        self.decided_s: float | None = None
        self.previous: str | None = None
        self.progress = NOT_BEGUN
        """Progress of the pick of the last choice."""
        self.decided_from = NOT_BEGUN
        """Progress at the last decision."""
        self.t = 0.0
        self.tick = 0
        self._note, self._note_until = "", -1.0

    # Hooks of the scenarios.

    @abstractmethod
    def _reset_scenario(self) -> None:
        """Return people, task and counters to the start."""

    @abstractmethod
    def _change(self, command: Command) -> None:
        """Apply a command that only this scenario has."""

    @abstractmethod
    def _begin(self, status: Status = "moving") -> None:
        """Begin the next motion, or wait in another status."""

    @abstractmethod
    def _move_robot(self, before: HumanGeometry) -> None:
        """Execute one control period of the robot; ``before`` are the people at its start."""

    @abstractmethod
    def _wanted(self) -> TrajectorySegment:
        """Return the motion of the next period without the safety layer."""

    @abstractmethod
    def snapshot(self) -> WorldSnapshot:
        """Return the read model of the present state."""

    def _decide(self) -> None:
        """Query the policy for the present state; nothing where :meth:`_wanted` does."""

    def _refresh(self) -> None:
        """Decide again after people, policy or task changed."""
        if self.status in ("moving", "blocked"):
            self._decide()

    def _start_configuration(self) -> Vec:
        """Return the joint positions from which the robot starts [rad], shape (6,)."""
        return self.robot.home

    def _prepare_restart(self) -> None:
        """Return the task to a state in which the robot can start."""

    def _end_contact(self) -> None:
        """Continue after a contact was shown."""
        self._restart_robot()

    # Commands and time.

    def apply(self, command: Command) -> None:
        """Apply one command.

        Raises:
            ServiceError: The command does not fit this world; nothing has changed.
        """
        check(command, self.cell, self.people.ids)
        match command:
            case commands.PauseClock() | commands.ResumeClock():
                self.paused = isinstance(command, commands.PauseClock)
            case commands.StepOnce():
                self.paused = True
                self._advance()
            case commands.Reset():
                self._reset()
            case commands.SetSpeed():
                pass  # the loop's own
            case _ if isinstance(command, commands.PeopleCommand):
                self._change_people(command)
            case commands.SetSafety():
                self._change_safety(command)
            case _:
                self._change(command)
        self._plan()

    def step(self) -> None:
        """Advance by one control period; while paused only dragged people move."""
        if not self.paused:
            self._advance()
        elif self.people.move_while_paused(self.robot.dt):
            self.in_contact()
            self._refresh()
        self._plan()

    def _advance(self) -> None:
        before = self.people.geometry
        self.people.move(self.robot.dt)
        self.tick += 1
        self.t += self.robot.dt
        self.status_s += self.robot.dt
        if self.status in ("contact", "blocked", "case done"):
            self._wait()
        else:
            self._move_robot(before)
        self._after_period()

    def _after_period(self) -> None:
        if self.status == "moving":
            self._decide()

    def _wait(self) -> None:
        touches = self.in_contact()
        if self.status == "contact" and self.status_s >= CONTACT_HOLD_S:
            self._end_contact()
        elif self.status == "blocked" and not touches:
            self._begin()

    def _reset(self) -> None:
        self.t, self.counters = 0.0, Counters()
        self.safety.reset()
        self._reset_scenario()
        self._restart_robot()

    def _restart_robot(self) -> None:
        self.robot.place(self._start_configuration())
        self.contact, self._touching = None, False
        self.planner.reset()
        self._prepare_restart()
        self._begin("blocked" if self.in_contact() else "moving")

    def _change_people(self, command: commands.PeopleCommand) -> None:
        match command:
            case commands.MovePerson():
                self.people[command.person].drag(command)
            case commands.SetMode():
                self.people[command.person].enter(command.mode)
            case commands.SetMotion():
                self.people[command.person].play(command)
            case commands.SetAnthropometry():
                self.people[command.person].resize(command)
            case commands.AddPerson() | commands.RemovePerson():
                self.people.change(command)
                self.in_contact()
        self._refresh()

    def enter(self, status: Status) -> None:
        """Begin another status."""
        self.status, self.status_s = status, 0.0

    def _change_safety(self, command: commands.SetSafety) -> None:
        self.safety.change(command)

    # The robot.

    def _plan(self) -> None:
        """Plan the motion of the next period for the present state."""
        self._planned = self.safety.plan(self._wanted(), self.robot.shapes(self.people))

    def follow_plan(self, before: HumanGeometry) -> bool:
        """Execute the planned motion; return whether a contact ended the episode."""
        speeds = np.concatenate([self.robot.qd, self._planned.qd])
        at_standstill = bool(np.abs(speeds).max() < STANDSTILL)
        found = self.robot.follow(self._planned, self.people, before)
        if found.kind == "human" and at_standstill:
            self.robot.halt()
            self.count(contacts_at_rest=int(not self._touching))
            self._touching = True
        elif found.kind != "none":
            self.note_contact(found)
            return True
        elif self.robot.clearance_m is None or self.robot.clearance_m > APART_M:
            self._touching = False
        return False

    def use(self, policy: TaskPolicy | None) -> None:
        """Replace the policy, which has the whole time limit."""
        self.policy, self.time_left = policy, TIME_LIMIT_S
        self.robot.action = pick.DEFAULT_ACTION if policy is None else policy.action

    def in_contact(self) -> bool:
        """Return whether the robot is in contact, and measure the separation distance."""
        return self.robot.in_contact(self.people)

    @property
    def near(self) -> bool:
        """Whether a person is too near for a motion by inverse kinematics."""
        clearance = self.robot.clearance_m
        return clearance is not None and clearance < NEAR_M

    def note_contact(self, found: Contact) -> None:
        """Stop the robot and show a contact."""
        self.contact = ContactSnapshot(
            kind=found.kind,
            link=found.link,
            body=found.part,
            person=self._touched_person(found),
        )
        self.count(contacts=1)
        self.robot.halt()
        self.enter("contact")

    def _touched_person(self, found: Contact) -> int | None:
        index = found.worker
        if found.walker is not None:
            index = len(self.people.geometry.q) + found.walker
        return None if index is None else self.people.ids[index]

    def count(self, **events: int) -> None:
        """Add events to the counters, by the names of :class:`Counters`."""
        so_far = self.counters
        added = {name: getattr(so_far, name) + n for name, n in events.items()}
        self.counters = replace(so_far, **added)

    def begin_motion(self) -> None:
        """Start a new motion of the policy, with the whole time limit and no decision."""
        self.time_left = TIME_LIMIT_S
        self.decision, self.progress = None, NOT_BEGUN

    def query(self, offered: tuple[Candidate, ...]) -> str | None:
        """Query the policy for the present state; return the previous choice if it changed."""
        before = self.decision.chosen if self.decision is not None else None
        names = tuple(candidate.id for candidate in offered)
        self.offered = offered
        self.previous = before if before in names else None
        if self.previous is None:
            self.progress = NOT_BEGUN
        self.decided_from = self.progress
        self.decision = self.planner.act = None
        if self.policy is None or not names:
            return None
        try:
            decision = self.policy.decide(
                self.robot.q,
                self.robot.qd,
                [person.as_observed() for person in self.people],
                offered,
                previous=self.previous,
                progress=self.progress,
                time_left_s=self.time_left,
            )
        except ServiceError as error:
            self.set_message(error.message)
            return None
        self.decision, self.decided_s = decision, self.t
        if decision.chosen != self.previous:
            if self.progress.phase == DESCEND:
                self.count(broken_off=1)
            self.progress = NOT_BEGUN
        if self.previous is None or decision.chosen == self.previous:
            return None
        self.count(switches=1)
        return self.previous

    # Read model.

    def set_message(self, note: str) -> None:
        """Show a note for NOTE_S."""
        self._note, self._note_until = note, self.t + NOTE_S

    def clear_message(self) -> None:
        """Remove the note."""
        self._note, self._note_until = "", -1.0

    @property
    def note(self) -> str | None:
        """The note shown at present."""
        return self._note if self.t < self._note_until else None

    def slowed(self) -> str | None:
        """Return why the safety layer reduces the speed; None if it does not."""
        ids = self.people.ids
        return explanation.slowed(self.safety.snapshot(ids), len(ids))

    def _people_views(self) -> tuple[PersonSnapshot, ...]:
        distances = self.robot.distances(self.people)
        nearest = min(distances, key=lambda id: distances[id], default=None)
        return tuple(
            person.snapshot(distances[person.id], nearest=person.id == nearest)
            for person in self.people
        )

    def _snapshot(self, status: Status, message: str, **scenario: Any) -> WorldSnapshot:
        """Return the snapshot with the fields that only the scenario knows."""
        decision, policy, people = self.decision, self.policy, self._people_views()
        return WorldSnapshot(
            id=self.id,
            cell=self.cell.name,
            tick=self.tick,
            t_s=self.t,
            paused=self.paused,
            status=status,
            message=message,
            robot_q=frozen(self.robot.q),
            robot_qd=frozen(self.robot.qd),
            tcp=frozen(self.robot.tcp()),
            mode=people[0].mode if people else None,
            people=people,
            candidates=candidate_snapshots(self.offered, decision),
            chosen=None if decision is None else decision.chosen,
            previous=self.previous,
            time_left_s=self.time_left,
            phase=PICK_PHASES[self.decided_from.phase],
            closing_s=self.decided_from.closing_s,
            outside=() if decision is None else decision.outside,
            clearance_m=self.robot.clearance_m,
            contact=self.contact,
            checkpoint=None if policy is None else policy.checkpoint,
            policy_title=None if policy is None else policy.title,
            observed_people=None if policy is None else policy.observed_people,
            elapsed_ms=None if decision is None else decision.elapsed_ms,
            counters=self.counters,
            decided_s=None if decision is None else self.decided_s,
            safety=self.safety.snapshot(self.people.ids),
            **scenario,
        )
