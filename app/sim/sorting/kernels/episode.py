"""Episodes of the sorting task, all rows at once: starts, attempts, people, ends."""

import numpy as np
from numpy.typing import NDArray

from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.sorting.kernels.initial_states import start_row
from app.sim.sorting.kernels.interference import interfere
from app.sim.sorting.kernels.reward import SortingWeights
from app.sim.sorting.kernels.task import (
    RUNNING,
    SUCCESS,
    Ints,
    SortingRows,
    SortingRules,
    attempt,
    is_solved,
    step_reward,
    write_obs,
)


@kernel(nogil=True)
def start_rows(
    rows: SortingRows,
    rules: SortingRules,
    seed: int,
    first_row: int,
    obs: NDArray[np.uint8],
) -> None:
    """Start the episodes numbered by ``rows.episode`` and write the observations."""
    for e in range(rows.clutter.shape[0]):
        start_row(rows, rules, seed, first_row + e, e)
        write_obs(rows, e, obs[e])


@kernel(nogil=True)
def step_rows(
    rows: SortingRows,
    rules: SortingRules,
    weights: SortingWeights,
    seed: int,
    first_row: int,
    act: Ints,
    auto_reset: bool,
    obs: NDArray[np.uint8],
    last_obs: NDArray[np.uint8],
    rew: NDArray[np.float32],
    ended: Ints,
) -> None:
    """Make one attempt in every row.

    A person may interfere after it; where that happens to meet the goal the episode ends too.

    Args:
        rows: All environments; changed.
        rules: Starts, disturbances and ends.
        weights: Reward coefficients.
        seed: Seed of the batch.
        first_row: Number of row 0 in the random streams.
        act: Actions, shape (n,).
        auto_reset: Start the next episode at once; otherwise ended rows stay as they are.
        obs: Filled with the observations after the step (and start), shape (n, obs_size).
        last_obs: Filled with the final observation of rows that ended, shape (n, obs_size).
        rew: Filled with rewards, shape (n,).
        ended: Filled with the outcome of rows that ended now, RUNNING elsewhere, shape (n,).
    """
    for e in range(rows.clutter.shape[0]):
        ended[e], rew[e] = RUNNING, 0.0
        if rows.outcome[e] != RUNNING:
            continue
        rew[e] = attempt(rows, rules, weights, e, act[e]) + step_reward(rows, rules, weights, e)
        if rows.outcome[e] == RUNNING and rules.human_rate > 0.0:
            if random.uniform(rows.rng[e]) < rules.human_rate:
                interfere(rows, rules, e)
                if is_solved(rows, e):
                    rows.outcome[e] = SUCCESS
        ended[e] = rows.outcome[e]
        write_obs(rows, e, obs[e])
        if ended[e] != RUNNING and auto_reset:
            for i in range(obs.shape[1]):
                last_obs[e, i] = obs[e, i]
            rows.episode[e] += 1
            start_row(rows, rules, seed, first_row + e, e)
            write_obs(rows, e, obs[e])
