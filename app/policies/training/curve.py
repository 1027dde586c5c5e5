"""Greedy episodes behind a point of a learning curve, the same ones at every point."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from app.sim.envs.tasks import SteppedBatch

CURVE_SEED = 1_000_003
"""Seed of the episodes behind a point of the curve; no evaluation uses it."""


def play(
    policy: Callable[[torch.Tensor], torch.Tensor], batch: SteppedBatch, gamma: float = 1.0
) -> tuple[NDArray[np.int64], NDArray[np.floating]]:
    """Play one greedy episode in every environment of a batch.

    Args:
        policy: Returns actions of observations.
        gamma: Discount factor of the returns per step.

    Returns:
        Outcomes and returns, each (n_envs,).
    """
    obs = batch.reset().copy()
    ended, returns = np.zeros(batch.n_envs, dtype=np.int64), np.zeros(batch.n_envs)
    discount = 1.0
    while (live := np.flatnonzero(ended == 0)).size:
        with torch.inference_mode():
            chosen = policy(torch.as_tensor(obs[live])).numpy()
        act = np.zeros((batch.n_envs, *chosen.shape[1:]), dtype=chosen.dtype)
        act[live] = chosen
        result = batch.step(act, auto_reset=False)
        obs, returns = result.obs.copy(), returns + discount * result.rew
        discount *= gamma
        ended = np.where(result.ended > 0, result.ended, ended)
    return ended, returns


def played_rates(
    policy: Callable[[torch.Tensor], torch.Tensor], batch: SteppedBatch, outcomes: Sequence[str]
) -> dict[str, Any]:
    """Return the point of a curve of one greedy episode in every environment of a batch."""
    ended, returns = play(policy, batch)
    counts = np.bincount(ended, minlength=len(outcomes))
    return outcome_rates(counts, float(returns.sum()), outcomes)


def outcome_rates(
    counts: NDArray[np.int64], total_return: float, outcomes: Sequence[str]
) -> dict[str, Any]:
    """Return the point of a curve of episodes; without any, its rates are None.

    Args:
        counts: Episodes of each outcome.
        total_return: Sum of their returns.
        outcomes: Names of the outcomes; the rate of one that is not among them is None.
    """
    n = int(counts.sum())
    shares = {
        name: count / n for name, count in zip(outcomes, counts.tolist(), strict=True) if n
    }
    return {
        "episodes": n,
        **{name: shares.get(name) for name in ("success", "collision", "timeout")},
        "reward": total_return / n if n else None,
    }
