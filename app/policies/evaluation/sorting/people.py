"""Protocol ``sorting-people``: full sorting tasks beside a working person.

Ten objects are sorted in ``sorting-e0`` by the pick policy, which executes every grasp and
every placement as a whole pick (approach, descent, closing or opening gripper, lift). The cell
differs from that of the policy only in its stations; clutter slots and towers are its cubes and
docks. Blocks are no obstacles, as in the live cell. All tasks run side by side in one batch;
the person works on and does not avoid the robot.

The safety layer lies between policy and robot, with the assumptions ``AMONG_HANDS``; the rows
``...-no-ssm`` are the same tasks without it. This person's hands are sometimes faster than it
assumes; the layer of the row ``critic-fast-hands`` has ``FAST_HANDS``. A person may touch the
robot at standstill. After a contact of the moving robot it stops, waits until the person is
away and begins its motion again. A motion that reaches the time limit begins again, too, with
the choice of the order rule, and so does one with one-step bounds that becomes unfeasible. A
task that is not finished within ``LIMIT_S`` has failed.

Each order rule (``order_rules.py``) runs the same tasks, with the same people and grasps.

Source: docs/method.md 3.1, 3.6 and 4 (the critic's values for the symbolic choice). Ours.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.pick.episodes import ObservedPeople, observe_exactly, settings_for
from app.policies.evaluation.pick.ssm import FAST_HANDS
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.sorting.full_tasks import FullTasks
from app.policies.evaluation.sorting.order_rules import (
    ORDER_RULES,
    OrderRule,
    OrderView,
    critic,
)
from app.policies.evaluation.sorting.task_states import NOTHING, TaskStates
from app.policies.evaluation.statistics import Flags, Index, count_difference, mean_of
from app.policies.inference.task_selection import HYSTERESIS
from app.policies.inference.value_networks import ValueNetworks, pick_preset_of
from app.sim.cells.cell import Cell, load_cell
from app.sim.core.arrays import Vec
from app.sim.core.kernels import rng as random
from app.sim.people.kernels.motion import draw_script_of
from app.sim.people.kernels.people import SCRIPTED
from app.sim.pick.batch import (
    PickBatch,
    PickSettings,
    observation_workspace_of,
    queries,
    target_configurations,
)
from app.sim.pick.hand_speeds import hand_speeds
from app.sim.pick.kernels.grasp import APPROACH, LIFT
from app.sim.pick.kernels.observation import observe_batch
from app.sim.pick.kernels.observation_layout import LAYOUT
from app.sim.pick.monitored_batch import AMONG_HANDS, MonitoredPickBatch
from app.sim.robot.kernels.arm import CONTROLLED, new_robot_pose, place_robot
from app.sim.safety.layer import SafetySettings
from app.sim.scenario.kernels.episode import COLLISION, RUNNING, SUCCESS, TIMEOUT, UNFEASIBLE
from app.sim.scenario.kernels.monitored_state import PERIODS, STOPPED, TOUCHED_AT_REST
from app.sim.scenario.monitoring import MonitoringSettings
from app.sim.sorting.layout import APPROACH_M, above, reaching_cell, require_workspace
from app.sim.sorting.near_optimal_moves import MARGIN

CELL = "sorting-e0"
DEFAULT_TASKS = 300
N_OBJECTS = 10
LIMIT_S = 600.0
"""Time after which a task has failed [s]."""
MOTION_LIMIT_S = 20.0
"""Time limit of one motion [s]."""
NO_SSM, WITH_FAST_HANDS = "-no-ssm", "-fast-hands"
"""Suffixes of rows: without the safety layer, and with one that assumes faster hands."""
PLACE_TIME_S = 10.0
"""Time left of a motion that is valued before its object is picked [s]."""
PAUSE_S = 1.0
"""Pause of a person between two scripts [s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CellCondition:
    """Safety layer and motion of the robot."""

    safety: SafetySettings = AMONG_HANDS
    """Assumptions of the safety layer."""
    active: bool = True
    """Whether the safety layer acts."""
    straight: bool = False
    """Whether each motion is the straight joint move, not that of the policy."""


USUAL = CellCondition()
"""The policy under the safety layer."""


class SortingBesidePeople:
    """Full tasks of one seed, run once per order rule."""

    def __init__(
        self,
        networks: ValueNetworks,
        cell: Cell,
        settings: PickSettings,
        n_tasks: int,
        seed: int,
        condition: CellCondition = USUAL,
    ) -> None:
        self._networks, self._seed = networks, seed
        self._straight = condition.straight
        if condition.straight:
            by_speed = replace(settings.action, meaning="speed")
            settings = replace(settings, action=by_speed)
        self.batch = MonitoredPickBatch(
            reaching_cell(cell),
            n_tasks,
            seed,
            settings,
            condition.safety,
            MonitoringSettings(active=condition.active, rest_ends=False),
        )
        self.tasks = TaskStates(cell, n_tasks, N_OBJECTS, seed)
        grasp = settings.grasp
        self._goals = above(self.tasks.points, grasp.depth or APPROACH_M)
        found = target_configurations(self.batch.arm, grasp, self._goals)
        self._q_goals, self._q_grasps, _ = found
        self._workspace = observation_workspace_of(self.batch.cell)

    def run(self, rule: OrderRule) -> FullTasks:
        """Run all tasks under an order rule."""
        batch, n = self.batch, self.batch.n_envs
        self._begin()
        act = np.zeros((n, CONTROLLED), dtype=np.float32)
        while (rows := self._running()).size:
            self._release()
            going = rows[~self._waiting[rows]]
            act[:] = 0.0
            if going.size:
                act[going] = self._steer(going, rule)
            touched = batch.account[:, TOUCHED_AT_REST].copy()
            batch.step(act, auto_reset=False, features=False)
            self._count_touches(rows, batch.account[:, TOUCHED_AT_REST] > touched)
            self._settle(rows)
            self._renew_scripts(rows)
        state, tasks, account = batch.state, self.tasks, batch.account
        finished = state.outcome == SUCCESS
        return FullTasks(
            finished=finished,
            cycle_s=np.where(finished, state.elapsed, LIMIT_S),
            moving=self._moving,
            resting=self._resting,
            stopped=account[:, STOPPED] / account[:, PERIODS],
            parts=tasks.moves.copy(),
            attempts=tasks.attempts.copy(),
            late=self._late,
            options=tasks.options.copy(),
        )

    def _begin(self) -> None:
        """Start all tasks, with the robots at home."""
        batch, n = self.batch, self.batch.n_envs
        batch.reset()
        batch.set_starts(np.tile(batch.arm.home, (n, 1)))
        self.tasks.begin()
        self._scripts = np.zeros(n, dtype=np.int64)
        self._chosen = np.full(n, -1)
        self._waiting, self._touched = (np.zeros(n, dtype=np.bool_) for _ in range(2))
        self._moving, self._resting, self._late = (np.zeros(n, np.int64) for _ in range(3))
        for e in range(n):
            self._begin_motion(e)

    def _running(self) -> Index:
        state = self.batch.state
        return np.flatnonzero((state.outcome == RUNNING) & (state.elapsed < LIMIT_S))

    def _begin_motion(self, e: int) -> None:
        """Begin a motion of one task, with the whole time limit and no choice."""
        state = self.batch.state
        state.phase[e], state.closing[e] = APPROACH, 0.0
        state.time_left[e] = self.batch.settings.time_limit_s
        state.outcome[e], self._chosen[e] = RUNNING, -1

    # Choice and motion.

    def _steer(self, rows: Index, rule: OrderRule) -> NDArray[np.float32]:
        """Choose the targets of tasks and return the policy's actions, shape (n, 5)."""
        state, tasks = self.batch.state, self.tasks
        counts = np.array([len(tasks.targets[e]) for e in rows])
        owner = np.repeat(np.arange(len(rows)), counts)
        point = np.concatenate([tasks.targets[e] for e in rows])
        place = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
        env, observed = rows[owner], observe_exactly(self.batch, rows)
        phase = np.where(place == self._chosen[env], state.phase[env], APPROACH)
        progress = phase, np.where(phase != APPROACH, state.closing[env], 0.0)
        robot, left = (state.q[env], state.qd[env]), state.time_left[env]
        obs = self._observe(robot, observed.of(owner), point, progress, left)
        act, value, _ = self._networks.evaluate(obs, predict=False)
        act = obs[:, LAYOUT["base"]] if self._straight else act
        later = np.flatnonzero((tasks.held[env] == NOTHING) & (counts[owner] > 1))
        if rule is critic and later.size:
            ends = np.concatenate([tasks.places[e] for e in rows])[later]
            value = value.copy()
            value[later] += self._place_values(point[later], ends, observed.of(owner[later]))
        shape = (len(rows), int(counts.max()))
        values, distances = np.full(shape, -np.inf, np.float32), np.full(shape, np.inf)
        actions, points = np.zeros((*shape, CONTROLLED), np.float32), np.zeros(shape, np.int64)
        away = self._goals[point] - obs[:, LAYOUT["tcp"]]
        distances[owner, place] = np.linalg.norm(away, axis=1)
        values[owner, place], actions[owner, place], points[owner, place] = value, act, point
        before = self._chosen[rows]
        choice = rule(OrderView(values=values, distances=distances, chosen=before))
        lifting = (state.phase[rows] == LIFT) & (before >= 0)
        choice = np.where(lifting, before, choice)
        self._chosen[rows] = choice
        mine = np.arange(len(rows))
        self.batch.set_goals(rows, self._goals[points[mine, choice]])
        return actions[mine, choice]

    def _place_values(
        self, picks: Index, places: Index, people: ObservedPeople
    ) -> NDArray[np.float32]:
        """Return the value of the motion from over each object to its place, shape (n,)."""
        n, q = len(picks), self._q_goals[picks]
        progress, left = (np.zeros(n, np.int64), np.zeros(n)), np.full(n, PLACE_TIME_S)
        obs = self._observe((q, np.zeros_like(q)), people, places, progress, left)
        return self._networks.evaluate(obs, predict=False)[1]

    def _observe(
        self,
        robot: tuple[Vec, Vec],
        people: ObservedPeople,
        points: Index,
        progress: tuple[Index, Vec],
        left: Vec,
    ) -> NDArray[np.float32]:
        """Return the observations of n robots, each with one point as target."""
        batch = self.batch
        targets = self._goals[points], self._q_goals[points], self._q_grasps[points]
        states = queries(batch.settings.grasp, robot, people, targets, progress)
        obs = np.empty((len(points), self._networks.n_obs), dtype=np.float32)
        floor_z = batch.world.people.floor_z
        observe_batch(batch.arm, floor_z, states, left, self._workspace, obs)
        return obs

    # Events.

    def _count_touches(self, rows: Index, touched: Flags) -> None:
        """Count the contacts at standstill that began in a period.

        Args:
            rows: Tasks that ran in the period.
            touched: Whether a person touched each robot at standstill in it, shape (n_tasks,).
        """
        began = touched & ~self._touched & ~self._waiting
        self._resting[rows] += began[rows]
        self._touched = touched

    def _settle(self, rows: Index) -> None:
        """Begin the motions that follow the events of a period in some tasks."""
        outcome = self.batch.state.outcome[rows].copy()
        for e in rows[outcome == SUCCESS].tolist():
            if not self.tasks.advance(e, int(self._chosen[e])):
                self._begin_motion(e)
        for e in rows[np.isin(outcome, (TIMEOUT, UNFEASIBLE))].tolist():
            self._late[e] += 1
            self._begin_motion(e)
        for e in rows[outcome == COLLISION].tolist():
            self._stop(e)

    def _stop(self, e: int) -> None:
        """Stop the robot of one task after a contact; one in the cell or itself goes home."""
        batch, state = self.batch, self.batch.state
        self._moving[e] += 1
        self._waiting[e] = True
        state.qd[e], state.qdd[e] = 0.0, 0.0
        if state.clear[e, 1:].min() <= 0.0:
            pose = new_robot_pose(batch.arm)
            place_robot(batch.arm, batch.arm.home, pose)
            state.q[e], state.robot[e] = batch.arm.home, pose.capsules
        self._begin_motion(e)

    def _release(self) -> None:
        """Let robots move again whose person is away."""
        least = self.batch.settings.grasp.start_clearance
        self._waiting &= self.batch.state.clear[:, 0] < least

    def _renew_scripts(self, rows: Index) -> None:
        """Draw another script for workers whose script has ended."""
        shared, people = self.batch.world.people, self.batch.state.people
        last = people.n_moves[rows] - 1
        over = np.take_along_axis(people.start[rows], last[..., None], 2)
        over += np.take_along_axis(people.duration[rows], last[..., None], 2)
        due = (people.clock[rows] > over[..., 0] + PAUSE_S) & (people.track[rows] == SCRIPTED)
        for i, w in np.argwhere(due).tolist():
            e, stream = int(rows[i]), np.zeros(1, dtype=np.uint64)
            self._scripts[e] += 1
            random.start_stream(self._seed, e, 1_000_000 + int(self._scripts[e]), stream)
            first = int(people.chosen[e, w, people.n_moves[e, w]])
            draw_script_of(shared, people, e, w, int(people.body[e, w]), first, stream)
            people.clock[e, w] = 0.0


def parts_of(checkpoint: Checkpoint) -> tuple[ValueNetworks, Cell, PickSettings]:
    """Return the networks of a pick policy, the sorting cell and the settings of its picks."""
    cell, preset = load_cell(CELL), pick_preset_of(checkpoint)
    require_workspace(cell, cell_of(checkpoint.manifest))
    settings = replace(settings_for((1, 1), preset), time_limit_s=MOTION_LIMIT_S)
    return ValueNetworks(checkpoint), cell, settings


def stated(batch: PickBatch) -> Json:
    """Return the settings of full tasks that a result states."""
    return {
        "cell": CELL,
        "objects": N_OBJECTS,
        "limit_s": LIMIT_S,
        "motion_limit_s": batch.settings.time_limit_s,
        "margin_attempts": MARGIN,
        "hysteresis": HYSTERESIS,
        **hand_speeds(batch),
    }


def run_sorting_people(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate full sorting tasks beside a working person under every order rule."""
    networks, cell, settings = parts_of(checkpoint)
    n = request.episodes or DEFAULT_TASKS
    runs: dict[str, FullTasks] = {}
    rows = request.rows(2 * len(ORDER_RULES) + 1)
    conditions: dict[str, tuple[CellCondition, Mapping[str, OrderRule]]] = {
        "": (USUAL, ORDER_RULES),
        NO_SSM: (CellCondition(active=False), ORDER_RULES),
        WITH_FAST_HANDS: (CellCondition(safety=FAST_HANDS), {"critic": critic}),
    }
    for suffix, (condition, rules) in conditions.items():
        bench = SortingBesidePeople(networks, cell, settings, n, request.seed, condition)
        for rule, choose in rules.items():
            name = rule + suffix
            runs[name] = bench.run(choose)
            rows.append(runs[name].row(name))
    others = "planner", "nearest", "critic" + NO_SSM, "critic" + WITH_FAST_HANDS
    return {
        "settings": {
            **stated(bench.batch),
            "safety": AMONG_HANDS.describe(),
            "critic" + WITH_FAST_HANDS: FAST_HANDS.describe(),
        },
        "results": rows,
        "paired": [_paired(runs["critic"], runs[name], name) for name in others],
    }


def _paired(first: FullTasks, other: FullTasks, name: str) -> Json:
    """Return the differences between the critic and another rule on the same tasks."""
    both = first.finished & other.finished
    return {
        "name": f"critic - {name}",
        "n": int(both.sum()),
        "cycle_time_s": mean_of((first.cycle_s - other.cycle_s)[both]),
        "moving_contacts": count_difference(first.moving[both], other.moving[both]),
    }
