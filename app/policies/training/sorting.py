"""Training on the sorting task: model, checkpoints, curriculum and learning curve.

A point of the curve is measured in greedy episodes from undisturbed starts with the triangular
distributions of the thesis for numbers of objects, the same episodes at every point. Their CPU
time is not counted as training.
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
from app.policies.training.curve import CURVE_SEED, played_rates
from app.policies.training.reporter import Callbacks, Reporter
from app.policies.training.run import CheckpointParts, TrainingRun
from app.sim.cells.cell import Cell
from app.sim.envs.sorting import SortingTask
from app.sim.sorting.batch import OUTCOMES, SortingSettings, batch_in
from app.sim.sorting.kernels.planner import new_work
from app.sim.sorting.kernels.planner_batch import TaskBatch, mark_tasks
from app.sim.sorting.kernels.task import FAILURE_SCALE
from app.sim.sorting.state import NULL, SortingShape

FADE_EVERY = 16
"""Steps of all tasks between two updates of the curriculum."""


def start(preset: SortingPreset, seed: int, cell: Cell) -> tuple[TrainingRun, SortingDQN]:
    """Return a run of the preset and its model; see :func:`~app.policies.training.train.start`.

    Raises:
        InvalidInput: There is nothing to sort in the cell.
    """
    batch = batch_in(cell, preset.learning.n_envs, seed, preset.settings(0.0))
    timeouts_end = preset.episode.timeout == "terminates"
    env = BatchVecEnv(SortingTask(cell, batch, timeouts_end=timeouts_end))
    expert = expert_of(batch.shape) if preset.expert.share else None
    model = SortingDQN(preset, env, batch, seed, expert)
    parts = CheckpointParts(
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
    k, c = shape.n_slots, shape.n_colours
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
        mark_tasks(tasks, work, first)
        return first

    return label


class SortingReporter(Reporter):
    """Fades the curriculum and runs the episodes behind the curve.

    Args:
        trained: The model.
    """

    STATE = (*Reporter.STATE, "_faded")

    def __init__(self, run: TrainingRun, callbacks: Callbacks, trained: SortingDQN) -> None:
        super().__init__(run, callbacks)
        self._trained, self._preset = trained, trained.preset
        self._faded = 0.0
        settings = SortingSettings(
            horizon_factor=self._preset.episode.horizon_factor,
            weights=self._preset.reward.weights,
        )
        n = self._preset.learning.progress_episodes
        self._played = batch_in(run.cell, n, CURVE_SEED, settings)

    def watch(self, rewards: NDArray[np.floating]) -> None:
        """Fade the curriculum with the steps; ``rewards`` only state the number of tasks."""
        if (self.num_timesteps // len(rewards)) % FADE_EVERY == 0:
            share = self._preset.episode.fade_share
            self._faded = self.num_timesteps / (share * self._preset.learning.total_steps)
            self._trained.tasks.settings = self._preset.settings(self._faded)

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore a state and its curriculum."""
        super().load_state_dict(state)
        self._trained.tasks.settings = self._preset.settings(self._faded)

    def rates(self) -> dict[str, Any]:
        """Return rates of greedy episodes of the present network."""
        with self._run.untimed():
            return played_rates(self._greedy, self._played, OUTCOMES)

    def _greedy(self, obs: torch.Tensor) -> torch.Tensor:
        moves: torch.Tensor = self._trained.q_net(obs).argmax(dim=1)
        return moves
