"""Live sorting world: the robot executes the moves that policy or planner choose.

A move has two halves: to the block and with the block. In each half the pick policy moves the
tool over the place (``approach``, ``carry``), and inverse kinematics within the same limits
covers the last centimetres down and up again (``grasp``, ``place``). A grasp fails with the
cell's probability, drawn from (seed, task, attempt). After every attempt and after every change
of blocks, goal or policy the next move is chosen again; a held block then continues, goes
elsewhere, or back to where it counts (``table.py``).

A person nearer than NEAR_M interrupts inverse kinematics, and the policy continues. Without a
move the robot returns home. A motion that reaches the time limit starts again, with another
block of equal value if there is one; within SHORT_M of the goal inverse kinematics completes
it. After a contact the robot starts again from home, and a held block returns to where it
counts. Blocks and towers are no obstacles.

Source: docs/method.md 1.2, 1.5, 3.1 and 4 (real pick and place instead of reaching).
"""

from dataclasses import replace

import numpy as np

from app.errors import ServiceError
from app.live import status_messages
from app.live.arm import HumanGeometry
from app.live.base_world import BaseWorld
from app.live.command_checks import Command
from app.live.commands import SetPolicy
from app.live.people.workers import LiveWorkers
from app.live.snapshot import Status, WorldSnapshot
from app.live.sorting.benchmark_run import SortingTestRun, random_task
from app.live.sorting.commands import PlanningCommand, StartTest, TableCommand, change_table
from app.live.sorting.controller import MoveChoice, SortController, has_safer_duplicate
from app.live.sorting.explanation import WITHOUT_MOVE, StatusMessages
from app.live.sorting.snapshot import Phase, SortingCounters
from app.live.sorting.table import SortingTable
from app.live.sorting.task_snapshot import is_solved, task_snapshot
from app.live.sorting.vertical_approach import VerticalApproach
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.pick.task_policy import Candidate, TaskPolicy
from app.sim.robot.trajectory_segment import TrajectorySegment
from app.sim.sorting.layout import above, reaching_cell
from app.sim.sorting.sorting_values import SortingValues
from app.sim.sorting.state import NULL

SHORT_M = 0.35
"""Distance from which inverse kinematics completes a motion that reached its limit [m]."""


class LiveSortingWorld(BaseWorld[LiveWorkers]):
    """One live sorting cell; the arguments are those of ``factory.new_world``."""

    def __init__(
        self,
        cell: Cell,
        policy: TaskPolicy | None,
        seed: int,
        id: str = "main",
        sorting_policy: SortingValues | None = None,
    ) -> None:
        super().__init__(cell, policy, id, LiveWorkers(reaching_cell(cell), seed))
        self._seed = seed
        self._table = SortingTable(cell)
        self._messages = StatusMessages(cell, self._table)
        self._controller = SortController(sorting_policy)
        self._choice: MoveChoice | None = None
        self._vertical: VerticalApproach | None = None
        self._n_tasks = self._version = 0
        self._reset()
        self._plan()

    # Starts and ends.

    def _reset_scenario(self) -> None:
        for person in self.people:
            person.start(None)
        start = random_task(self._table.shape, self._table.fail, self._seed, self._n_tasks)
        self._begin_task(None)
        self._table.begin(start)
        self.clear_message()

    def _begin_task(self, test: SortingTestRun | None) -> None:
        self._n_tasks += 1
        self._test, self._counts = test, SortingCounters()
        self._controller.begin()

    def _prepare_restart(self) -> None:
        table = self._table
        if table.held is not None:
            block, position = table.held, table.held_position
            table.drop(position)
            self.set_message(self._messages.returned_block(block, position))

    # Commands.

    def _change(self, command: Command) -> None:
        match command:
            case SetPolicy():
                self.use(command.loaded)
                self._refresh()
            case StartTest():
                self._start_test(command.id)
            case _ if isinstance(command, PlanningCommand):
                self._controller.change(command)
                self._replan()
            case _ if isinstance(command, TableCommand):
                self._change_table(command)

    def _change_table(self, command: TableCommand) -> None:
        try:
            gone = change_table(command, self._table)
        except ServiceError as error:
            self.set_message(f"Ignored: {error.message}")
            raise
        if gone is not None:
            self.set_message(self._messages.removed_goal_block(gone))
        if self._test is not None:
            self._test.note_visitor()
        self._replan()

    def _start_test(self, name: str) -> None:
        test = SortingTestRun(name, (self._seed, self._n_tasks))
        state = test.start(self._table.shape, self._table.fail)
        self._begin_task(test)
        self._table.begin(state)
        self.paused = False
        self.set_message(test.text)
        self._replan()

    def _replan(self) -> None:
        """Choose the next move again after the task changed."""
        if self.status in ("moving", "blocked"):
            self._begin(self.status)
        elif self._vertical is not None and self._vertical.step == "down":
            self._check_vertical(self._vertical)

    def _check_vertical(self, vertical: VerticalApproach) -> None:
        """Continue a grasp or place that is still chosen; otherwise move up again."""
        old = self._choice
        if old is not None:
            new = self._controller.choose(self._table, old.move)
            if self._is_same(vertical, old, new):
                self._version = self._table.version
                return
        self._choice = None
        vertical.begin("up", self.status_s)

    def _is_same(
        self, vertical: VerticalApproach, old: MoveChoice, new: MoveChoice | None
    ) -> bool:
        if new is None or (old.block, old.move) not in new.options:
            return False
        if vertical.phase == "grasp":
            point = self._table.point_of(old.block)
            return point is not None and np.array_equal(point, vertical.point)
        return self._table.held is not None and np.array_equal(
            self._table.point_at(new.move.place), vertical.point
        )

    # Time.

    def _after_period(self) -> None:
        if self.status == "moving":
            self._let_interfere()
            self._decide()
        decision, phase = self.decision, self.progress.phase
        decision = decision if self.status == "moving" else None
        self.planner.update(self.people, self.policy, decision, self.offered, phase)

    def _move_robot(self, before: HumanGeometry) -> None:
        vertical = self._vertical
        if self.follow_plan(before):
            self._vertical = None
            if self._test is not None:
                self._test.note_contact()
        elif vertical is not None:
            self.safety.count(self.robot.dt)
            self._continue_vertical(vertical)
        elif self.decision is not None:
            self.safety.count(self.robot.dt)
            self.time_left -= self.robot.dt
            self._end_motion(self.decision.index)

    def _wanted(self) -> TrajectorySegment:
        if self.status == "moving" and self.decision is not None:
            return self.planner.segment(self.decision)
        return self.robot.segment(self._action(), straight=True)

    def _action(self) -> Vec:
        """Return joint speeds over their limits without the policy, in [-1, 1], shape (5,)."""
        if self.status not in ("moving", "picking"):
            return np.zeros(5)
        if self._vertical is not None:
            aim = self._vertical.aim(self.robot.tcp())
            return self.robot.toward(self.robot.configuration_at(aim)[0])
        if self._choice is None and self.policy is not None:
            return self.robot.toward(self.robot.home)
        return np.zeros(5)

    # Halves of a move.

    def _begin(self, status: Status = "moving") -> None:
        """Choose the next move and begin its motion."""
        kept = self._choice.move if self._choice is not None else None
        self._choice = self._controller.choose(self._table, kept, self.robot.tcp())
        self._version = self._table.version
        self._start_motion(status)

    def _start_motion(self, status: Status = "moving") -> None:
        self._vertical = None
        self.enter(status)
        self.begin_motion()
        self._decide()

    def _end_motion(self, index: int) -> None:
        """End the policy's motion at its target or at the time limit."""
        target = self.offered[index]
        late = self.time_left <= 0.0
        short = np.linalg.norm(self.robot.tcp() - target.position) < SHORT_M
        if not self.near and (self.robot.reached(target.position) or (late and short)):
            self.count(reached=1)
            self._begin_vertical(target.id)
        elif late:
            self._give_up()

    def _give_up(self) -> None:
        """Start again after the time limit, with another block of equal value if any."""
        choice = self._chosen()
        self.count(timeouts=1)
        if choice is None:
            return
        if self._table.held is None:
            self._controller.avoid(choice.move.pick)
        self.set_message(self._messages.timeout(self._phase, choice))
        self._begin()

    def _begin_vertical(self, name: str) -> None:
        """Move down to the block of that id, or to the place of the held one."""
        table, choice = self._table, self._choice
        assert choice is not None
        if table.held is not None:
            vertical = VerticalApproach(table.point_at(choice.move.place), "place")
        else:
            block, move = next(one for one in choice.options if one[0].id == name)
            self._choice = replace(choice, block=block, move=move)
            vertical = VerticalApproach(table.point(*table.place_of(block)), "grasp")
        self._vertical = vertical
        self.enter("picking")

    def _continue_vertical(self, vertical: VerticalApproach) -> None:
        """Continue a vertical approach or retreat."""
        tcp, over = self.robot.tcp(), vertical.is_over(self.robot.tcp(), self.status_s)
        if vertical.step == "down" and not self.near and vertical.is_down(tcp):
            self._actuate_gripper(vertical)
        elif vertical.step == "down" and (over or self.near):
            self._start_motion()
        elif vertical.step == "hold" and over:
            vertical.begin("up", self.status_s)
        elif vertical.step == "up" and (over or self.near):
            self._end_vertical()

    def _actuate_gripper(self, vertical: VerticalApproach) -> None:
        """Close or open the gripper; a grasp may fail."""
        vertical.begin("hold", self.status_s)
        choice = self._choice
        assert choice is not None
        if vertical.phase == "grasp":
            self._grasp(choice)
            return
        self._table.drop(choice.move.place)
        if not choice.back:
            self._counts = replace(self._counts, moves=self._counts.moves + 1)
            self._controller.end_attempt()

    def _grasp(self, choice: MoveChoice) -> None:
        table, pick = self._table, choice.move.pick
        self._controller.note_attempt(table, choice.move)
        rng = np.random.default_rng((self._seed, self._n_tasks, self._counts.attempts))
        risk = float(table.fail[pick]) if pick < table.shape.n_slots else 0.0
        if self._test is not None and pick < table.shape.n_slots:
            self._test.note_pick(riskier=has_safer_duplicate(table, pick))
        self._counts = replace(self._counts, attempts=self._counts.attempts + 1)
        if rng.random() >= risk:
            table.lift(pick)
            return
        self._counts = replace(self._counts, failures=self._counts.failures + 1)
        self._controller.end_attempt()
        self.set_message(self._messages.failed_grasp(choice.block, risk))

    def _end_vertical(self) -> None:
        same = self._version == self._table.version
        if self._table.held is not None and self._choice is not None and same:
            self._start_motion()
        else:
            self._begin()

    def _let_interfere(self) -> None:
        """Apply the next interference of the running test when it is due."""
        if self._test is None or self._table.held is not None:
            return
        idle_s = self.status_s if self._choice is None else 0.0
        done = self._test.interfere(self._table.state, self._counts.moves, idle_s)
        if done is not None:
            state, text = done
            self._table.adopt(state)
            self.set_message(text)
            self._replan()

    # Deciding.

    @property
    def _phase(self) -> Phase:
        if self._vertical is not None:
            return self._vertical.phase
        if self._choice is None:
            return "idle"
        return "carry" if self._table.held is not None else "approach"

    def _chosen(self) -> MoveChoice | None:
        """Return the move with the block that the critic prefers at present."""
        choice, decision = self._choice, self.decision
        if choice is None or decision is None or self._phase != "approach":
            return choice
        found = [one for one in choice.options if one[0].id == decision.chosen]
        return replace(choice, block=found[0][0], move=found[0][1]) if found else choice

    def _candidates(self) -> tuple[Candidate, ...]:
        choice, table = self._choice, self._table
        if choice is None:
            return ()
        if table.held is not None:
            name = table.names.stations[choice.move.place]
            point = above(self._table.point_at(choice.move.place))
            return (Candidate(id=name, position=point),)
        points = [(block.id, table.point_of(block)) for block, _ in choice.options]
        found = tuple(Candidate(id=id, position=above(p)) for id, p in points if p is not None)
        return self.planner.unblocked(self.people, self.policy, found)

    def _decide(self) -> None:
        if self.status != "picking":
            self.query(self._candidates())

    # Read model.

    def _shown_status(self) -> Status:
        if self.status != "moving" or self.decision is not None:
            return self.status
        if self._choice is not None:
            return "no policy"
        return "solved" if (self._table.goal != NULL).any() else "no candidates"

    def _message(self, status: Status) -> str:
        if status == "contact" and self.contact is not None:
            return status_messages.contact_message(self.contact, final=False)
        if self.note is not None and status != "blocked":
            return self.note
        if status in ("moving", "picking") and (reason := self.slowed()) is not None:
            return reason
        if status in ("moving", "picking") and (chosen := self._chosen()) is not None:
            return self._messages.motion(self._phase, chosen, self._controller, self.decision)
        return WITHOUT_MOVE.get(status) or status_messages.standstill_message(status)

    def snapshot(self) -> WorldSnapshot:
        """Return the read model of the present state."""
        status = self._shown_status()
        closing = self._vertical is not None and self._vertical.step == "hold"
        task = task_snapshot(
            self._table,
            self._controller,
            self._chosen(),
            phase=self._phase,
            counters=replace(
                self._counts, planner_fallbacks=self._controller.planner_fallbacks
            ),
            test=None if self._test is None else self._test.name,
            tcp=self.robot.tcp(),
        )
        return self._snapshot(
            status,
            self._message(status),
            gripping=self._table.held is not None or (closing and self._phase == "grasp"),
            sorting=task,
            verdict=None
            if self._test is None
            else self._test.verdict(solved=is_solved(self._table), moves=self._counts.moves),
        )
