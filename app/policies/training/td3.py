"""TD3 trainings of the pick and reach scenarios: model, checkpoints and monitored data."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import torch
from gymnasium.spaces import flatdim

from app.policies.algorithms.exploration import Exploration
from app.policies.algorithms.td3 import BatchTD3, Networks, critics_of
from app.policies.algorithms.vecenv import BatchVecEnv
from app.policies.checkpoints.training_range import TrainingRange
from app.policies.configs.pick import PickPreset
from app.policies.configs.reach import ReachPreset
from app.policies.training.run import CheckpointParts, TrainingRun
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.envs.tasks import ArmTask

RANGE_EVERY = 8
"""Steps of all environments between two updates of the training range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingMonitor:
    """Data behind the learning curve of a TD3 training."""

    n_greedy: int
    """Environments without exploration; in picks the first ones."""
    env: BatchVecEnv
    """The environments."""
    actor: torch.nn.Module
    """The actor of checkpoints."""
    ranges: TrainingRange
    """Training range of the states."""
    visited_states: Callable[[], Mapping[str, Vec]]
    """Returns the present states of all environments."""

    def update_ranges(self, num_timesteps: int) -> None:
        """Extend the training range by the present states, every RANGE_EVERY-th step."""
        if (num_timesteps // self.env.num_envs) % RANGE_EVERY == 0:
            self.ranges.extend(self.visited_states())


def start_td3(
    preset: PickPreset | ReachPreset,
    seed: int,
    cell: Cell,
    *,
    task: ArmTask,
    exploration: Exploration,
    networks: Networks,
    layout: list[list[Any]],
    visited_states: Callable[[], Mapping[str, Vec]],
) -> tuple[TrainingRun, TrainingMonitor]:
    """Return a training and its monitor.

    Args:
        seed: Seed of everything random.
        cell: Work cell trained in.
        task: The environments.
        exploration: Perturbs the actions.
        networks: How actor and critics are made.
        layout: Names and sizes of the groups of an observation.
        visited_states: Returns the present states of all environments, for the training range.
    """
    env = BatchVecEnv(task)
    model = BatchTD3(preset.learning, env, seed, exploration=exploration, networks=networks)
    targets = {
        "actor_target": model.actor_target.mu,
        "critic_target": critics_of(model.critic_target),
    }
    if model.ema_actor is not None:
        targets["actor_learned"] = model.actor.mu
    ranges = TrainingRange()
    parts = CheckpointParts(
        policy={"actor": model.evaluated_actor, "critic": critics_of(model.critic)},
        targets=targets,
        optimizers={
            "actor_adam": model.actor.optimizer,
            "critic_adam": model.critic.optimizer,
        },
        layout=layout,
        act_size=flatdim(task.action_space),
        trained_range=ranges.as_json,
    )
    run = TrainingRun(preset, seed, cell, model, env, parts)
    run.state_parts["ranges"] = ranges
    monitor = TrainingMonitor(
        n_greedy=exploration.n_greedy,
        env=env,
        actor=model.evaluated_actor,
        ranges=ranges,
        visited_states=visited_states,
    )
    return run, monitor
