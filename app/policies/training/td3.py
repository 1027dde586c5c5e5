"""The TD3 set-up of the pick and the reach scenario: model, checkpoints and monitored data."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray

from app.policies.algorithms.exploration import Exploration
from app.policies.algorithms.td3 import BatchTD3, Networks, critics_of
from app.policies.algorithms.vecenv import BatchVecEnv
from app.policies.checkpoints.training_range import Ranges
from app.policies.configs.pick import PickPreset
from app.policies.configs.reach import ReachPreset
from app.policies.training.run import Parts, TrainingRun
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.envs.tasks import ArmTask
from app.sim.pick.batch import OUTCOMES
from app.sim.scenario.step_result import StepResult

CURVE_SEED = 1_000_003
"""Seed of the episodes behind a point of the curve; no evaluation uses it."""
RANGE_EVERY = 8
"""Steps of all environments between two updates of the training range."""


class PlayedBatch(Protocol):
    """Environments that episodes are played in."""

    n_envs: int
    """Number of environments."""
    n_act: int
    """Length of an action."""

    def reset(self) -> NDArray[np.float32]:
        """Start episode 0 in every environment; return observations, (n_envs, obs_size)."""

    def step(self, act: NDArray[np.float32], *, auto_reset: bool = True) -> StepResult:
        """Move every environment through one control cycle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TD3Scenario:
    """Parts of a training that depend on the scenario."""

    task: ArmTask
    """The environments."""
    exploration: Exploration
    """Perturbs the actions."""
    networks: Networks
    """How actor and critics are made."""
    layout: list[list[Any]]
    """Names and sizes of the groups of an observation."""
    act_size: int
    """Numbers of an action."""
    visited_states: Callable[[], Mapping[str, Vec]]
    """Returns the present states of all environments, for the training range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingMonitor:
    """Data behind the learning curve of a TD3 training."""

    n_greedy: int
    """Environments without exploration, the first ones."""
    env: BatchVecEnv
    """The environments."""
    actor: torch.nn.Module
    """The actor of checkpoints."""
    ranges: Ranges
    """Training range of the states."""
    visited_states: Callable[[], Mapping[str, Vec]]
    """Returns the present states of all environments."""

    def update_ranges(self, num_timesteps: int) -> None:
        """Extend the training range by the present states, every RANGE_EVERY-th step."""
        if (num_timesteps // self.env.num_envs) % RANGE_EVERY == 0:
            self.ranges.look(self.visited_states())


def start_td3(
    preset: PickPreset | ReachPreset, seed: int, cell: Cell, scenario: TD3Scenario
) -> tuple[TrainingRun, TrainingMonitor]:
    """Return a training and its monitor.

    Args:
        scenario: Environments, exploration and networks.
    """
    env = BatchVecEnv(scenario.task)
    model = BatchTD3(
        preset.learning,
        env,
        seed,
        exploration=scenario.exploration,
        networks=scenario.networks,
    )
    targets = {
        "actor_target": model.actor_target.mu,
        "critic_target": critics_of(model.critic_target),
    }
    if model.ema_actor is not None:
        targets["actor_learned"] = model.actor.mu
    ranges = Ranges()
    parts = Parts(
        policy={"actor": model.evaluated_actor, "critic": critics_of(model.critic)},
        targets=targets,
        optimizers={
            "actor_adam": model.actor.optimizer,
            "critic_adam": model.critic.optimizer,
        },
        layout=scenario.layout,
        act_size=scenario.act_size,
        trained_range=ranges.as_json,
    )
    run = TrainingRun(preset, seed, cell, model, env, parts)
    run.state_parts["ranges"] = ranges
    monitor = TrainingMonitor(
        n_greedy=model.exploration.n_greedy,
        env=env,
        actor=model.evaluated_actor,
        ranges=ranges,
        visited_states=scenario.visited_states,
    )
    return run, monitor


def play(
    actor: torch.nn.Module, batch: PlayedBatch, gamma: float = 1.0
) -> tuple[NDArray[np.int64], NDArray[np.floating]]:
    """Play one greedy episode in every row of a batch.

    Args:
        actor: Returns actions of observations.
        gamma: Discount factor of the returns per step.

    Returns:
        Outcomes and returns, each (n_envs,).
    """
    obs = batch.reset().copy()
    ended, returns = np.zeros(batch.n_envs, dtype=np.int64), np.zeros(batch.n_envs)
    act, discount = np.zeros((batch.n_envs, batch.n_act), dtype=np.float32), 1.0
    while (live := np.flatnonzero(ended == 0)).size:
        with torch.inference_mode():
            act[live] = actor(torch.as_tensor(obs[live])).numpy()
        result = batch.step(act, auto_reset=False)
        obs, returns = result.obs.copy(), returns + discount * result.rew
        discount *= gamma
        ended = np.where(result.ended > 0, result.ended, ended)
    return ended, returns


def outcome_rates(
    ended: NDArray[np.int64], returns: NDArray[np.floating]
) -> dict[str, float | int]:
    """Return the point of a curve of played episodes."""
    shares = {name: float((ended == k).mean()) for k, name in enumerate(OUTCOMES)}
    return {
        "episodes": len(ended),
        **{name: shares[name] for name in ("success", "collision", "timeout")},
        "reward": float(returns.mean()),
    }
