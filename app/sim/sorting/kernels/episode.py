"""Episodes of all sorting environments: starts, attempts, interference and ends (compiled)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.sorting.kernels.initial_states import start_env
from app.sim.sorting.kernels.interference import interfere
from app.sim.sorting.kernels.reward import SortingWeights
from app.sim.sorting.kernels.task import (
    RUNNING,
    SUCCESS,
    Ints,
    SortingEnvs,
    SortingRules,
    attempt,
    is_solved,
    step_reward,
    write_obs,
)


class StepBuffers(NamedTuple):
    """Arrays that a step of all environments fills."""

    obs: NDArray[np.uint8]
    """Observations after the step, or of the next episode's start, shape (n, obs_size)."""
    last_obs: NDArray[np.uint8]
    """Final observations of the episodes that ended, shape (n, obs_size)."""
    rew: NDArray[np.float32]
    """Rewards, shape (n,)."""
    ended: Ints
    """Outcomes of the episodes that ended now, RUNNING elsewhere, shape (n,)."""


@kernel(nogil=True)
def start_envs(
    envs: SortingEnvs,
    rules: SortingRules,
    seed: int,
    first_env: int,
    obs: NDArray[np.uint8],
) -> None:
    """Start the episodes numbered by ``envs.episode`` and write the observations.

    Args:
        envs: All environments; changed.
        rules: Starts of episodes.
        seed: Seed of the batch.
        first_env: Number of environment 0 in the random streams.
        obs: Filled, shape (n, obs_size).
    """
    for e in range(envs.clutter.shape[0]):
        start_env(envs, rules, seed, first_env + e, e)
        write_obs(envs, e, obs[e])


@kernel(nogil=True)
def step_envs(
    envs: SortingEnvs,
    rules: SortingRules,
    weights: SortingWeights,
    seed: int,
    first_env: int,
    act: Ints,
    auto_reset: bool,
    out: StepBuffers,
) -> None:
    """Make one attempt in every environment.

    A person may interfere after it; where that happens to meet the goal the episode ends too.

    Args:
        envs: All environments; changed.
        rules: Starts, disturbances and ends.
        weights: Reward coefficients.
        seed: Seed of the batch.
        first_env: Number of environment 0 in the random streams.
        act: Actions, shape (n,).
        auto_reset: Start the next episode at once; otherwise environments whose episode has
            ended stay as they are.
        out: Filled; observations of environments whose episode had ended before are left.
    """
    obs, rew, ended = out.obs, out.rew, out.ended
    for e in range(envs.clutter.shape[0]):
        ended[e], rew[e] = RUNNING, 0.0
        if envs.outcome[e] != RUNNING:
            continue
        rew[e] = attempt(envs, rules, weights, e, act[e]) + step_reward(envs, rules, weights, e)
        if envs.outcome[e] == RUNNING and rules.human_rate > 0.0:
            if random.uniform(envs.rng[e]) < rules.human_rate:
                interfere(envs, rules, e)
                if is_solved(envs, e):
                    envs.outcome[e] = SUCCESS
        ended[e] = envs.outcome[e]
        write_obs(envs, e, obs[e])
        if ended[e] != RUNNING and auto_reset:
            for i in range(obs.shape[1]):
                out.last_obs[e, i] = obs[e, i]
            envs.episode[e] += 1
            start_env(envs, rules, seed, first_env + e, e)
            write_obs(envs, e, obs[e])
