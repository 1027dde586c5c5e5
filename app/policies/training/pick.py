"""Training on the pick scenario: settings, networks, exploration and learning curve."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from app.policies.algorithms.exploration import (
    Exploration,
    OptionExploration,
    PerEnvAR1Noise,
)
from app.policies.algorithms.parameter_noise import ParameterNoise
from app.policies.algorithms.td3 import BatchTD3, Networks, critics_of
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.model_state import tensors_under
from app.policies.configs.pick import PickPeople, PickPreset
from app.policies.networks.actor_critic import Critics
from app.policies.networks.outcome import OutcomeHead
from app.policies.networks.pick import LAYOUTS, actor_of, critics_for
from app.policies.training.curve import CURVE_SEED, outcome_rates, played_rates
from app.policies.training.outcome import FitStopped, collect, fit, offsets_between
from app.policies.training.reporter import Callbacks, Reporter
from app.policies.training.run import TrainingRun
from app.policies.training.td3 import TrainingMonitor, start_td3
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.envs.tasks import ArmTask
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.people.kernels.people import ABSENT
from app.sim.pick.batch import OUTCOMES, PickBatch, PickSettings
from app.sim.pick.curriculum_batch import CurriculumPickBatch, StartRange
from app.sim.pick.kernels.reward import RewardWeights
from app.sim.pick.monitored_batch import MonitoredPickBatch
from app.sim.pick.valued_targets import ValuedTargetBatch, Values
from app.sim.robot.kernels.arm import CONTROLLED
from app.sim.safety.layer import safety_settings
from app.sim.scenario.monitoring import MonitoringSettings
from app.sim.scene.scene import HumanKind

OUTCOME_SEED = 7_000_003
"""Added to the seed of a training for the episodes that outcomes are fitted to."""
OUTCOME_SHARE = 0.25
"""Steps of these episodes, relative to the training."""
FIRST_MODE = 0.05
"""First mode and lower limit of the starts of the curriculum: "close to 0" (thesis 5.3.4)."""
MIN_EPISODES = 100
"""Fewest ended episodes that outcomes are fitted to."""
CELLS, CELL_SHARE = 39, 0.06
"""Cells with people of one kind, 38 of 40 further ones like between them, and the steps in all
of them, relative to the training."""


def visited_states(batch: PickBatch) -> dict[str, Vec]:
    """Return the present states of all environments."""
    state, people = batch.state, batch.state.people
    there = people.track != ABSENT
    visited = {"q": state.q, "qd": state.qd, "goal": state.goal}
    if there.any():
        visited |= {"human_q": people.q[there], "human_qd": people.qd[there]}
    return visited


def work_of(people: PickPeople) -> HumanMotionConfig:
    """Return the motion of the workers of a preset."""
    return HumanMotionConfig(
        motion=people.human_motion,
        pace=people.human_pace,
        pace_max=max(people.human_pace, people.human_pace_max),
        at_rest=people.human_at_rest,
        yielding=people.human_yielding,
        off_task=people.human_off_task,
        absent=people.human_absent,
        augmentation=people.augmentation == "sampled",
    )


def workers_of(people: PickPeople) -> tuple[HumanKind, ...] | None:
    """Return the workers of a preset; None for one, as in the cell."""
    worker: HumanKind = "worker"
    return None if people.n_people == 1 else (worker,) * people.n_people


def settings_of(preset: PickPreset) -> PickSettings:
    """Return the scenario's settings of a preset."""
    of_training = {"task", "target_choice", "curriculum_steps", "timeout", "safety"}
    return PickSettings(
        **preset.episode.model_dump(exclude=of_training),
        grasp=preset.episode.grasp,
        people=workers_of(preset.people),
        work=work_of(preset.people),
        action=preset.action.settings,
        weights=RewardWeights(**preset.reward.model_dump(exclude={"c_c_end"}), gamma=1.0),
    )


def batch_of(preset: PickPreset, cell: Cell, n_envs: int, seed: int) -> PickBatch:
    """Return the environments of a preset."""
    settings = settings_of(preset)
    if preset.episode.safety == "ssm":
        monitoring = MonitoringSettings(rest_ends=False)
        return MonitoredPickBatch(
            cell, n_envs, seed, settings, safety_settings(cell), monitoring
        )
    kind = CurriculumPickBatch if preset.episode.curriculum_steps else PickBatch
    if preset.episode.target_choice == "critic":
        kind = ValuedTargetBatch
    return kind(cell, n_envs, seed, settings)


def values_of(actor: torch.nn.Module, critics: Critics) -> Values:
    """Return the values that decisions choose by: the least critic's of the actor's action."""

    def values(obs: NDArray[np.float32]) -> NDArray[np.floating]:
        given = torch.as_tensor(obs)
        with torch.inference_mode():
            return critics.least(given, actor(given)).float().numpy()

    return values


def curve_batch(preset: PickPreset, cell: Cell) -> PickBatch:
    """Return the environments of a point of the curve; robots start at the sampled starts.

    Targets are drawn uniformly. The safety layer acts where it does in the training.
    """
    sampled = {"curriculum_steps": 0, "target_choice": "uniform"}
    plain = preset.model_copy(update={"episode": preset.episode.model_copy(update=sampled)})
    return batch_of(plain, cell, preset.learning.progress_episodes, CURVE_SEED)


def exploration_of(preset: PickPreset, batch: PickBatch, seed: int) -> Exploration:
    """Return the exploration of a preset."""
    rng, config = np.random.default_rng(seed), preset.exploration
    if config.noise == "parameters":
        return ParameterNoise(batch, config.parameter_sigma, rng)
    noise = PerEnvAR1Noise((batch.n_envs, CONTROLLED), batch.arm.dt, config, rng)
    return OptionExploration(noise, batch, batch.world.station_q, config.option_rate, rng)


def start(preset: PickPreset, seed: int, cell: Cell) -> tuple[TrainingRun, TrainingMonitor]:
    """Return a training; see :func:`~app.policies.training.td3.start_td3`."""
    batch = batch_of(preset, cell, preset.learning.n_envs, seed)
    follow_schedules(preset, batch, 0)
    exploration = exploration_of(preset, batch, seed)
    run, monitor = start_td3(
        preset,
        seed,
        cell,
        task=ArmTask(batch, sees_time=preset.episode.sees_time),
        exploration=exploration,
        networks=Networks(
            actor=lambda: actor_of(preset, batch.obs_size),
            critic=lambda: critics_for(preset, batch.obs_size),
            width=preset.networks.width,
        ),
        layout=LAYOUTS[preset.episode.observation],
        visited_states=lambda: visited_states(batch),
    )
    if isinstance(batch, ValuedTargetBatch):
        assert isinstance(run.model, BatchTD3)
        batch.values = values_of(monitor.actor, critics_of(run.model.critic))
    if isinstance(exploration, ParameterNoise):
        exploration.follow(monitor.actor)
    return run, monitor


def add_outcomes(run: TrainingRun, preset: PickPreset, should_stop: Callable[[], bool]) -> bool:
    """Fit the outcome probabilities of a finished policy and add them to its checkpoint.

    The checkpoint gets none where fewer than MIN_EPISODES ended.

    Args:
        should_stop: Called before every step and every pass over the data.

    Returns:
        Whether that was done; false where ``should_stop`` ended it.
    """
    try:
        head = outcomes_of(run.policy(), preset, run.cell, should_stop)
    except FitStopped:
        return False
    if head is not None:
        run.add("outcome", head)
    return True


def outcomes_of(
    checkpoint: Checkpoint, preset: PickPreset, cell: Cell, should_stop: Callable[[], bool]
) -> OutcomeHead | None:
    """Return outcome probabilities fitted to episodes of a policy beside its training's people.

    Args:
        checkpoint: Actor and critics.
        preset: Preset of their training.
        cell: Cell of their training.
        should_stop: Called before every step and every pass over the data.

    Returns:
        The ensemble, with the offsets between cells; None where fewer than MIN_EPISODES ended.

    Raises:
        FitStopped: ``should_stop`` asked for it.
    """
    seed = int(checkpoint.manifest["seed"]) + OUTCOME_SEED
    batch = batch_of(preset, cell, preset.learning.n_envs, seed)
    head = outcomes_beside(checkpoint, preset, batch, should_stop)
    if head is None:
        return None
    actor, critic = _networks_of(checkpoint, preset, batch.obs_size)
    n_steps = round(CELL_SHARE * preset.learning.total_steps / CELLS) // batch.n_envs
    cells = [
        collect(
            batch_of(preset.model_copy(update={"people": people}), cell, batch.n_envs, one),
            actor,
            critic,
            max(1, n_steps),
            one,
            should_stop,
            shortened=0.0,
        )
        for one, people in enumerate(people_of_cells(preset.people, CELLS, seed), seed + 1)
    ]
    head.between.copy_(torch.as_tensor(offsets_between(head, cells)))
    return head


def people_of_cells(people: PickPeople, n: int, seed: int) -> list[PickPeople]:
    """Return the people of n cells, of one kind in each, as a preset draws them per episode.

    Cells differ in the number of people, their pace, whether they are off task, and whether
    they stand still at times.
    """
    rng, cells = np.random.default_rng(seed), list[PickPeople]()
    slowest, fastest = people.human_pace, max(people.human_pace, people.human_pace_max)
    for _ in range(n):
        there = np.count_nonzero(rng.random(people.n_people) >= people.human_absent)
        pace = slowest + (fastest - slowest) * rng.random() ** 2  # as a person's is drawn
        kind = {
            "n_people": max(1, int(there)),
            "human_absent": 0.0,
            "human_pace": pace,
            "human_pace_max": pace,
            "human_off_task": float(rng.random() < people.human_off_task),
            "human_at_rest": float(rng.random() < people.human_at_rest),
        }
        cells.append(people.model_copy(update=kind))
    return cells


def outcomes_beside(
    checkpoint: Checkpoint,
    preset: PickPreset,
    batch: PickBatch,
    should_stop: Callable[[], bool],
) -> OutcomeHead | None:
    """Return outcome probabilities fitted to episodes of a policy in given environments.

    Args:
        checkpoint: Actor and critics.
        preset: Preset of their training; a share of its steps is simulated.
        batch: Environments.
        should_stop: Called before every step and every pass over the data.

    Returns:
        The ensemble; None where fewer than MIN_EPISODES ended.

    Raises:
        FitStopped: ``should_stop`` asked for it.
    """
    seed = int(checkpoint.manifest["seed"])
    actor, critic = _networks_of(checkpoint, preset, batch.obs_size)
    n_steps = round(OUTCOME_SHARE * preset.learning.total_steps) // batch.n_envs
    data = collect(batch, actor, critic, n_steps, seed, should_stop)
    if len(np.unique(data.episode)) < MIN_EPISODES:
        return None
    return fit(data, seed, should_stop)


def _networks_of(
    checkpoint: Checkpoint, preset: PickPreset, n_obs: int
) -> tuple[torch.nn.Module, Critics]:
    """Return actor and critics of a checkpoint."""
    arrays = checkpoint.arrays()
    actor, critic = actor_of(preset, n_obs), critics_for(preset, n_obs)
    actor.load_state_dict(tensors_under(arrays, "actor"))
    critic.load_state_dict(tensors_under(arrays, "critic"))
    return actor, critic


def collision_cost(preset: PickPreset, step: int) -> float:
    """Return the collision cost at an environment step, growing over the training."""
    share = min(1.0, step / preset.learning.total_steps)
    return preset.reward.c_c + share * (preset.reward.c_c_end - preset.reward.c_c)


def start_range(preset: PickPreset, step: int) -> StartRange:
    """Return the lower limit and the mode of the curriculum at an environment step.

    The mode moves from ``FIRST_MODE`` to 1 in ``curriculum_steps``, then the lower limit.
    """
    done = step / preset.episode.curriculum_steps
    low, mode = (
        FIRST_MODE + (1.0 - FIRST_MODE) * float(np.clip(x, 0.0, 1.0))
        for x in (done - 1.0, done)
    )
    return StartRange(low, mode)


def follow_schedules(preset: PickPreset, batch: PickBatch, step: int) -> None:
    """Set the collision cost and the starts of an environment step."""
    batch.set_collision_cost(collision_cost(preset, step))
    if isinstance(batch, CurriculumPickBatch):
        batch.starts = start_range(preset, step)


class PickReporter(Reporter):
    """Learning curve of the greedy environments, or of greedy episodes for each point.

    It also sets the collision cost and the starts of the present step.

    Args:
        monitor: Data behind the curve.
    """

    STATE = (*Reporter.STATE, "_returns", "_counts", "_total_return")

    def __init__(
        self, run: TrainingRun, callbacks: Callbacks, monitor: TrainingMonitor
    ) -> None:
        super().__init__(run, callbacks)
        assert isinstance(run.preset, PickPreset)
        assert isinstance(monitor.env.batch, PickBatch)
        self._monitor, self._preset, self._batch = monitor, run.preset, monitor.env.batch
        self._returns = np.zeros(run.preset.learning.n_envs)
        self._counts = np.zeros(len(OUTCOMES), dtype=np.int64)
        self._total_return = 0.0
        plays = run.preset.learning.progress_episodes > 0
        self._test_batch = curve_batch(run.preset, run.cell) if plays else None

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore a state, and the collision cost and the starts of its step."""
        super().load_state_dict(state)
        follow_schedules(self._preset, self._batch, self._run.step)

    def watch(self, rewards: NDArray[np.floating]) -> None:
        """Count the episodes that ended, and update the training range."""
        n, ended = self._monitor.n_greedy, self._monitor.env.ended
        self._returns += rewards
        finished = ended[:n] > 0
        self._counts += np.bincount(ended[:n][finished], minlength=len(OUTCOMES))
        self._total_return += float(self._returns[:n][finished].sum())
        self._returns[ended > 0] = 0.0
        self._monitor.update_ranges(self.num_timesteps)
        follow_schedules(self._preset, self._batch, self.num_timesteps)

    def rates(self) -> dict[str, Any]:
        """Return rates of the episodes since the last point.

        An episode that ends *unfeasible* counts in ``episodes`` and has no rate of its own.
        """
        if self._test_batch is not None:
            with self._run.untimed():
                return played_rates(self._monitor.actor, self._test_batch, OUTCOMES)
        rates = outcome_rates(self._counts, self._total_return, OUTCOMES)
        self._counts[:], self._total_return = 0, 0.0
        return rates
