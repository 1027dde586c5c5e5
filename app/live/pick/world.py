"""Live pick-and-place world.

The policy moves the robot in all phases of a pick (``sim/pick/kernels/grasp.py``). A picked
station leaves the candidates until all have been picked, and the next pick continues from
there; a pick that was broken off stays a candidate. Beside people at rest a planner moves the
robot (``sim/pick/resting_people.py``). A case study has neither planner nor safety layer, as in
its source.
"""

from dataclasses import replace

import numpy as np

from app.live import commands, status_messages
from app.live.arm import HumanGeometry
from app.live.base_world import BaseWorld
from app.live.command_checks import Command
from app.live.people.workers import LiveWorkers
from app.live.pick import explanation
from app.live.pick.risk_worker import RiskQuery
from app.live.snapshot import Status, WorldSnapshot
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.pick.case_verdict import CaseRun, End, Verdict, judge
from app.sim.pick.cases import Case, find_case
from app.sim.pick.kernels.grasp import APPROACH, DESCEND, next_phase
from app.sim.pick.task_policy import Candidate, ChoiceTerms, Decision, PickProgress, TaskPolicy
from app.sim.robot.trajectory_segment import TrajectorySegment


class LivePickWorld(BaseWorld[LiveWorkers]):
    """One live pick-and-place cell; the arguments are those of ``factory.new_world``."""

    def __init__(
        self, cell: Cell, policy: TaskPolicy | None, seed: int, id: str = "main"
    ) -> None:
        super().__init__(cell, policy, id, LiveWorkers(cell, seed))
        self._case: Case | None = None
        self._run = CaseRun()
        self._goal: str | None = None
        self._picked: set[str] = set()
        self._selected = tuple(cube.id for cube in cell.stations_of("cube"))
        self._own_choice = self._selected
        self._reset()
        self._plan()

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

    def _configuration_over(self, station: str) -> Vec:
        return self.robot.configuration_at(np.array(self.cell.station(station).position))[0]

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
                self._change_policy(command.loaded)
            case commands.StartCase():
                self._start_case(find_case(command.id))

    def _change_policy(self, policy: TaskPolicy | None) -> None:
        grasps = {one.grasp for one in (self.policy, policy) if one is not None}
        self.use(policy)
        if self._case is not None:  # A run of a case study belongs to one policy.
            self._reset()
        elif self.status == "picking" and len(grasps) > 1:
            self._begin()  # Phases of one grasp have no meaning in another.
        else:
            self._refresh()

    def _start_case(self, case: Case) -> None:
        self._case, self.paused = case, False
        self.safety.suspended = True  # the thesis has no safety layer
        self._selected = tuple(n for n in self.cell.station_ids if n in case.goals)
        self.people.only_first()
        self._reset()

    def _leave_case(self) -> None:
        if self._case is None:
            return
        self._case, self._selected = None, self._own_choice
        self.safety.suspended = False
        for person in self.people:
            person.begin_work()
        self._refresh()

    def _choose_among(self, ids: set[str]) -> None:
        self._leave_case()
        self._selected = tuple(name for name in self.cell.station_ids if name in ids)
        self._own_choice, self._picked = self._selected, set()
        if self.decision is None or self.decision.chosen not in ids:
            self.begin_motion()
        self._refresh()

    def _refresh(self) -> None:
        if self.status == "case done" and self.contact is not None:
            self._restart_robot()
        elif self.status == "case done":
            self._begin()
        elif self.status == "picking":
            self._decide()
        else:
            super()._refresh()

    # Time.

    def _after_period(self) -> None:
        if self.status in ("moving", "picking"):
            self._decide()
        decision, phase = self.decision if self._case is None else None, self.progress.phase
        self.planner.update(self.people, self.policy, decision, self.offered, phase)

    def _wanted(self) -> TrajectorySegment:
        if self.decision is not None and self.status in ("moving", "picking"):
            return self.planner.segment(self.decision)
        return self.robot.segment(np.zeros(5), straight=True)

    def _move_robot(self, before: HumanGeometry) -> None:
        if self.follow_plan(before):
            self._run = self._run.finish("contact", self.t)
        elif self.decision is not None:
            self.time_left -= self.robot.dt
            self.safety.count(self.robot.dt)
            if self._advance_pick(self.decision):
                self._finish_pick(self.decision.chosen)
            elif self.time_left <= 0.0:
                self.count(timeouts=1)
                self._end_motion("timeout")

    def _advance_pick(self, decision: Decision) -> bool:
        """Enter the phase that follows; return whether the pick has succeeded."""
        target = self.offered[decision.index].position
        assert self.policy is not None
        rules, before = self.policy.grasp, self.progress
        if rules.depth == 0.0:
            return self.robot.reached(target)
        tool = self.robot.tool(target)
        phase, closing, lifted = next_phase(
            rules, before.phase, before.closing_s, as_kernel_array(target), tool, self.robot.dt
        )
        self.progress = PickProgress(phase=phase, closing_s=closing)
        if before.phase == DESCEND and phase == APPROACH:
            self.count(broken_off=1)
        status: Status = "moving" if phase == APPROACH else "picking"
        if status != self.status:
            self.enter(status)
        return lifted

    def _finish_pick(self, station: str) -> None:
        self.count(reached=1)
        self._goal = station
        if self._case is None:
            self._note_picked(station)
        self._end_motion("reached")

    def _end_motion(self, end: End) -> None:
        """Begin the next motion; in a case study end the run, and the robot stands still."""
        if self._case is None:
            self._begin()
        else:
            self._run = self._run.finish(end, self.t)
            self.robot.halt()
            self.enter("case done")

    def _note_picked(self, station: str) -> None:
        """Remove a picked station from the candidates until all have been picked."""
        self._picked.add(station)
        if self._picked.issuperset(self._selected):
            self._picked = {station}

    def _end_contact(self) -> None:
        if self._case is None:
            self._restart_robot()
        else:
            self.status, self._goal = "case done", None

    # Deciding.

    def _candidates(self) -> tuple[Candidate, ...]:
        names = [name for name in self._selected if name not in self._picked]
        found = tuple(
            Candidate(id=name, position=np.array(self.cell.station(name).position))
            for name in names or self._selected
        )
        if self._case is not None:
            return found
        begun = None
        if self.decision is not None and self.progress.phase != APPROACH:
            begun = self.decision.chosen
        return self.planner.unblocked(self.people, self.policy, found, begun)

    def _decide(self) -> None:
        left = self.query(self._candidates())
        if self.decision is None:
            if self.status == "picking":  # Policy or candidates are gone.
                self.enter("moving")
            return
        self._run = self._run.choose(self.t, self.decision.chosen)
        if self.status == "picking" and self.progress.phase == APPROACH:
            self.enter("moving")  # another target
        if left is not None:
            names = tuple(candidate.id for candidate in self.offered)
            self.set_message(
                explanation.target_switch(self.decision, names, left, self.t, self._label)
            )

    def risk_query(self) -> RiskQuery | None:
        """Return the present state for a risk map; None without a decision or a person."""
        people = [person.as_observed() for person in self.people]
        if self.policy is None or self.decision is None or not people:
            return None
        return RiskQuery(
            policy=self.policy,
            q=self.robot.q.copy(),
            qd=self.robot.qd.copy(),
            people=[replace(one, q=one.q.copy(), qd=one.qd.copy()) for one in people],
            person=self.people.ids[0],
            offered=self.offered,
            terms=ChoiceTerms(
                previous=self.previous, progress=self.progress, time_left_s=self.time_left
            ),
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
            return status_messages.contact_message(self.contact, final=self._case is not None)
        if self.note is not None and status in ("moving", "picking", "no policy"):
            return self.note
        if status in ("moving", "picking") and (reason := self.slowed()) is not None:
            return reason
        if status == "picking" and self.decision is not None:
            return explanation.pick_phase(self.decision, self.progress, self._label)
        if status == "moving" and self.decision is not None:
            names = tuple(candidate.id for candidate in self.offered)
            planned = self.planner.message(self._label(self.decision.chosen))
            return planned or explanation.target_choice(self.decision, names, self._label)
        if status == "case done" and self._case is not None:
            if self.contact is not None:
                return status_messages.contact_message(self.contact, final=True)
            verdict = judge(self._case, self._run, self._label)
            return explanation.case_outcome(verdict, self._goal, self._label)
        return status_messages.standstill_message(status)

    def _verdict(self) -> Verdict | None:
        return None if self._case is None else judge(self._case, self._run, self._label)

    def snapshot(self) -> WorldSnapshot:
        """Return the read model of the present state."""
        status = self._shown_status()
        return self._snapshot(
            status,
            self._message(status),
            gripping=status == "picking" and self.progress.closing_s > 0.0,
            selected=self._selected,
            case=None if self._case is None else self._case.id,
            verdict=self._verdict(),
        )
