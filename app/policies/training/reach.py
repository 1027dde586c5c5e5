"""Training on the reach scenario: settings, networks, exploration and learning curve.

Each point of the curve is measured in greedy episodes of the preset's own starts, the same ones
at every point. Their CPU time is not counted as training.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.policies.algorithms.exploration import Exploration, OUNoise, PerEnvAR1Noise
from app.policies.algorithms.td3 import Networks
from app.policies.configs.reach import ReachExploration, ReachPreset
from app.policies.inference.reach_policy import LAYOUTS, PEOPLE_SET, blocked_rules_of
from app.policies.networks.actor_critic import Critics, PlainActor, QNetwork, ResidualActor
from app.policies.networks.ddpg import DDPGActor, LateActionQ, RunningNormalisation
from app.policies.networks.quantiles import QuantileCritics
from app.policies.training.curve import CURVE_SEED, played_rates
from app.policies.training.reporter import Callbacks, Reporter
from app.policies.training.run import TrainingRun
from app.policies.training.td3 import TrainingMonitor, start_td3
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.envs.tasks import ArmTask
from app.sim.people.kernels.pedestrian import VX, VY, R, X, Y
from app.sim.pick.batch import OUTCOMES
from app.sim.reach.batch import N_ACT, ReachBatch, ReachSettings
from app.sim.reach.blocked_batch import new_reach_batch
from app.sim.reach.kernels.observation import BASE_START
from app.sim.reach.kernels.reward import ReachWeights
from app.sim.reach.mixed_batch import MixedReachBatch, ReachEnvironments
from app.sim.reach.monitored.batch import MonitoredReachBatch
from app.sim.safety.layer import safety_settings
from app.sim.scene.scene import HumanKind


def settings_of(preset: ReachPreset) -> ReachSettings:
    """Return the scenario's settings of a preset."""
    walker: HumanKind = "walker"
    episode, weights = preset.episode, preset.reward.model_dump(exclude={"c_u", "bonus"})
    return ReachSettings(
        **episode.model_dump(exclude={"collision", "timeout", "safety"}),
        people=(walker,) * preset.people.n_people,
        collision_ends=episode.collision == "terminates",
        blocked=blocked_rules_of(preset),
        action=preset.action.settings,
        weights=ReachWeights(**weights, gamma=1.0),
    )


def batch_of(preset: ReachPreset, cell: Cell, n_envs: int, seed: int) -> ReachEnvironments:
    """Return the environments of a preset, for training or for its learning curve."""
    settings = settings_of(preset)
    if preset.episode.safety == "ssm":
        return MonitoredReachBatch(cell, n_envs, seed, settings, safety_settings(cell))
    if preset.people.count == "up-to":
        return MixedReachBatch(cell, n_envs, seed, settings)
    return new_reach_batch(cell, n_envs, seed, settings)


def curve_batch(preset: ReachPreset, cell: Cell) -> ReachEnvironments:
    """Return the environments of a point of the curve."""
    return batch_of(preset, cell, preset.learning.progress_episodes, CURVE_SEED)


def exploration_of(
    config: ReachExploration, batch: ReachEnvironments, seed: int
) -> Exploration:
    """Return the exploration of a preset."""
    rng, shape = np.random.default_rng(seed), (batch.n_envs, N_ACT)
    if config.noise == "ou":
        return OUNoise(shape, config, lambda: elapsed_times(batch) == 0.0, rng)
    return PerEnvAR1Noise(shape, batch.arm.dt, config, rng, noise_order(batch))


def noise_order(batch: ReachEnvironments) -> NDArray[np.int64]:
    """Return the environments in the order of growing noise scales, shape (n_envs,).

    Environments with different numbers of people take turns: each number has small and large
    scales.
    """
    places = np.concatenate([np.arange(part.n_envs) for part in _parts_of(batch)])
    return places.argsort(kind="stable")


def elapsed_times(batch: ReachEnvironments) -> Vec:
    """Return the times since the starts of the present episodes [s], shape (n_envs,)."""
    return np.concatenate([part.state.elapsed for part in _parts_of(batch)])


def _parts_of(batch: ReachEnvironments) -> tuple[ReachBatch, ...]:
    """Return the batches of which environments consist."""
    return batch.parts if isinstance(batch, MixedReachBatch) else (batch,)


def networks_of(preset: ReachPreset, n_obs: int) -> Networks:
    """Return how actor and critics are made for observations of a length."""
    sizes = preset.networks
    width, layers, normed = sizes.width, sizes.layers, sizes.critic_norm == "layer"
    people_set = PEOPLE_SET if preset.episode.observation == "people-set" else None

    norm = RunningNormalisation(n_obs) if sizes.normalisation == "running" else None

    def actor() -> ResidualActor | PlainActor | DDPGActor:
        if sizes.actor == "ddpg":
            return DDPGActor(width, n_obs, N_ACT, layers, norm)
        if sizes.actor == "residual":
            return ResidualActor(width, n_obs, N_ACT, BASE_START, layers, people_set)
        return PlainActor(width, n_obs, N_ACT, layers, people_set)

    def critic() -> Critics:
        shape, numbers = (width, n_obs, N_ACT, layers), range(sizes.n_critics)
        if sizes.critic == "ddpg":
            return Critics(*(LateActionQ(*shape, norm) for _ in numbers))
        if sizes.critic == "mean":
            return Critics(*(QNetwork(*shape, normed, people_set=people_set) for _ in numbers))
        networks = [QNetwork(*shape, normed, sizes.n_quantiles, people_set) for _ in numbers]
        return QuantileCritics(*networks, dropped=sizes.dropped_quantiles)

    return Networks(actor=actor, critic=critic, width=width, norm=norm)


def start(preset: ReachPreset, seed: int, cell: Cell) -> tuple[TrainingRun, TrainingMonitor]:
    """Return a training; see :func:`~app.policies.training.td3.start_td3`.

    Raises:
        InvalidInput: The cell has no goal region.
    """
    batch = batch_of(preset, cell, preset.learning.n_envs, seed)
    episode = preset.episode
    ends = episode.observation != "state" or episode.timeout == "terminates"
    return start_td3(
        preset,
        seed,
        cell,
        task=ArmTask(batch, sees_time=ends),
        exploration=exploration_of(preset.exploration, batch, seed),
        networks=networks_of(preset, batch.obs_size),
        layout=LAYOUTS[preset.episode.observation],
        visited_states=lambda: visited_states(batch),
    )


class ReachReporter(Reporter):
    """Learning curve of greedy episodes that are simulated for each point.

    Args:
        monitor: Data behind the curve.
    """

    def __init__(
        self, run: TrainingRun, callbacks: Callbacks, monitor: TrainingMonitor
    ) -> None:
        super().__init__(run, callbacks)
        self._monitor, preset = monitor, run.preset
        assert isinstance(preset, ReachPreset)
        self._test_batch = curve_batch(preset, run.cell)

    def watch(self, rewards: NDArray[np.floating]) -> None:
        """Update the training range."""
        self._monitor.update_ranges(self.num_timesteps)

    def rates(self) -> dict[str, Any]:
        """Return rates of greedy episodes of the present actor."""
        with self._run.untimed():
            return played_rates(self._monitor.actor, self._test_batch, OUTCOMES)


def visited_states(batch: ReachEnvironments) -> dict[str, Vec]:
    """Return the present states of all environments."""
    states = [part.state for part in _parts_of(batch)]
    visited = {
        "q": np.concatenate([state.q for state in states]),
        "qd": np.concatenate([state.qd for state in states]),
        "goal": np.concatenate([state.goal for state in states]),
    }
    columns = [X, Y, VX, VY, R]
    walkers = [state.people.walkers.rows[:, :, columns].reshape(-1, 5) for state in states]
    if sum(len(rows) for rows in walkers):
        visited["human"] = np.concatenate(walkers)
    return visited
