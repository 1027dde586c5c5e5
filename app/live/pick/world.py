"""Live pick-and-place world.

A policy that knows a single person sees the nearest one. A reached target is picked up (the
tool goes down and up again by inverse kinematics within the same limits), leaves the candidates
until all have been picked, and the next episode continues from there. A contact is shown for
two seconds; then the robot starts again from home.
"""

import numpy as np

from app.live import commands, status_messages
from app.live.arm import HumanGeometry
from app.live.base_world import BaseWorld
from app.live.command_checks import Command
from app.live.people.workers import LiveWorkers
from app.live.pick import explanation
from app.live.snapshot import Status, WorldSnapshot
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.pick.case_verdict import CaseRun, Verdict, judge
from app.sim.pick.cases import Case, find_case
from app.sim.pick.task_policy import Candidate, Decision, TaskPolicy

PICK_HEIGHT = 0.065
"""Height of the tcp over the table when the fingers close [m]."""
PICK_S = (0.9, 1.3, 2.0)
"""Times at which the tool is down, the fingers have closed, the tool is up again [s]."""


class LivePickWorld(BaseWorld[LiveWorkers]):
    """One live pick-and-place cell.

    Args:
        cell: Work cell.
        policy: Selects and executes tasks; None: the robot is idle.
        seed: Seed of the human motion.
        id: Name of the world in URLs.
    """

    def __init__(
        self, cell: Cell, policy: TaskPolicy | None, seed: int, id: str = "main"
    ) -> None:
        super().__init__(cell, policy, id, LiveWorkers(cell, seed))
        self._case: Case | None = None
        self._run = CaseRun()
        self._goal: str | None = None
        self._picked: set[str] = set()
        self._selected = tuple(s.id for s in cell.stations if s.kind == "cube")
        self._own_choice = self._selected
        self._reset()

    # Starts and ends.

    def _reset_scenario(self) -> None:
        self._run = CaseRun()
        for person in self.people:
            person.start(self._case)

    def _prepare_restart(self) -> None:
        self._picked = set()

    def _start_configuration(self) -> Vec:
        if self._case is None:
            return self.robot.home
        return self._configuration_over(self._case.robot_start)

    def _configuration_over(self, station: str, height: float | None = None) -> Vec:
        position = np.array(self.cell.station(station).position)
        if height is not None:
            position[2] = height
        return self.robot.configuration_at(position)[0]

    def _begin(self, status: Status = "moving") -> None:
        self.enter(status)
        self.begin_motion()
        self.clear_message()
        self._goal = None
        self._decide()

    # Commands.

    def _change_people(self, command: commands.PeopleCommand) -> None:
        self._leave_case()
        super()._change_people(command)

    def _change(self, command: Command) -> None:
        match command:
            case commands.SetCandidates():
                self._choose_among(set(command.ids))
            case commands.ToggleCandidate():
                self._choose_among(set(self._selected) ^ {command.id})
            case commands.SetPolicy():
                self.use(command.loaded)
                if self._case is None:
                    self._refresh()
                else:  # A run of a case study belongs to one policy.
                    self._reset()
            case commands.StartCase():
                self._start_case(find_case(command.id))
            case _:
                pass

    def _start_case(self, case: Case) -> None:
        self._case, self.paused = case, False
        self._selected = tuple(n for n in self.cell.station_ids if n in case.goals)
        self.people.only_first()
        self._reset()

    def _leave_case(self) -> None:
        if self._case is None:
            return
        self._case, self._selected = None, self._own_choice
        for person in self.people:
            person.leave_case()
        self._refresh()

    def _choose_among(self, ids: set[str]) -> None:
        self._leave_case()
        self._selected = tuple(name for name in self.cell.station_ids if name in ids)
        self._own_choice, self._picked = self._selected, set()
        self._refresh()

    def _refresh(self) -> None:
        if self.status == "case done":
            self._begin()
        else:
            super()._refresh()

    # Time.

    def _move_robot(self, before: HumanGeometry) -> None:
        straight = self.status == "picking"
        found = self.robot.advance(self._action(), self.people, before, straight=straight)
        if found.kind != "none":
            self.note_contact(found)
            self._run = self._run.finish("contact", self.t)
        elif self.status == "picking":
            self._finish_pick()
        elif self.decision is not None:
            self.time_left -= self.robot.dt
            self._end_episode(self.decision)

    def _action(self) -> Vec:
        """Return joint speeds over their limits, in [-1, 1], shape (5,)."""
        if self.status == "picking" and self._goal is not None:
            down = self.status_s < PICK_S[1]
            configuration = self._configuration_over(self._goal, PICK_HEIGHT if down else None)
            return self.robot.toward(configuration)
        if self.decision is not None:
            return np.asarray(self.decision.actions[self.decision.index], dtype=np.float64)
        return np.zeros(5)

    def _end_episode(self, decision: Decision) -> None:
        """End the episode if the target is reached or the time limit has passed."""
        if self.robot.reached(self.offered[decision.index].position):
            self.count(reached=1)
            self._goal = decision.chosen
            self.enter("picking")
        elif self.time_left <= 0.0:
            self.count(timeouts=1)
            self._run = self._run.finish("timeout", self.t)
            self._begin("moving" if self._case is None else "case done")

    def _finish_pick(self) -> None:
        if self.status_s < PICK_S[2] and not self.near:
            return
        if self._case is not None:
            self.status = "case done"
            self._run = self._run.finish("reached", self.t)
        else:
            self._note_picked(self._goal)
            self._begin()

    def _note_picked(self, reached: str | None) -> None:
        """Remove a picked station from the candidates until all have been picked."""
        self._picked.add(reached or "")
        if self._picked.issuperset(self._selected):
            self._picked = {reached or ""}

    def _end_contact(self) -> None:
        if self._case is None:
            self._restart_robot()
        else:
            self.status, self._goal = "case done", None

    # Deciding.

    def _candidates(self) -> tuple[Candidate, ...]:
        names = [name for name in self._selected if name not in self._picked]
        return tuple(
            Candidate(id=name, position=np.array(self.cell.station(name).position))
            for name in names or self._selected
        )

    def _decide(self) -> None:
        left = self.query(self._candidates())
        if self.decision is None:
            return
        self._run = self._run.choose(self.t, self.decision.chosen)
        if left is not None:
            names = tuple(candidate.id for candidate in self.offered)
            self.set_message(
                explanation.switched(self.decision, names, left, self.t, self._label)
            )

    # Read model.

    def _label(self, name: str) -> str:
        return self.cell.station(name).label

    def _shown_status(self) -> Status:
        if self.status == "moving" and self.decision is None:
            return "no policy" if self._selected else "no candidates"
        return self.status

    def _message(self, status: Status) -> str:
        if status == "contact" and self.contact is not None:
            return status_messages.touched(self.contact, final=self._case is not None)
        if self.note is not None and status in ("moving", "no policy"):
            return self.note
        if status == "moving" and self.decision is not None:
            names = tuple(candidate.id for candidate in self.offered)
            return explanation.going(self.decision, names, self._label)
        if status == "case done" and self._case is not None:
            if self.contact is not None:
                return status_messages.touched(self.contact, final=True)
            verdict = judge(self._case, self._run, self._label)
            return explanation.case_ended(verdict, self._goal, self._label)
        return status_messages.resting(status, self._goal, self._label)

    def _verdict(self) -> Verdict | None:
        return None if self._case is None else judge(self._case, self._run, self._label)

    def snapshot(self) -> WorldSnapshot:
        """Return the read model of the present state."""
        status = self._shown_status()
        return self._snapshot(
            status,
            self._message(status),
            gripping=status == "picking" and self.status_s >= PICK_S[0],
            selected=self._selected,
            case=None if self._case is None else self._case.id,
            verdict=self._verdict(),
        )
