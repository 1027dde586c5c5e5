"""One live cell: robot, people, candidates, clock. Pure numpy, no thread, no screen.

The world advances in control periods of ``cell.robot.dt``. Each period the robot carries out
the action decided for the state it is in, the people move, contact is tested between the ends
of the period too, and the policy decides anew (METHOD 3.1); one that knows a single person sees
the nearest. A reached target is picked up (the tool goes down and up again, by inverse
kinematics and inside the same limits), leaves the candidates until all have had their turn, and
the next episode goes on from there. A contact is shown for two seconds; then the robot starts
again from home.
"""

from dataclasses import replace

import numpy as np

from app.errors import ServiceError
from app.sim import commands, explanation, pick, scene
from app.sim.cases import Case, find_case
from app.sim.cells import Cell
from app.sim.commands import Command
from app.sim.contact import Contact, contact, worker_distances
from app.sim.kernels import body, kinematics
from app.sim.live_people import LivePeople
from app.sim.live_person import frozen
from app.sim.ports import Candidate, Decision, TaskPolicy, Vec
from app.sim.snapshot import (
    CandidateView,
    ContactView,
    Counters,
    PersonView,
    Status,
    WorldSnapshot,
)

TIME_LIMIT_S = 20.0
"""Length of an episode [s] (table 5.2)."""
CONTACT_HOLD_S = 2.0
"""How long a contact is shown [s]."""
NOTE_S = 2.5
"""How long a change of mind is told [s]."""
PICK_HEIGHT = 0.065
"""Height of the tcp over the table when the fingers close [m]."""
PICK_S = (0.9, 1.3, 2.0)
"""Times at which the tool is down, the fingers have closed, the tool is up again [s]."""
GAIN = 3.0
"""Joint speed per joint error while picking [1/s]."""
NEAR_M = 0.25
"""Clearance below which picking is broken off, so that the policy can move away [m]."""


class World:
    """One live work cell.

    Args:
        cell: Work cell.
        policy: Chooses and moves; None lets the robot rest.
        seed: Seed of the people's work.
        id: Name of the world in URLs.
    """

    def __init__(
        self, cell: Cell, policy: TaskPolicy | None, seed: int, id: str = "main"
    ) -> None:
        self.cell, self.id = cell, id
        self._arm, self._people = scene.arm_of(cell), scene.people_of(cell)
        self._live = LivePeople(cell, seed)
        self._policy = policy
        self._action_rule = pick.DEFAULT_ACTION if policy is None else policy.action
        self._case: Case | None = None
        self._selected = tuple(s.id for s in cell.stations if s.kind == "cube")
        self._own_choice = self._selected
        self._tick, self._paused = 0, False
        self._reset()

    # Starts and ends.

    def _reset(self) -> None:
        self._t, self._counters = 0.0, Counters()
        for person in self._live:
            person.start(self._case)
        self._restart_robot()

    def _restart_robot(self) -> None:
        self._q, self._qd, self._qdd = self._start_q(), np.zeros(6), np.zeros(6)
        self._done: set[str] = set()
        self._contact: ContactView | None = None
        self._begin_episode("blocked" if self._touches_here() else "moving")

    def _start_q(self) -> Vec:
        if self._case is None:
            return np.array(self.cell.robot.home_q)
        return self._posture_over(self._case.robot_start)

    def _begin_episode(self, status: Status = "moving") -> None:
        self._status: Status = status
        self._status_s, self._time_left = 0.0, TIME_LIMIT_S
        self._decision: Decision | None = None
        self._goal: str | None = None
        self._note, self._note_until = "", -1.0
        self._decide()

    def _touches_here(self) -> bool:
        rest = np.zeros(6)
        return self._found(rest, rest, rest, self._live.q, self._live.sizes).kind != "none"

    def _found(self, qd: Vec, c: Vec, d: Vec, human_q: Vec, sizes: Vec) -> Contact:
        """Test a period that began with the robot here and the people as they were then."""
        found = contact(
            self._arm,
            self._people._replace(columns=body.capsule_columns(len(self._live))),
            self._q,
            qd,
            c,
            d,
            (human_q, self._live.q),
            sizes=(sizes, self._live.sizes),
        )
        self._clearance = found.clearance_m if len(self._live) else None
        return found

    def _posture_over(self, station: str, height: float | None = None) -> Vec:
        position = np.array(self.cell.station(station).position)
        if height is not None:
            position[2] = height
        q, arm = np.empty(6), self._arm
        kinematics.ik_vertical(position, arm.tool_length, arm.q_min, arm.q_max, q)
        return q

    # Commands.

    def apply(self, command: Command) -> None:
        """Carry out one command.

        Raises:
            ServiceError: The command does not fit this cell; nothing has changed.
        """
        commands.check(command, self.cell, self._live.ids)
        match command:
            case (
                commands.MoveHuman()
                | commands.SetMode()
                | commands.SetMotion()
                | commands.SetBody()
                | commands.AddPerson()
                | commands.RemovePerson()
            ):
                self._leave_case()
                self._change_people(command)
            case commands.Pause() | commands.Resume() | commands.StepOnce() | commands.Reset():
                self._control_clock(command)
            case commands.SetCandidates():
                self._choose_among(set(command.ids))
            case commands.ToggleCandidate():
                self._choose_among(set(self._selected) ^ {command.id})
            case commands.SetPolicy():
                self._policy = command.policy
                self._refresh()
            case commands.StartCase():
                self._start_case(find_case(command.id))

    def _change_people(
        self,
        command: commands.MoveHuman
        | commands.SetMode
        | commands.SetMotion
        | commands.SetBody
        | commands.AddPerson
        | commands.RemovePerson,
    ) -> None:
        match command:
            case commands.MoveHuman():
                self._live[command.person].drag(command)
            case commands.SetMode():
                self._live[command.person].enter(command.mode)
            case commands.SetMotion():
                self._live[command.person].play(command)
            case commands.SetBody():
                self._live[command.person].grow(command)
            case commands.AddPerson() | commands.RemovePerson():
                self._live.change(command)
                self._touches_here()
                self._refresh()

    def _control_clock(
        self, command: commands.Pause | commands.Resume | commands.StepOnce | commands.Reset
    ) -> None:
        match command:
            case commands.Pause():
                self._paused = True
            case commands.Resume():
                self._paused = False
            case commands.StepOnce():
                self._paused = True
                self._advance()
            case commands.Reset():
                self._reset()

    def _start_case(self, case: Case) -> None:
        self._case, self._paused = case, False
        self._selected = tuple(n for n in self.cell.station_ids if n in case.goals)
        self._live.only_first()
        self._reset()

    def _leave_case(self) -> None:
        if self._case is None:
            return
        self._case, self._selected = None, self._own_choice
        for person in self._live:
            person.leave_case()
        self._refresh()

    def _choose_among(self, ids: set[str]) -> None:
        self._leave_case()
        self._selected = tuple(name for name in self.cell.station_ids if name in ids)
        self._own_choice, self._done = self._selected, set()
        self._refresh()

    def _refresh(self) -> None:
        """Decide afresh after the candidates or the policy changed."""
        if self._status == "case done":
            self._begin_episode()
        elif self._status == "moving":
            self._decide()

    # Time.

    def step(self) -> None:
        """Advance by one control period; while paused only dragged people move."""
        if not self._paused:
            self._advance()
        elif self._live.move_while_paused(self._arm.dt):
            self._touches_here()
            self._refresh()

    def _advance(self) -> None:
        before = self._live.q, self._live.sizes
        self._live.move(self._arm.dt)
        self._tick += 1
        self._t += self._arm.dt
        self._status_s += self._arm.dt
        if self._status in ("contact", "blocked", "case done"):
            self._wait()
        else:
            self._move_robot(*before)
        if self._status == "moving":
            self._decide()

    def _move_robot(self, human_q: Vec, sizes: Vec) -> None:
        """Carry out the action, the people having moved from ``human_q`` with ``sizes``."""
        piece = pick.step_robot(
            self._arm, self._q, self._qd, self._qdd, self._action(), self._action_rule
        )
        found = self._found(self._qd, piece.c, piece.d, human_q, sizes)
        if found.kind != "none":
            self._touch(found)
            return
        self._q, self._qd, self._qdd = piece.q, piece.qd, piece.qdd
        if self._status == "picking":
            self._finish_pick()
        elif self._decision is not None:
            self._time_left -= self._arm.dt
            self._judge(self._decision)

    def _action(self) -> Vec:
        """Return the wanted joint speeds over their limits, shape (5,)."""
        if self._status == "picking" and self._goal is not None:
            down = self._status_s < PICK_S[1]
            posture = self._posture_over(self._goal, PICK_HEIGHT if down else None)
            speed = GAIN * (posture - self._q) / self._arm.qd_max
            return np.asarray(np.clip(speed[:5], -1.0, 1.0))
        if self._decision is not None:
            return np.asarray(self._decision.actions[self._decision.index], dtype=np.float64)
        return np.zeros(5)

    def _judge(self, decision: Decision) -> None:
        """See whether the episode ends at this state."""
        target = self._offered[decision.index].position
        if pick.tool_state(self._arm, self._q, self._qd, target)[3]:
            self._count(reached=1)
            self._goal, self._status, self._status_s = decision.chosen, "picking", 0.0
        elif self._time_left <= 0.0:
            self._count(timeouts=1)
            self._begin_episode("moving" if self._case is None else "case done")

    def _count(self, *, reached: int = 0, timeouts: int = 0, contacts: int = 0) -> None:
        so_far = self._counters
        self._counters = replace(
            so_far,
            reached=so_far.reached + reached,
            timeouts=so_far.timeouts + timeouts,
            contacts=so_far.contacts + contacts,
        )

    def _finish_pick(self) -> None:
        near = self._clearance is not None and self._clearance < NEAR_M
        if self._status_s < PICK_S[2] and not near:
            return
        if self._case is not None:
            self._status = "case done"
        else:
            self._cross_off(self._goal)
            self._begin_episode()

    def _cross_off(self, reached: str | None) -> None:
        """Take a reached station out until all have had their turn."""
        self._done.add(reached or "")
        if self._done.issuperset(self._selected):
            self._done = {reached or ""}

    def _touch(self, found: Contact) -> None:
        bodies = {"human": found.part, "cell": "table", "self": "robot"}
        self._contact = ContactView(
            kind=found.kind,
            link=found.link,
            body=bodies[found.kind],
            person=None if found.worker is None else self._live.ids[found.worker],
        )
        self._count(contacts=1)
        self._qd = np.zeros(6)
        self._status, self._status_s = "contact", 0.0

    def _wait(self) -> None:
        if self._status == "contact" and self._status_s >= CONTACT_HOLD_S:
            if self._case is None:
                self._restart_robot()
            else:
                self._status, self._goal = "case done", None
        elif self._status == "blocked" and not self._touches_here():
            self._begin_episode()

    # Deciding.

    def _candidates(self) -> tuple[Candidate, ...]:
        names = [name for name in self._selected if name not in self._done]
        return tuple(
            Candidate(id=name, position=np.array(self.cell.station(name).position))
            for name in names or self._selected
        )

    def _decide(self) -> None:
        """Ask the policy about this very state."""
        before = self._decision.chosen if self._decision is not None else None
        self._offered = self._candidates()
        names = tuple(candidate.id for candidate in self._offered)
        self._previous = before if before in names else None
        self._decision = None
        if self._policy is None or not names:
            return
        try:
            decision = self._policy.decide(
                self._q,
                self._qd,
                [person.seen() for person in self._live],
                self._offered,
                previous=self._previous,
                time_left_s=self._time_left,
            )
        except ServiceError as error:
            self._tell(error.message)
            return
        if self._previous is not None and decision.chosen != self._previous:
            self._counters = replace(self._counters, switches=self._counters.switches + 1)
            self._tell(explanation.switched(decision, names, self._previous, self._label))
        self._decision = decision

    def _distances(self) -> dict[int, float]:
        """Return the distance of the robot to each person by id [m]."""
        found = worker_distances(
            self._arm,
            self._people._replace(columns=body.capsule_columns(len(self._live))),
            self._q,
            self._live.q,
            self._live.sizes,
        )
        return dict(zip(self._live.ids, found.tolist(), strict=True))

    # What is seen.

    def _label(self, name: str) -> str:
        return self.cell.station(name).label

    def _tell(self, note: str) -> None:
        self._note, self._note_until = note, self._t + NOTE_S

    def _shown_status(self) -> Status:
        if self._status == "moving" and self._decision is None:
            return "no policy" if self._selected else "no candidates"
        return self._status

    def _message(self, status: Status) -> str:
        if status == "contact" and self._contact is not None:
            return explanation.touched(self._contact, final=self._case is not None)
        if self._t < self._note_until and status in ("moving", "no policy"):
            return self._note
        if status == "moving" and self._decision is not None:
            names = tuple(candidate.id for candidate in self._offered)
            return explanation.going(self._decision, names, self._label)
        if status == "case done" and self._case is not None:
            if self._contact is not None:
                return explanation.touched(self._contact, final=True)
            return explanation.case_ended(self._case, self._goal, self._label)
        return explanation.resting(status, self._goal, self._label)

    def _view(self, index: int, candidate: Candidate) -> CandidateView:
        decision = self._decision
        return CandidateView(
            id=candidate.id,
            position=frozen(candidate.position),
            value=None if decision is None else decision.values[index],
            chosen=decision is not None and decision.index == index,
            reachable=None if decision is None else decision.reachable[index],
            outside=() if decision is None else decision.outside_candidates[index],
        )

    def _views(self) -> tuple[PersonView, ...]:
        distances = self._distances()
        nearest = min(distances, key=lambda id: distances[id], default=None)
        return tuple(
            person.view(distances[person.id], nearest=person.id == nearest)
            for person in self._live
        )

    def _tcp(self) -> Vec:
        rotations, origins, tcp = np.empty((7, 3, 3)), np.empty((7, 3)), np.empty(3)
        kinematics.link_poses(self._q, rotations, origins)
        kinematics.tcp_point(rotations, origins, self._arm.tool_length, tcp)
        return tcp

    def snapshot(self) -> WorldSnapshot:
        """Return what is known now, frozen."""
        decision, policy, status = self._decision, self._policy, self._shown_status()
        return WorldSnapshot(
            id=self.id,
            cell=self.cell.name,
            tick=self._tick,
            t_s=self._t,
            paused=self._paused,
            status=status,
            message=self._message(status),
            robot_q=frozen(self._q),
            robot_qd=frozen(self._qd),
            tcp=frozen(self._tcp()),
            people=self._views(),
            gripping=status == "picking" and self._status_s >= PICK_S[0],
            selected=self._selected,
            candidates=tuple(self._view(i, c) for i, c in enumerate(self._offered)),
            chosen=None if decision is None else decision.chosen,
            previous=self._previous,
            time_left_s=self._time_left,
            outside=() if decision is None else decision.outside,
            clearance_m=self._clearance,
            contact=self._contact,
            checkpoint=None if policy is None else policy.checkpoint,
            policy_title=None if policy is None else policy.title,
            elapsed_ms=None if decision is None else decision.elapsed_ms,
            case=None if self._case is None else self._case.id,
            counters=self._counters,
        )
