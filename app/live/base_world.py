"""What live worlds share: clock, people, robot, the policy's last decision, contacts.

The worlds (``world.py`` pick and place, ``sorting_world.py`` sorting) say what the robot shall
do; here is how it is carried out and seen. Pure numpy, no thread, no screen.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Generic, Protocol, TypeVar

from app.errors import ServiceError
from app.live import commands
from app.live.arm import Bodies, Everyone, LiveArm
from app.live.people.worker import frozen
from app.live.snapshot import (
    CandidateView,
    ContactView,
    Counters,
    PersonView,
    Status,
    WorldSnapshot,
)
from app.sim.cells.cell import Cell
from app.sim.collision.contact import Contact
from app.sim.human.person import Person
from app.sim.pick import batch as pick
from app.sim.pick.task_policy import Candidate, Decision, TaskPolicy

TIME_LIMIT_S = 20.0
"""Length of a motion of the policy [s] (table 5.2)."""
CONTACT_HOLD_S = 2.0
"""How long a contact is shown [s]."""
NOTE_S = 2.5
"""How long a change of mind is told [s]."""
NEAR_M = 0.25
"""Clearance below which a motion by inverse kinematics is broken off, so that the policy can
move away [m]."""

PeopleCommand = (
    commands.MoveHuman
    | commands.SetMode
    | commands.SetMotion
    | commands.SetBody
    | commands.AddPerson
    | commands.RemovePerson
)
ClockCommand = commands.Pause | commands.Resume | commands.StepOnce | commands.Reset

_BODIES = {"cell": "table", "self": "robot"}


class Somebody(Protocol):
    """One person of a live cell."""

    @property
    def id(self) -> int:
        """Number of the person."""

    def seen(self) -> Person:
        """Return the person as a policy sees it."""

    def drag(self, command: commands.MoveHuman) -> None:
        """Aim at a dragged posture."""

    def enter(self, mode: commands.Mode) -> None:
        """Change who moves the person."""

    def play(self, command: commands.SetMotion) -> None:
        """Move as recorded."""

    def grow(self, command: commands.SetBody) -> None:
        """Become as large as asked for."""

    def view(self, clearance_m: float, *, nearest: bool) -> PersonView:
        """Return what is known of the person."""


class People(Everyone, Protocol):
    """The people of a live cell, as a stage moves them."""

    def __iter__(self) -> Iterator[Somebody]: ...

    def __getitem__(self, id: int) -> Somebody: ...

    def move(self, dt: float) -> None:
        """Move everyone for ``dt`` [s]."""

    def change(self, command: commands.Command) -> None:
        """Let people come and leave as a command says."""


P = TypeVar("P", bound=People)


class LiveStage(Generic[P]):
    """Clock, people and robot of one live cell.

    Args:
        cell: Work cell.
        policy: Chooses and moves; None lets the robot rest.
        id: Name of the world in URLs.
        people: The people in it.
    """

    def __init__(self, cell: Cell, policy: TaskPolicy | None, id: str, people: P) -> None:
        self.cell, self.id, self.policy = cell, id, policy
        self.people = people
        self.robot = LiveArm(cell, pick.DEFAULT_ACTION if policy is None else policy.action)
        self.paused = False
        self.status: Status = "moving"
        self.status_s = 0.0
        self.contact: ContactView | None = None
        self.counters = Counters()
        self.time_left = TIME_LIMIT_S
        self.offered: tuple[Candidate, ...] = ()
        self.decision: Decision | None = None
        self.decided_s: float | None = None
        self.previous: str | None = None
        self.t = 0.0
        self.tick = 0
        self._note, self._note_until = "", -1.0

    # People and clock.

    def change_people(self, command: PeopleCommand) -> None:
        """Carry out a command about people."""
        match command:
            case commands.MoveHuman():
                self.people[command.person].drag(command)
            case commands.SetMode():
                self.people[command.person].enter(command.mode)
            case commands.SetMotion():
                self.people[command.person].play(command)
            case commands.SetBody():
                self.people[command.person].grow(command)
            case commands.AddPerson() | commands.RemovePerson():
                self.people.change(command)
                self.robot.touches(self.people)

    def pass_period(self) -> Bodies:
        """Let one control period go by for people and clock; return where people were."""
        before = self.people.bodies
        self.people.move(self.robot.dt)
        self.tick += 1
        self.t += self.robot.dt
        self.status_s += self.robot.dt
        return before

    def enter(self, status: Status) -> None:
        """Begin another status."""
        self.status, self.status_s = status, 0.0

    # The robot.

    def use(self, policy: TaskPolicy | None) -> None:
        """Let another policy choose and move."""
        self.policy = policy
        self.robot.action = pick.DEFAULT_ACTION if policy is None else policy.action

    def touches_here(self) -> bool:
        """Whether the robot touches anything where it is."""
        return self.robot.touches(self.people)

    @property
    def near(self) -> bool:
        """Whether a person is so near that a motion by inverse kinematics is broken off."""
        clearance = self.robot.clearance_m
        return clearance is not None and clearance < NEAR_M

    def note_contact(self, found: Contact) -> None:
        """Show a contact and let the robot stand still."""
        self.contact = ContactView(
            kind=found.kind,
            link=found.link,
            body=found.part if found.kind == "human" else _BODIES[found.kind],
            person=self._whom(found),
        )
        self.count(contacts=1)
        self.robot.halt()
        self.enter("contact")

    def _whom(self, found: Contact) -> int | None:
        """Return the id of the person who was touched."""
        if found.kind != "human":
            return None
        index = found.worker
        if found.walker is not None:
            index = len(self.people.bodies.q) + found.walker
        return None if index is None else self.people.ids[index]

    def count(
        self, *, reached: int = 0, timeouts: int = 0, contacts: int = 0, switches: int = 0
    ) -> None:
        """Add to the counters."""
        so_far = self.counters
        self.counters = replace(
            so_far,
            reached=so_far.reached + reached,
            timeouts=so_far.timeouts + timeouts,
            contacts=so_far.contacts + contacts,
            switches=so_far.switches + switches,
        )

    # Deciding.

    def begin_motion(self) -> None:
        """Give the policy a new motion, with all its time and nothing chosen."""
        self.time_left = TIME_LIMIT_S
        self.decision = None

    def decide(self, offered: tuple[Candidate, ...]) -> str | None:
        """Ask the policy about this very state; return what was chosen before, if left now."""
        before = self.decision.chosen if self.decision is not None else None
        names = tuple(candidate.id for candidate in offered)
        self.offered = offered
        self.previous = before if before in names else None
        self.decision = None
        if self.policy is None or not names:
            return None
        try:
            decision = self.policy.decide(
                self.robot.q,
                self.robot.qd,
                [person.seen() for person in self.people],
                offered,
                previous=self.previous,
                time_left_s=self.time_left,
            )
        except ServiceError as error:
            self.tell(error.message)
            return None
        self.decision, self.decided_s = decision, self.t
        if self.previous is None or decision.chosen == self.previous:
            return None
        self.count(switches=1)
        return self.previous

    # What is seen.

    def tell(self, note: str, seconds: float = NOTE_S) -> None:
        """Show a note for a while."""
        self._note, self._note_until = note, self.t + seconds

    def forget_note(self) -> None:
        """Show no note any more."""
        self._note, self._note_until = "", -1.0

    @property
    def note(self) -> str | None:
        """The note that is shown now."""
        return self._note if self.t < self._note_until else None

    def _candidate(self, index: int, candidate: Candidate) -> CandidateView:
        decision = self.decision
        return CandidateView(
            id=candidate.id,
            position=frozen(candidate.position),
            value=None if decision is None else decision.values[index],
            chosen=decision is not None and decision.index == index,
            reachable=None if decision is None else decision.reachable[index],
            outside=() if decision is None else decision.outside_candidates[index],
        )

    def _people_views(self) -> tuple[PersonView, ...]:
        distances = self.robot.distances(self.people)
        nearest = min(distances, key=lambda id: distances[id], default=None)
        return tuple(
            person.view(distances[person.id], nearest=person.id == nearest)
            for person in self.people
        )

    def snapshot(self, status: Status, message: str, **scenario: Any) -> WorldSnapshot:
        """Return what is known now, frozen.

        Args:
            status: What the robot is doing, as it is shown.
            message: Why, in one sentence.
            scenario: The fields that only the scenario knows.
        """
        decision, policy = self.decision, self.policy
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
            people=self._people_views(),
            candidates=tuple(self._candidate(i, c) for i, c in enumerate(self.offered)),
            chosen=None if decision is None else decision.chosen,
            previous=self.previous,
            time_left_s=self.time_left,
            outside=() if decision is None else decision.outside,
            clearance_m=self.robot.clearance_m,
            contact=self.contact,
            checkpoint=None if policy is None else policy.checkpoint,
            policy_title=None if policy is None else policy.title,
            elapsed_ms=None if decision is None else decision.elapsed_ms,
            counters=self.counters,
            decided_s=None if decision is None else self.decided_s,
            **scenario,
        )
