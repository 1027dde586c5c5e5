"""One live pick-and-place cell: robot, people, candidates, clock. No thread, no screen.

The world advances in control periods of ``cell.robot.dt``. Each period the robot carries out
the action decided for the state it is in, the people move, contact is tested between the ends
of the period too, and the policy decides anew (METHOD 3.1); one that knows a single person sees
the nearest. A reached target is picked up (the tool goes down and up again, by inverse
kinematics and inside the same limits), leaves the candidates until all have had their turn, and
the next episode goes on from there. A contact is shown for two seconds; then the robot starts
again from home.
"""

import numpy as np

from app.live import commands
from app.live.arm import Bodies
from app.live.base_world import CONTACT_HOLD_S, ClockCommand, LiveStage
from app.live.commands import Command
from app.live.people.workers import LivePeople
from app.live.pick import explanation
from app.live.snapshot import Counters, Status, WorldSnapshot
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.pick.case_verdict import CaseRun, Verdict, judge
from app.sim.pick.cases import Case, find_case
from app.sim.pick.task_policy import Candidate, Decision, TaskPolicy

PICK_HEIGHT = 0.065
"""Height of the tcp over the table when the fingers close [m]."""
PICK_S = (0.9, 1.3, 2.0)
"""Times at which the tool is down, the fingers have closed, the tool is up again [s]."""


class World:
    """One live pick-and-place cell.

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
        self._stage = LiveStage(cell, policy, id, LivePeople(cell, seed))
        self._case: Case | None = None
        self._run = CaseRun()
        self._selected = tuple(s.id for s in cell.stations if s.kind == "cube")
        self._own_choice = self._selected
        self._reset()

    # Starts and ends.

    def _reset(self) -> None:
        self._stage.t, self._stage.counters = 0.0, Counters()
        self._run = CaseRun()
        for person in self._stage.people:
            person.start(self._case)
        self._restart_robot()

    def _restart_robot(self) -> None:
        self._stage.robot.put(self._start_q())
        self._done: set[str] = set()
        self._stage.contact = None
        self._begin_episode("blocked" if self._stage.touches_here() else "moving")

    def _start_q(self) -> Vec:
        if self._case is None:
            return self._stage.robot.home
        return self._posture_over(self._case.robot_start)

    def _begin_episode(self, status: Status = "moving") -> None:
        self._stage.enter(status)
        self._stage.begin_motion()
        self._stage.forget_note()
        self._goal: str | None = None
        self._decide()

    def _posture_over(self, station: str, height: float | None = None) -> Vec:
        position = np.array(self.cell.station(station).position)
        if height is not None:
            position[2] = height
        return self._stage.robot.posture_at(position)[0]

    # Commands.

    def apply(self, command: Command) -> None:
        """Carry out one command.

        Raises:
            ServiceError: The command does not fit this cell; nothing has changed.
        """
        commands.check(command, self.cell, self._stage.people.ids)
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
                self._stage.change_people(command)
                if isinstance(command, commands.AddPerson | commands.RemovePerson):
                    self._refresh()
            case commands.Pause() | commands.Resume() | commands.StepOnce() | commands.Reset():
                self._control_clock(command)
            case commands.SetCandidates():
                self._choose_among(set(command.ids))
            case commands.ToggleCandidate():
                self._choose_among(set(self._selected) ^ {command.id})
            case commands.SetPolicy():
                self._stage.use(command.policy)
                if self._case is None:
                    self._refresh()
                else:  # A run of a case study belongs to one policy.
                    self._reset()
            case commands.StartCase():
                self._start_case(find_case(command.id))

    def _control_clock(self, command: ClockCommand) -> None:
        match command:
            case commands.Pause():
                self._stage.paused = True
            case commands.Resume():
                self._stage.paused = False
            case commands.StepOnce():
                self._stage.paused = True
                self._advance()
            case commands.Reset():
                self._reset()

    def _start_case(self, case: Case) -> None:
        self._case, self._stage.paused = case, False
        self._selected = tuple(n for n in self.cell.station_ids if n in case.goals)
        self._stage.people.only_first()
        self._reset()

    def _leave_case(self) -> None:
        if self._case is None:
            return
        self._case, self._selected = None, self._own_choice
        for person in self._stage.people:
            person.leave_case()
        self._refresh()

    def _choose_among(self, ids: set[str]) -> None:
        self._leave_case()
        self._selected = tuple(name for name in self.cell.station_ids if name in ids)
        self._own_choice, self._done = self._selected, set()
        self._refresh()

    def _refresh(self) -> None:
        """Decide afresh after the candidates or the policy changed."""
        if self._stage.status == "case done":
            self._begin_episode()
        elif self._stage.status == "moving":
            self._decide()

    # Time.

    def step(self) -> None:
        """Advance by one control period; while paused only dragged people move."""
        stage = self._stage
        if not stage.paused:
            self._advance()
        elif stage.people.move_while_paused(stage.robot.dt):
            stage.touches_here()
            self._refresh()

    def _advance(self) -> None:
        before = self._stage.pass_period()
        if self._stage.status in ("contact", "blocked", "case done"):
            self._wait()
        else:
            self._move_robot(before)
        if self._stage.status == "moving":
            self._decide()

    def _move_robot(self, before: Bodies) -> None:
        """Carry out the action, the people having moved from where they were."""
        stage = self._stage
        straight = stage.status == "picking"
        found = stage.robot.advance(self._action(), stage.people, before, straight=straight)
        if found.kind != "none":
            stage.note_contact(found)
            self._run = self._run.finish("contact", stage.t)
        elif stage.status == "picking":
            self._finish_pick()
        elif stage.decision is not None:
            stage.time_left -= stage.robot.dt
            self._judge(stage.decision)

    def _action(self) -> Vec:
        """Return the wanted joint speeds over their limits, shape (5,)."""
        stage = self._stage
        if stage.status == "picking" and self._goal is not None:
            down = stage.status_s < PICK_S[1]
            posture = self._posture_over(self._goal, PICK_HEIGHT if down else None)
            return stage.robot.toward(posture)
        if stage.decision is not None:
            return np.asarray(stage.decision.actions[stage.decision.index], dtype=np.float64)
        return np.zeros(5)

    def _judge(self, decision: Decision) -> None:
        """See whether the episode ends at this state."""
        stage = self._stage
        if stage.robot.reached(stage.offered[decision.index].position):
            stage.count(reached=1)
            self._goal = decision.chosen
            stage.enter("picking")
        elif stage.time_left <= 0.0:
            stage.count(timeouts=1)
            self._run = self._run.finish("timeout", stage.t)
            self._begin_episode("moving" if self._case is None else "case done")

    def _finish_pick(self) -> None:
        if self._stage.status_s < PICK_S[2] and not self._stage.near:
            return
        if self._case is not None:
            self._stage.status = "case done"
            self._run = self._run.finish("reached", self._stage.t)
        else:
            self._cross_off(self._goal)
            self._begin_episode()

    def _cross_off(self, reached: str | None) -> None:
        """Take a reached station out until all have had their turn."""
        self._done.add(reached or "")
        if self._done.issuperset(self._selected):
            self._done = {reached or ""}

    def _wait(self) -> None:
        stage = self._stage
        if stage.status == "contact" and stage.status_s >= CONTACT_HOLD_S:
            if self._case is None:
                self._restart_robot()
            else:
                stage.status, self._goal = "case done", None
        elif stage.status == "blocked" and not stage.touches_here():
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
        stage = self._stage
        left = stage.decide(self._candidates())
        if stage.decision is None:
            return
        self._run = self._run.choose(stage.t, stage.decision.chosen)
        if left is not None:
            names = tuple(candidate.id for candidate in stage.offered)
            stage.tell(explanation.switched(stage.decision, names, left, stage.t, self._label))

    # What is seen.

    def _label(self, name: str) -> str:
        return self.cell.station(name).label

    def _shown_status(self) -> Status:
        if self._stage.status == "moving" and self._stage.decision is None:
            return "no policy" if self._selected else "no candidates"
        return self._stage.status

    def _message(self, status: Status) -> str:
        stage = self._stage
        if status == "contact" and stage.contact is not None:
            return explanation.touched(stage.contact, final=self._case is not None)
        if stage.note is not None and status in ("moving", "no policy"):
            return stage.note
        if status == "moving" and stage.decision is not None:
            names = tuple(candidate.id for candidate in stage.offered)
            return explanation.going(stage.decision, names, self._label)
        if status == "case done" and self._case is not None:
            if stage.contact is not None:
                return explanation.touched(stage.contact, final=True)
            verdict = judge(self._case, self._run, self._label)
            return explanation.case_ended(verdict, self._goal, self._label)
        return explanation.resting(status, self._goal, self._label)

    def _verdict(self) -> Verdict | None:
        return None if self._case is None else judge(self._case, self._run, self._label)

    def snapshot(self) -> WorldSnapshot:
        """Return what is known now, frozen."""
        status = self._shown_status()
        return self._stage.snapshot(
            status,
            self._message(status),
            gripping=status == "picking" and self._stage.status_s >= PICK_S[0],
            selected=self._selected,
            case=None if self._case is None else self._case.id,
            verdict=self._verdict(),
        )
