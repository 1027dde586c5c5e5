"""Training on the sorting task: model, checkpoints, curriculum and what its curve counts.

A point of the curve is played for it alone: greedy episodes from clean starts of the sizes met
in training, the same ones at every point. The CPU time that takes is not counted as training.
"""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from app.policies.algorithms.dqn import Adviser, SortingDQN
from app.policies.algorithms.sorting_vecenv import SortingVecEnv
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.configs.sorting import SortingPreset
from app.policies.networks.sorting_q import layout_of
from app.policies.training.progress import Progress
from app.policies.training.reporter import Reporter
from app.policies.training.run import Parts, TrainingRun
from app.sim.cells.cell import Cell
from app.sim.sorting.batch import OUTCOMES, SortingBatch, SortingSettings, batch_in
from app.sim.sorting.kernels.planner import mark_rows, new_work
from app.sim.sorting.kernels.task import FAILURE_SCALE
from app.sim.sorting.state import NULL, SortingShape

CURVE_SEED = 1_000_003
"""Seed of the episodes behind a point of the curve; no evaluation uses it."""
FADE = 0.8
"""Share of the training over which the curriculum fades."""
FADE_EVERY = 16
"""Steps of all tasks between two looks at the curriculum."""


def start(
    preset: SortingPreset, seed: int, resume: Checkpoint | None, cell: Cell
) -> tuple[TrainingRun, SortingDQN]:
    """Return a run of the preset, from the start or from a checkpoint, and its model.

    Args:
        preset: All hyper-parameters.
        seed: Seed of everything random.
        resume: The last ``resume`` checkpoint of an interrupted attempt.
        cell: Work cell trained in.

    Raises:
        InvalidInput: There is nothing to sort in the cell.
    """
    first = 0 if resume is None else int(resume.manifest["step"])
    batch = batch_in(cell, preset.n_envs, seed + first, preset.settings(0.0))
    env = SortingVecEnv(batch)

    adviser = adviser_of(batch.shape) if preset.advice_share else None
    model = SortingDQN(preset, env, seed + first, adviser)
    parts = Parts(
        policy={"q": model.q_net.q_net},
        targets={"q_target": model.q_net_target.q_net},
        optimizers={"adam": model.policy.optimizer},
        layout=layout_of(batch.shape),
        act_size=batch.shape.n_actions,
        trained_range=dict,
    )
    return TrainingRun(preset, seed, cell, model, env, parts, resume), model


def adviser_of(shape: SortingShape) -> Adviser:
    """Return what marks the moves with which plans of the fewest moves begin."""
    k, c = shape.n_cells, shape.n_colours
    work = new_work(k, c, shape.n_sizes)

    def advise(obs: NDArray[np.uint8]) -> NDArray[np.bool_]:
        n, codes = len(obs), obs.astype(np.int8)
        clutter = np.ascontiguousarray(codes[:, :k])
        towers = np.ascontiguousarray(codes[:, k : k + c * k].reshape(n, c, k))
        goal = np.ascontiguousarray(codes[:, k + c * k : k + 2 * c * k].reshape(n, c, k))
        heights, wanted = (towers != NULL).sum(axis=2), (goal != NULL).sum(axis=2)
        first = np.zeros((n, shape.n_actions), dtype=np.bool_)
        fail = obs[:, k + 2 * c * k :] / FAILURE_SCALE
        mark_rows(clutter, towers, heights, goal, wanted, fail, work, first)
        return first

    return advise


class SortingReporter(Reporter):
    """Fades the curriculum and plays the episodes behind the curve.

    Args:
        run: The attempt.
        on_progress: Takes the points of the curve.
        on_checkpoint: Takes the step, the policy and what resuming needs.
        should_stop: Asked after every step.
        trained: The model.
    """

    def __init__(
        self,
        run: TrainingRun,
        on_progress: Callable[[Progress], None],
        on_checkpoint: Callable[[int, Checkpoint, Checkpoint], None],
        should_stop: Callable[[], bool],
        trained: SortingDQN,
    ) -> None:
        super().__init__(run, on_progress, on_checkpoint, should_stop)
        self._run, self._trained, self._preset = run, trained, trained.preset
        settings = SortingSettings(
            horizon_factor=self._preset.horizon_factor, weights=self._preset.weights
        )
        n = self._preset.progress_episodes
        self._played = batch_in(run.cell, n, CURVE_SEED, settings)

    def watch(self, rewards: NDArray[np.floating]) -> None:
        """Let the curriculum fade with the steps."""
        if (self.num_timesteps // len(rewards)) % FADE_EVERY == 0:
            done = self.num_timesteps / (FADE * self._preset.total_steps)
            self._trained.tasks.settings = self._preset.settings(done)

    def rates(self) -> dict[str, Any]:
        """Return how greedy episodes end now."""
        began = time.process_time()
        ended, returns = play(self._trained, self._played)
        self._run.leave_out(time.process_time() - began)
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
