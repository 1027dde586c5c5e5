"""One live sorting cell: the robot carries out what the sorter chooses, whatever people do.

A move has two halves: to the block and with it. In each the pick policy brings the tool over
the place, beside the people (``approach``, ``carry``); inverse kinematics under the same limits
does the last centimetres, down and up again (``grasp``, ``place``). A grasp fails with the
cell's probability, drawn from (seed, task, attempt). After every attempt, and whenever somebody
changed blocks, goal or sorter, the sorter decides anew; a block at the magnet goes on, goes
elsewhere, or back to where it counts (``sorting_table.py``).

A person nearer than NEAR_M breaks inverse kinematics off, and the policy goes on.
With nothing to do the robot goes home. A motion that takes longer than TIME_LIMIT_S begins
again, for another block if one is as good; from less than SHORT_WAY_M it is then ended by
inverse kinematics. After a contact the robot starts again from home, and a held block falls
back to where it counts. Blocks and towers are no obstacles.

Source: METHOD 1.2, 1.5, 3.1 and section 4 (real pick and place instead of reaching).
"""

from dataclasses import replace

import numpy as np

from app.errors import ServiceError
from app.live import commands
from app.live.arm import Bodies
from app.live.base_world import CONTACT_HOLD_S, LiveStage, PeopleCommand
from app.live.commands import Command
from app.live.people.workers import LivePeople
from app.live.pick import explanation
from app.live.snapshot import Counters, Status, WorldSnapshot
from app.live.sorting import commands as sorting_commands
from app.live.sorting.benchmark_run import SortingTrial, random_task
from app.live.sorting.controller import Choice, LiveSorter, has_safer_twin
from app.live.sorting.explanation import DONE, NO_GOAL, Teller
from app.live.sorting.perceived_state import Sight, is_solved, view_of
from app.live.sorting.snapshot import Phase, SortingCounters
from app.live.sorting.table import SortingTable
from app.live.sorting.vertical_approach import Descent
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.pick.task_policy import Candidate, TaskPolicy
from app.sim.sorting.layout import above, reaching_cell
from app.sim.sorting.sorting_values import SortingValues
from app.sim.sorting.state import NULL

SHORT_WAY_M = 0.35
"""Distance from which a motion that took too long is ended by inverse kinematics [m]."""


class SortingWorld:
    """One live sorting cell; see ``live_world.py``.

    Args:
        cell: Sorting cell, see ``sorting_cell.lacks_for_sorting``.
        policy: Moves the arm, and chooses among twins; None lets the robot rest.
        seed: Seed of tasks, grasps and the people's work.
        id: Name of the world in URLs.
        sorter: Values the moves; None leaves them to the exact planner.
    """

    def __init__(
        self,
        cell: Cell,
        policy: TaskPolicy | None,
        seed: int,
        id: str = "main",
        sorter: SortingValues | None = None,
    ) -> None:
        self.cell, self.id, self._seed = cell, id, seed
        self._stage = LiveStage(cell, policy, id, LivePeople(reaching_cell(cell), seed))
        self._table = SortingTable(cell)
        self._teller = Teller(cell, self._table)
        self._sorter = LiveSorter(sorter)
        self._choice: Choice | None = None
        self._descent: Descent | None = None
        self._n_tasks = self._version = 0
        self._reset()

    # Starts and ends.

    def _reset(self) -> None:
        """Begin a random task, with everybody where they start."""
        self._stage.t, self._stage.counters = 0.0, Counters()
        for person in self._stage.people:
            person.start(None)
        start = random_task(self._table.shape, self._table.fail, self._seed, self._n_tasks)
        self._begin_task(None)
        self._table.begin(start)
        self._stage.forget_note()
        self._restart_robot()

    def _begin_task(self, trial: SortingTrial | None) -> None:
        self._n_tasks += 1
        self._trial, self._counts = trial, SortingCounters()
        self._sorter.begin()

    def _restart_robot(self) -> None:
        """Start from home; a held block falls back to where it counts."""
        stage, table = self._stage, self._table
        stage.robot.put(stage.robot.home)
        stage.contact = None
        if table.held is not None:
            block, seat = table.held, table.seat
            table.drop(seat)
            stage.tell(self._teller.fell(block, seat))
        self._think("blocked" if stage.touches_here() else "moving")

    # Commands.

    def apply(self, command: Command) -> None:
        """Carry out one command; what does not fit is also told in the message.

        Raises:
            ServiceError: The command does not fit this cell; nothing has changed.
        """
        stage = self._stage
        commands.check(command, self.cell, stage.people.ids)
        if isinstance(command, PeopleCommand):
            stage.change_people(command)
            self._refresh()
            return
        match command:
            case commands.Pause() | commands.Resume():
                stage.paused = isinstance(command, commands.Pause)
            case commands.StepOnce():
                stage.paused = True
                self._advance()
            case commands.Reset():
                self._reset()
            case commands.SetPolicy():
                stage.use(command.policy)
                self._refresh()
            case sorting_commands.StartTest():
                self._start_test(command.id)
            case sorting_commands.SetSorter():
                self._sorter.sorter = command.sorter
                self._changed()
            case _:
                self._change_table(command)

    def _change_table(self, command: Command) -> None:
        try:
            gone = sorting_commands.carry_out(command, self._table)
        except ServiceError as error:
            self._stage.tell(f"Ignored: {error.message}")
            raise
        if gone is not None:
            self._stage.tell(self._teller.shrunk(gone))
        if self._trial is not None:
            self._trial.note_visitor()
        self._changed()

    def _start_test(self, name: str) -> None:
        trial = SortingTrial(name, (self._seed, self._n_tasks))
        state = trial.start(self._table.shape, self._table.fail)
        self._begin_task(trial)
        self._table.begin(state)
        self._stage.paused = False
        self._stage.tell(trial.text)
        self._changed()

    def _changed(self) -> None:
        """Decide anew after somebody changed the task."""
        if self._stage.status == "moving":
            self._think()
        elif self._descent is not None and self._descent.step == "down":
            self._look_below(self._descent)

    def _look_below(self, descent: Descent) -> None:
        """See whether a grasp or place that has begun is still right; else go up again."""
        old = self._choice
        if old is not None:
            new = self._sorter.choose(self._table, old.move)
            if self._is_same(descent, old, new):
                self._version = self._table.version
                return
        self._choice = None
        descent.begin("up", self._stage.status_s)

    def _is_same(self, descent: Descent, old: Choice, new: Choice | None) -> bool:
        if new is None or (old.block, old.move) not in new.options:
            return False
        if descent.phase == "grasp":
            point = self._table.point_of(old.block)
            return point is not None and np.array_equal(point, descent.point)
        return self._table.held is not None and np.array_equal(
            self._table.point_at(new.move.place), descent.point
        )

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
        stage = self._stage
        before = stage.pass_period()
        if stage.status in ("contact", "blocked"):
            self._wait()
        else:
            self._move_robot(before)
        if stage.status == "moving":
            self._let_interfere()
            self._decide()

    def _wait(self) -> None:
        stage = self._stage
        if stage.status == "contact" and stage.status_s >= CONTACT_HOLD_S:
            self._restart_robot()
        elif stage.status == "blocked" and not stage.touches_here():
            self._think()

    def _move_robot(self, before: Bodies) -> None:
        """Carry out the action, the people having moved from where they were."""
        stage, descent = self._stage, self._descent
        straight = descent is not None or stage.decision is None
        found = stage.robot.advance(self._action(), stage.people, before, straight=straight)
        if found.kind != "none":
            self._descent = None
            stage.note_contact(found)
            if self._trial is not None:
                self._trial.note_contact()
        elif descent is not None:
            self._follow(descent)
        elif stage.decision is not None:
            stage.time_left -= stage.robot.dt
            self._judge(stage.decision.index)

    def _action(self) -> Vec:
        """Return the wanted joint speeds over their limits, shape (5,)."""
        stage = self._stage
        if self._descent is not None:
            aim = self._descent.aim(stage.robot.tcp())
            return stage.robot.toward(stage.robot.posture_at(aim)[0])
        if self._choice is None and stage.policy is not None:
            return stage.robot.toward(stage.robot.home)
        if stage.decision is not None:
            return np.asarray(stage.decision.actions[stage.decision.index], dtype=np.float64)
        return np.zeros(5)

    # Halves of a move.

    def _think(self, status: Status = "moving") -> None:
        """Decide on the next move and begin its motion."""
        kept = self._choice.move if self._choice is not None else None
        self._choice = self._sorter.choose(self._table, kept)
        self._version = self._table.version
        self._begin_motion(status)

    def _begin_motion(self, status: Status = "moving") -> None:
        self._descent = None
        self._stage.enter(status)
        self._stage.begin_motion()
        self._decide()

    def _judge(self, index: int) -> None:
        """See whether the policy's motion ends at this state."""
        stage = self._stage
        target = stage.offered[index]
        late = stage.time_left <= 0.0
        short = np.linalg.norm(stage.robot.tcp() - target.position) < SHORT_WAY_M
        if not stage.near and (stage.robot.reached(target.position) or (late and short)):
            stage.count(reached=1)
            self._go_down(target.id)
        elif late:
            self._give_up()

    def _give_up(self) -> None:
        """Begin anew what took too long, with another block where one is as good."""
        stage, choice = self._stage, self._choice
        stage.count(timeouts=1)
        if choice is None:
            return
        if self._table.held is None:
            self._sorter.avoid(choice.move.pick)
        stage.tell(self._teller.late(choice))
        self._think()

    def _go_down(self, name: str) -> None:
        """Go down to the block of that id, or to put the held one on its place."""
        table, choice = self._table, self._choice
        assert choice is not None
        if table.held is not None:
            descent = Descent(table.point_at(choice.move.place), "place")
        else:
            block, move = next(one for one in choice.options if one[0].id == name)
            self._choice = replace(choice, block=block, move=move)
            descent = Descent(table.point(*table.place_of(block)), "grasp")
        self._descent = descent
        self._stage.enter("picking")

    def _follow(self, descent: Descent) -> None:
        """Go on with a way down and up."""
        stage = self._stage
        tcp, over = stage.robot.tcp(), descent.is_over(stage.robot.tcp(), stage.status_s)
        if descent.step == "down" and not stage.near and descent.is_down(tcp):
            self._touch_down(descent)
        elif descent.step == "down" and (over or stage.near):
            self._begin_motion()
        elif descent.step == "hold" and over:
            descent.begin("up", stage.status_s)
        elif descent.step == "up" and (over or stage.near):
            self._after_rise()

    def _touch_down(self, descent: Descent) -> None:
        """Let the magnet close or open; it may miss."""
        descent.begin("hold", self._stage.status_s)
        choice = self._choice
        assert choice is not None
        if descent.phase == "grasp":
            self._grasp(choice)
            return
        self._table.drop(choice.move.place)
        if not choice.back:
            self._counts = replace(self._counts, moves=self._counts.moves + 1)
            self._sorter.end_attempt()

    def _grasp(self, choice: Choice) -> None:
        table, pick = self._table, choice.move.pick
        self._sorter.note_attempt(table, choice.move)
        rng = np.random.default_rng((self._seed, self._n_tasks, self._counts.attempts))
        risk = float(table.fail[pick]) if pick < table.shape.n_cells else 0.0
        if self._trial is not None and pick < table.shape.n_cells:
            self._trial.note_pick(riskier=has_safer_twin(table, pick))
        self._counts = replace(self._counts, attempts=self._counts.attempts + 1)
        if rng.random() >= risk:
            table.lift(pick)
            return
        self._counts = replace(self._counts, failures=self._counts.failures + 1)
        self._sorter.end_attempt()
        self._stage.tell(self._teller.missed(choice.block, risk))

    def _after_rise(self) -> None:
        same = self._version == self._table.version
        if self._table.held is not None and self._choice is not None and same:
            self._begin_motion()
        else:
            self._think()

    def _let_interfere(self) -> None:
        """Let the running test's person do what is due."""
        if self._trial is None or self._table.held is not None:
            return
        idle_s = self._stage.status_s if self._choice is None else 0.0
        done = self._trial.interfere(self._table.state, self._counts.moves, idle_s)
        if done is not None:
            self._table.adopt(done.state)
            self._stage.tell(done.text)
            self._changed()

    # Deciding.

    @property
    def _phase(self) -> Phase:
        if self._descent is not None:
            return self._descent.phase
        if self._choice is None:
            return "idle"
        return "carry" if self._table.held is not None else "approach"

    def _chosen(self) -> Choice | None:
        """Return the move with the block that the critic goes for now."""
        choice, decision = self._choice, self._stage.decision
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
        return tuple(
            Candidate(id=id, position=above(point)) for id, point in points if point is not None
        )

    def _decide(self) -> None:
        """Ask the policy about this very state."""
        if self._stage.status != "picking":
            self._stage.decide(self._candidates())

    def _refresh(self) -> None:
        """Decide afresh after people or the policy changed."""
        if self._stage.status == "moving":
            self._decide()

    # What is seen.

    def _shown_status(self) -> Status:
        stage = self._stage
        if stage.status != "moving" or stage.decision is not None:
            return stage.status
        if self._choice is not None:
            return "no policy"
        return "solved" if (self._table.goal != NULL).any() else "no candidates"

    def _message(self, status: Status) -> str:
        stage = self._stage
        if status == "contact" and stage.contact is not None:
            return explanation.touched(stage.contact, final=False)
        if stage.note is not None and status != "blocked":
            return stage.note
        if status in ("moving", "picking") and (chosen := self._chosen()) is not None:
            return self._teller.doing(self._phase, chosen, self._sorter)
        if status == "solved":
            return DONE
        if status == "no candidates":
            return NO_GOAL
        return explanation.resting(status, None, str)

    def snapshot(self) -> WorldSnapshot:
        """Return what is known now, frozen."""
        stage, status = self._stage, self._shown_status()
        closing = self._descent is not None and self._descent.step == "hold"
        sight = Sight(
            table=self._table,
            sorter=self._sorter,
            choice=self._chosen(),
            phase=self._phase,
            counters=replace(self._counts, hand_overs=self._sorter.hand_overs),
            test=None if self._trial is None else self._trial.name,
            tcp=stage.robot.tcp(),
        )
        return stage.snapshot(
            status,
            self._message(status),
            gripping=self._table.held is not None or (closing and self._phase == "grasp"),
            selected=(),
            case=None,
            sorting=view_of(sight),
            verdict=None
            if self._trial is None
            else self._trial.verdict(solved=is_solved(self._table), moves=self._counts.moves),
        )
