"""Run pick episodes to their ends under a selection rule.

Each episode is one environment of a batch and stops when it ends. Episode ``k`` of a seed has
the same start under every rule, so that rules are compared on the same episodes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.configs.pick import PickPreset
from app.policies.evaluation.contact_recheck import Trace
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import Flags, Index, outcome_intervals
from app.policies.inference.value_networks import ValueNetworks, pick_preset_of
from app.sim.collision.checker import Shapes
from app.sim.collision.fcl_recheck import Trajectory
from app.sim.core.arrays import Vec
from app.sim.core.observation_layout import slices_of
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.people.kernels.people import new_people_geometry, observe_people_of_envs
from app.sim.pick.batch import (
    PickBatch,
    PickSettings,
    observation_workspace_of,
    queries,
    target_configurations,
)
from app.sim.pick.kernels.grasp import APPROACH, LIFT
from app.sim.pick.kernels.observation import observe_batch
from app.sim.pick.kernels.observation_layout import DISTANCE_SCALE, LAYOUT, N_PICK, PICK_SIZES
from app.sim.pick.resting_people import PickTarget, RestingPeoplePlanner
from app.sim.scenario.kernels import episode as kernel
from app.sim.scene.scene import NO_CYLINDERS, people_geometry_of

SECOND_GOAL = slices_of(PICK_SIZES)["second_goal_clearance"].start
"""Index of the clearance of the second person at the object."""
CANDIDATES = (2, 3)
"""Fewest and most targets of an episode in which the policy chooses."""
EVALUATION_LIBRARY = 1_000_003
"""Seed of the person's postures in evaluations; training uses 0, so these were never seen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SelectionInput:
    """Input of a selection rule: all running environments at one step."""

    values: NDArray[np.float32]
    """Critic's value of each candidate, -inf where there are fewer, shape (n, k)."""
    distances: Vec
    """Distance from tcp to each candidate [m], inf where there are fewer, shape (n, k)."""
    clearances: Vec
    """Clearance to people of the configuration at each candidate's object [m], -inf where there
    are fewer, shape (n, k)."""
    chosen: Index
    """Candidate pursued so far, shape (n,); undefined at the first step."""
    first: bool
    """Whether this is the first step."""
    outcomes: Vec | None
    """Probabilities of success and contact, the lower and the upper ends of their intervals and
    the expected time to success [s], 0 where there are fewer candidates, shape (n, k, 7); None
    where the checkpoint predicts none."""
    rows: Index
    """Indices of the environments, shape (n,)."""


Rule = Callable[[SelectionInput], Index]


class ObservedPeople(NamedTuple):
    """Observed people of each of n environments, the nearest to the robot first."""

    q: Vec
    """Joint positions [m, rad], shape (n, P, 18)."""
    qd: Vec
    """Joint speeds [m/s, rad/s], shape (n, P, 18)."""
    size: Vec
    """Body dimensions [m], shape (n, P, 12)."""

    def of(self, rows: Index) -> Self:
        """Return the people that some of the environments observe."""
        return type(self)(*(part[rows] for part in self))


PeopleObserver = Callable[[PickBatch, Index], ObservedPeople]
"""Observation model: called once per step for the running environments."""


def observe_exactly(batch: PickBatch, rows: Index) -> ObservedPeople:
    """Return the people of each environment as they are, the nearest to its robot first.

    Angles beyond the limits of the model, as in recordings, are clipped to them, as in the live
    cell.
    """
    shared, state, n = batch.world.people, batch.state, len(rows)
    n_workers, n_cylinders = state.people.q.shape[1], state.people.cylinders.shape[1]
    n_people = max(1, n_workers + n_cylinders)
    q, qd = np.empty((n, n_people, 18)), np.empty((n, n_people, 18))
    size = np.empty((n, n_people, shared.bodies.shape[1]))
    geometry = new_people_geometry(shared, n_workers, n_cylinders)
    observe_people_of_envs(shared, state.people, state.robot, rows, geometry, q, qd, size)
    np.clip(q[..., 3:], shared.limits[0, 3:], shared.limits[1, 3:], out=q[..., 3:])
    return ObservedPeople(q=q, qd=qd, size=size)


@dataclass(frozen=True, slots=True, kw_only=True)
class Episodes:
    """Outcomes of a set of episodes."""

    outcome: Index
    """Index into OUTCOMES, shape (n,)."""
    duration_s: Vec
    """Time to the end [s], shape (n,)."""
    switches: Index
    """Number of changes of the target, shape (n,)."""
    trajectories: tuple[Trajectory, ...]
    """Robot and each worker of the recorded episodes."""

    @property
    def succeeded(self) -> Flags:
        """Whether each episode succeeded, shape (n,)."""
        success: Flags = self.outcome == kernel.SUCCESS
        return success

    def part(self, rows: Sequence[int]) -> "Episodes":
        """Return some of the episodes, without trajectories."""
        return Episodes(
            outcome=self.outcome[rows],
            duration_s=self.duration_s[rows],
            switches=self.switches[rows],
            trajectories=(),
        )

    def row(self, name: str) -> Json:
        """Return the result row of these episodes, rates with 95 % intervals."""
        times = self.duration_s[self.succeeded]
        return {
            "name": name,
            **outcome_intervals(self.outcome),
            "time_to_success_s": float(times.mean()) if len(times) else None,
            "switches_per_episode": float(self.switches.mean()),
        }


def time_limits(preset: PickPreset) -> tuple[float, ...]:
    """Return the time limits of evaluations [s], the usual one first.

    Where a target only has to be reached, 10 s (thesis 5.3.1) and 20 s (table 5.2); 12 s where
    an object is picked up.
    """
    return (10.0, 20.0) if preset.episode.grasp.depth == 0.0 else (12.0,)


def settings_for(n_candidates: tuple[int, int], preset: PickPreset) -> PickSettings:
    """Return the settings of evaluations: start clearance 0.05 m, the usual time limit.

    Postures and samples of the library's people do not occur in training. These people do not
    yield to the robot, even if the checkpoint was trained beside yielding people.

    Args:
        n_candidates: Minimum and maximum number of targets offered.
        preset: Training configuration of the checkpoint.
    """
    grasp = preset.episode.grasp
    return PickSettings(
        time_limit_s=time_limits(preset)[0],
        start_clearance_m=0.05,
        n_candidates=n_candidates,
        grasp=grasp,
        work=HumanMotionConfig(seed=EVALUATION_LIBRARY),
        action=preset.action.settings,
    )


class Evaluator:
    """Episodes of a batch, run once per selection rule.

    Args:
        batch: One environment per episode.
    """

    def __init__(self, networks: ValueNetworks, batch: PickBatch) -> None:
        self.networks, self.batch = networks, batch
        self._workspace = observation_workspace_of(batch.cell)
        grasp, stations = batch.settings.grasp, batch.world.stations
        self._station_q, self._grasp_q, _ = target_configurations(batch.arm, grasp, stations)

    def run(
        self,
        rule: Rule,
        n_recorded: int = 0,
        observe: PeopleObserver = observe_exactly,
        start: Callable[[PickBatch], None] | None = None,
        predicts: bool = False,
        planned: bool = False,
    ) -> Episodes:
        """Run all episodes under a rule; record poses of the first ``n_recorded``.

        Args:
            rule: Selection rule.
            observe: Observation model; a stateful one serves one run only.
            start: Changes the starts of the episodes.
            predicts: Whether the rule reads the predicted outcomes.
            planned: Whether a planner moves the robot beside people at rest.
        """
        batch, n = self.batch, self.batch.n_envs
        batch.reset()
        if start is not None:
            start(batch)
        chosen, switches = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        act = np.zeros((n, 5), dtype=np.float32)
        trace, first = Trace(batch, n_recorded), True
        planners = [RestingPeoplePlanner(batch.arm) for _ in range(n if planned else 0)]
        while (rows := np.flatnonzero(batch.state.outcome == kernel.RUNNING)).size:
            observed = observe(batch, rows)
            actions, view = self._view(rows, chosen[rows], first, observed, predicts)
            resting = self._beside_resting(planners, rows, observed) if planners else {}
            if resting:
                view = self._without_blocked(view, resting, planners)
            choice = rule(view)
            lifting = batch.state.phase[rows] == LIFT  # an object in hand is lifted first
            choice = np.where(lifting, chosen[rows], choice)
            if not first:
                switches[rows] += choice != chosen[rows]
            chosen[rows], first = choice, False
            act[rows] = actions[np.arange(len(rows)), choice]
            stations = batch.state.candidates[rows, choice]
            batch.set_goals(rows, batch.world.stations[stations])
            self._plan(planners, rows, resting, act)
            trace.before(rows)
            batch.step(act, auto_reset=False, features=False)
            trace.after()
        return Episodes(
            outcome=batch.state.outcome.copy(),
            duration_s=batch.state.elapsed.copy(),
            switches=switches,
            trajectories=trace.trajectories(),
        )

    def _beside_resting(
        self, planners: list[RestingPeoplePlanner], rows: Index, observed: ObservedPeople
    ) -> dict[int, Shapes]:
        """Return the people of the running environments where all have been at rest."""
        people, speeds = self.batch.world.people, np.abs(observed.qd).max(axis=(1, 2))
        found = {}
        for k, e in enumerate(rows):
            if planners[e].note(float(speeds[k])):
                geometry = people_geometry_of(
                    people, observed.q[k], NO_CYLINDERS, observed.size[k]
                )
                found[k] = Shapes(capsules=geometry.capsules, cylinders=np.zeros((0, 4)))
        return found

    def _without_blocked(
        self,
        view: SelectionInput,
        resting: dict[int, Shapes],
        planners: list[RestingPeoplePlanner],
    ) -> SelectionInput:
        """Return the view without candidates that resting people block, where one is free."""
        values, distances = view.values.copy(), view.distances.copy()
        for k, people in resting.items():
            e, here = view.rows[k], np.flatnonzero(np.isfinite(values[k]))
            at = self.batch.state.candidates[e, here]
            grasp, targets = self.batch.settings.grasp, (self._station_q[at], self._grasp_q[at])
            begun = None
            if self.batch.state.phase[e] != APPROACH:
                begun = int(np.flatnonzero(here == view.chosen[k])[0])
            out = here[~planners[e].offered(people, grasp, *targets, begun)]
            values[k, out], distances[k, out] = -np.inf, np.inf
        return replace(view, values=values, distances=distances)

    def _plan(
        self,
        planners: list[RestingPeoplePlanner],
        rows: Index,
        resting: dict[int, Shapes],
        act: NDArray[np.float32],
    ) -> None:
        """Replace the policy's actions beside people at rest, in place."""
        state, grasp = self.batch.state, self.batch.settings.grasp
        for k, people in resting.items():
            e = rows[k]
            target = PickTarget(
                q_over=state.q_goal[e], q_grasp=state.q_grasp[e], phase=int(state.phase[e])
            )
            found = planners[e].act(state.q[e], state.qd[e], people, target, grasp)
            if found is not None:
                act[e] = found

    def _view(
        self, rows: Index, chosen: Index, first: bool, observed: ObservedPeople, predicts: bool
    ) -> tuple[NDArray[np.float32], SelectionInput]:
        """Return the policy's action for each candidate, (n, k, 5), and the rule's input."""
        batch, state = self.batch, self.batch.state
        width = batch.settings.n_candidates[1]
        stations = state.candidates[rows, :width]
        there = stations >= 0
        owner, place = np.nonzero(there)
        env, station = rows[owner], stations[owner, place]
        obs = np.empty((len(env), self.networks.n_obs), dtype=np.float32)
        current = place == chosen[owner]
        phase = np.where(current, state.phase[env], APPROACH)
        states = queries(
            batch.settings.grasp,
            (state.q[env], state.qd[env]),
            observed.of(owner),
            (batch.world.stations[station], self._station_q[station], self._grasp_q[station]),
            (phase, np.where(phase != APPROACH, state.closing[env], 0.0)),
        )
        floor_z, left = batch.world.people.floor_z, state.time_left[env]
        observe_batch(batch.arm, floor_z, states, left, self._workspace, obs)
        act, value, predicted = self.networks.evaluate(obs, predict=predicts)
        actions = np.zeros((len(rows), width, act.shape[1]), dtype=np.float32)
        values = np.full((len(rows), width), -np.inf, dtype=np.float32)
        distances = np.full((len(rows), width), np.inf)
        actions[owner, place], values[owner, place] = act, value
        away = batch.world.stations[station] - obs[:, LAYOUT["tcp"]]
        distances[owner, place] = np.linalg.norm(away, axis=1)
        clearances = np.full((len(rows), width), -np.inf)
        clearances[owner, place] = goal_clearance(obs)
        outcomes = None
        if predicted is not None:
            outcomes = np.zeros((len(rows), width, 7))
            three = predicted.probability, predicted.low, predicted.high
            parts = *(one[:, :2] for one in three), predicted.time_s
            outcomes[owner, place] = np.column_stack(parts)
        view = SelectionInput(
            values=values,
            outcomes=outcomes,
            distances=distances,
            clearances=clearances,
            chosen=chosen,
            first=first,
            rows=rows,
        )
        return actions, view


class PickBench:
    """A pick policy, and the episodes on which a request evaluates it.

    Args:
        n_candidates: Fewest and most targets offered.
        default: Number of episodes where the request states none.
    """

    def __init__(
        self,
        checkpoint: Checkpoint,
        request: EvaluationRequest,
        n_candidates: tuple[int, int] = CANDIDATES,
        default: int = 1000,
    ) -> None:
        self.networks, self.cell = ValueNetworks(checkpoint), cell_of(checkpoint.manifest)
        self.preset, self.request = pick_preset_of(checkpoint), request
        self.n = request.episodes or default
        """Number of episodes."""
        self.usual = settings_for(n_candidates, self.preset)
        """Settings of the usual episodes."""

    def evaluator(self, settings: PickSettings) -> Evaluator:
        """Return the episodes under some settings."""
        batch = PickBatch(self.cell, self.n, self.request.seed, settings)
        return Evaluator(self.networks, batch)


def goal_clearance(obs: NDArray[np.float32]) -> Vec:
    """Return the clearance at the object that observations state [m], shape (n,)."""
    least = obs[:, LAYOUT["goal_clearance"].start].astype(np.float64)
    if obs.shape[1] == N_PICK:
        least = np.minimum(least, obs[:, SECOND_GOAL])
    return DISTANCE_SCALE * least
