"""Runs pick episodes to their ends under any rule of choosing among candidates.

Every episode is one row of a batch that stops when it ends; episode ``k`` of a seed starts the
same whatever rule is measured, so that rules are compared on the same cells.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.policies.configs.pick import PickPreset
from app.policies.evaluation.pick.recorded_people import Trace
from app.policies.evaluation.statistics import wilson
from app.policies.inference.task_selection import ValueNetworks
from app.sim.cells.cell import Cell
from app.sim.collision.fcl_recheck import Trajectory
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.people.kernels.people import new_people_geometry, see_rows
from app.sim.pick.batch import OUTCOMES, PickBatch, PickSettings
from app.sim.pick.kernels.observation import LAYOUT, PickQuery, observe_batch
from app.sim.scenario.kernels import episode as kernel

Index = NDArray[np.int64]
EVALUATION_LIBRARY = 1_000_003
"""Seed of the person's postures in evaluations; training uses 0, so these were never seen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What a rule of choosing sees: all running rows at one step."""

    values: NDArray[np.float32]
    """Critic's value of every candidate, -inf where there are fewer, shape (n, k)."""
    distances: NDArray[np.float64]
    """Distance from tcp to each candidate [half m], inf where there are fewer, (n, k)."""
    chosen: Index
    """Candidate pursued so far, shape (n,); meaningless at the first step."""
    first: bool
    """Whether this is the first step."""
    rows: Index
    """Which rows of the batch these are, shape (n,)."""


Rule = Callable[[View], Index]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sight:
    """The person as the policy sees them, one per running row."""

    q: NDArray[np.float64]
    """Joint positions [m, rad], shape (n, 18)."""
    qd: NDArray[np.float64]
    """Joint speeds [m/s, rad/s], shape (n, 18)."""
    size: NDArray[np.float64]
    """Size [m], shape (n, 12)."""


Seen = Callable[[PickBatch, Index], Sight]
"""What stands between the batch and the policy: asked once per step, for the running rows."""


def seen_exactly(batch: PickBatch, rows: Index) -> Sight:
    """Return the person nearest to each row's robot, as they are; far away for nobody.

    Angles beyond the model's limits, which recorded people have, are told as the limit, as the
    live cell tells them.
    """
    shared, state, n = batch.world.people, batch.state, len(rows)
    seen = Sight(
        q=np.empty((n, 18)), qd=np.empty((n, 18)), size=np.empty((n, shared.bodies.shape[1]))
    )
    crowd = new_people_geometry(
        shared, state.people.q.shape[1], state.people.cylinders.shape[1]
    )
    see_rows(shared, state.people, state.robot, rows, crowd, seen.q, seen.qd, seen.size)
    np.clip(seen.q[:, 3:], shared.limits[0, 3:], shared.limits[1, 3:], out=seen.q[:, 3:])
    return seen


@dataclass(frozen=True, slots=True, kw_only=True)
class Episodes:
    """Outcomes of a set of episodes."""

    outcome: Index
    """Index into OUTCOMES, shape (n,)."""
    duration_s: NDArray[np.float64]
    """Time to the end [s], shape (n,)."""
    switches: Index
    """How often the choice changed, shape (n,)."""
    trajectories: tuple[Trajectory, ...]
    """Robot and each worker of the first rows, as long as each ran."""

    def row(self, name: str) -> dict[str, object]:
        """Return the result row of these episodes, rates with 95 % intervals."""
        n = len(self.outcome)
        counts = np.bincount(self.outcome, minlength=len(OUTCOMES))
        won = self.outcome == kernel.SUCCESS
        unfeasible = int(counts[kernel.UNFEASIBLE])
        return {
            "name": name,
            "n": n,
            "success": wilson(int(counts[kernel.SUCCESS]), n),
            "collision": wilson(int(counts[kernel.COLLISION]), n),
            "timeout": wilson(int(counts[kernel.TIMEOUT]), n),
            **({"unfeasible": wilson(unfeasible, n)} if unfeasible else {}),
            "time_to_success_s": float(self.duration_s[won].mean()) if won.any() else None,
            "switches_per_episode": float(self.switches.mean()),
        }


def settings_for(n_candidates: tuple[int, int], preset: PickPreset) -> PickSettings:
    """Return the evaluation's settings: 10 s, start clearance 0.05 m, the library's people.

    Their postures and samples were never seen in training, and they mind no robot, whatever
    people the checkpoint was trained beside.

    Args:
        n_candidates: Fewest and most targets offered.
        preset: Training configuration of the checkpoint.
    """
    return PickSettings(
        time_limit_s=10.0,
        start_clearance_m=0.05,
        n_candidates=n_candidates,
        work=HumanMotionConfig(seed=EVALUATION_LIBRARY, pace=preset.people.human_pace),
        action=preset.action.settings,
    )


class Evaluator:
    """Episodes of one seed, run as often as there are rules.

    Args:
        networks: Actor and critics.
        cell: Work cell.
        n_episodes: Number of episodes.
        seed: Seed of the episodes.
        settings: Starts and ends.
    """

    def __init__(
        self,
        networks: ValueNetworks,
        cell: Cell,
        n_episodes: int,
        seed: int,
        settings: PickSettings,
    ) -> None:
        self._networks = networks
        self.batch = PickBatch(cell, n_episodes, seed, settings)

    def run(self, rule: Rule, n_recorded: int = 0, seen: Seen = seen_exactly) -> Episodes:
        """Run all episodes under a rule; record the first ``n_recorded`` ones.

        Args:
            rule: Chooses among the candidates.
            n_recorded: Rows whose poses are kept.
            seen: The person the policy sees instead of the true one; made again for every run
                where it remembers what it saw.
        """
        batch, n = self.batch, self.batch.n_envs
        batch.reset()
        chosen, switches = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        act = np.zeros((n, 5), dtype=np.float32)
        trace = Trace(batch, n_recorded)
        first = True
        while (rows := np.flatnonzero(batch.state.outcome == kernel.RUNNING)).size:
            actions, view = self._view(rows, chosen[rows], first, seen)
            choice = rule(view)
            if not first:
                switches[rows] += choice != chosen[rows]
            chosen[rows], first = choice, False
            act[rows] = actions[np.arange(len(rows)), choice]
            stations = batch.state.candidates[rows, choice]
            batch.set_goals(rows, batch.world.stations[stations])
            trace.before(rows)
            batch.step(act, auto_reset=False, features=False)
            trace.after()
        return Episodes(
            outcome=batch.state.outcome.copy(),
            duration_s=batch.state.elapsed.copy(),
            switches=switches,
            trajectories=trace.trajectories(),
        )

    def _view(
        self, rows: Index, chosen: Index, first: bool, seen: Seen
    ) -> tuple[NDArray[np.float32], View]:
        """Return the policy's action for every candidate, (n, k, 5), and what rules see."""
        batch, state = self.batch, self.batch.state
        width = batch.settings.n_candidates[1]
        stations = state.candidates[rows, :width]
        there = stations >= 0
        owner, place = np.nonzero(there)
        env, station = rows[owner], stations[owner, place]
        sight = seen(batch, rows)
        obs = np.empty((len(env), self._networks.n_obs), dtype=np.float32)
        states = PickQuery(
            state.q[env],
            state.qd[env],
            sight.q[owner],
            sight.qd[owner],
            sight.size[owner],
            batch.world.stations[station],
            batch.world.station_q[station],
        )
        floor_z = batch.world.people.floor_z
        observe_batch(batch.arm, floor_z, states, state.time_left[env], obs)
        act, value = self._networks.act_and_value(obs)
        actions = np.zeros((len(rows), width, act.shape[1]), dtype=np.float32)
        values = np.full((len(rows), width), -np.inf, dtype=np.float32)
        distances = np.full((len(rows), width), np.inf)
        actions[owner, place], values[owner, place] = act, value
        to_goal = obs[:, LAYOUT["goal_minus_tcp"]]
        distances[owner, place] = np.linalg.norm(to_goal, axis=1)
        view = View(values=values, distances=distances, chosen=chosen, first=first, rows=rows)
        return actions, view
