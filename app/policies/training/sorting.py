"""Training on the sorting task: model, checkpoints, curriculum and what its curve counts.

A point of the curve is played for it alone: greedy episodes from clean starts of the sizes met
in training, the same ones at every point. The CPU time that takes is not counted as training.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from app.policies.algorithms.dqn import Expert, SortingDQN
from app.policies.algorithms.vecenv import BatchVecEnv
from app.policies.configs.sorting import SortingPreset
from app.policies.networks.sorting_q import layout_of
from app.policies.training.reporter import Callbacks, Reporter
from app.policies.training.run import Parts, TrainingRun
from app.sim.cells.cell import Cell
from app.sim.envs.sorting import SortingTask
from app.sim.sorting.batch import OUTCOMES, SortingBatch, SortingSettings, batch_in
from app.sim.sorting.kernels.planner import new_work
from app.sim.sorting.kernels.planner_batch import TaskBatch, mark_rows
from app.sim.sorting.kernels.task import FAILURE_SCALE
from app.sim.sorting.state import NULL, SortingShape

CURVE_SEED = 1_000_003
"""Seed of the episodes behind a point of the curve; no evaluation uses it."""
FADE_EVERY = 16
"""Steps of all tasks between two looks at the curriculum."""


def start(preset: SortingPreset, seed: int, cell: Cell) -> tuple[TrainingRun, SortingDQN]:
    """Return a run of the preset and its model.

    Args:
        seed: Seed of everything random.
        cell: Work cell trained in.

    Raises:
        InvalidInput: There is nothing to sort in the cell.
    """
    batch = batch_in(cell, preset.learning.n_envs, seed, preset.settings(0.0))
    env = BatchVecEnv(SortingTask(cell, batch))
    expert = expert_of(batch.shape) if preset.expert.share else None
    model = SortingDQN(preset, env, batch, seed, expert)
    parts = Parts(
        policy={"q": model.q_net.q_net},
        targets={"q_target": model.q_net_target.q_net},
        optimizers={"adam": model.policy.optimizer},
        layout=layout_of(batch.shape),
        act_size=batch.shape.n_actions,
        trained_range=dict,
    )
    return TrainingRun(preset, seed, cell, model, env, parts), model


def expert_of(shape: SortingShape) -> Expert:
    """Return the expert that marks the first moves of all shortest plans."""
    k, c = shape.n_cells, shape.n_colours
    work = new_work(k, c, shape.n_sizes)

    def label(obs: NDArray[np.uint8]) -> NDArray[np.bool_]:
        n, codes = len(obs), obs.astype(np.int8)
        clutter = np.ascontiguousarray(codes[:, :k])
        towers = np.ascontiguousarray(codes[:, k : k + c * k].reshape(n, c, k))
        goal = np.ascontiguousarray(codes[:, k + c * k : k + 2 * c * k].reshape(n, c, k))
        heights, wanted = (towers != NULL).sum(axis=2), (goal != NULL).sum(axis=2)
        first = np.zeros((n, shape.n_actions), dtype=np.bool_)
        fail = obs[:, k + 2 * c * k :] / FAILURE_SCALE
        tasks = TaskBatch(clutter, towers, heights, goal, wanted, fail)
        mark_rows(tasks, work, first)
        return first

    return label


class SortingReporter(Reporter):
    """Fades the curriculum and plays the episodes behind the curve.

    Args:
        run: The attempt.
        callbacks: Receivers of the curve and of checkpoints.
        trained: The model.
    """

    STATE = (*Reporter.STATE, "_faded")

    def __init__(self, run: TrainingRun, callbacks: Callbacks, trained: SortingDQN) -> None:
        super().__init__(run, callbacks)
        self._run, self._trained, self._preset = run, trained, trained.preset
        self._faded = 0.0
        settings = SortingSettings(
            horizon_factor=self._preset.episode.horizon_factor,
            weights=self._preset.reward.weights,
        )
        n = self._preset.learning.progress_episodes
        self._played = batch_in(run.cell, n, CURVE_SEED, settings)

    def watch(self, rewards: NDArray[np.floating]) -> None:
        """Let the curriculum fade with the steps."""
        if (self.num_timesteps // len(rewards)) % FADE_EVERY == 0:
            share = self._preset.episode.fade_share
            self._faded = self.num_timesteps / (share * self._preset.learning.total_steps)
            self._trained.tasks.settings = self._preset.settings(self._faded)

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore a state and its curriculum."""
        super().load_state_dict(state)
        self._trained.tasks.settings = self._preset.settings(self._faded)

    def rates(self) -> dict[str, Any]:
        """Return how greedy episodes end now."""
        with self._run.untimed():
            ended, returns = play(self._trained, self._played)
        n = len(ended)
        return {
            "episodes": n,
            "success": float((ended == OUTCOMES.index("success")).mean()),
            "collision": None,
            "timeout": float((ended == OUTCOMES.index("timeout")).mean()),
            "reward": float(returns.mean()),
        }


def play(model: SortingDQN, batch: SortingBatch) -> tuple[NDArray[np.int64], NDArray[Any]]:
    """Play one greedy episode in every row of a batch.

    Returns:
        Outcomes and undiscounted returns, each (n_envs,).
    """
    obs = batch.reset().copy()
    ended, returns = np.zeros(batch.n_envs, dtype=np.int64), np.zeros(batch.n_envs)
    while (live := np.flatnonzero(ended == 0)).size:
        act = np.zeros(batch.n_envs, dtype=np.int64)
        with torch.inference_mode():
            act[live] = model.q_net(torch.as_tensor(obs[live])).argmax(dim=1).numpy()
        result = batch.step(act, auto_reset=False)
        obs, returns = result.obs.copy(), returns + result.rew
        ended = np.where(result.ended > 0, result.ended, ended)
    return ended, returns
