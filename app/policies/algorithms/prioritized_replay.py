"""Replay buffer with priorities and n-step returns.

Transitions are stored in Stable-Baselines3's arrays, one column per environment. A transition
is sampled with probability proportional to ``priority ** alpha`` (compiled sum tree) and has
the importance weight ``(1 / (size * probability)) ** beta``, divided by the greatest weight of
the minibatch. Returns are summed over at most ``n_steps`` when a transition is sampled, up to
the end of the episode or the head of the buffer.

Source: Schaul et al., *Prioritized experience replay* (2016); docs/method.md 1.4.
Stable-Baselines3 ignores ``n_steps`` if a buffer class is given, so that one buffer does both.
"""

from typing import Any, NamedTuple

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.buffers import ReplayBuffer

from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class ReplaySamples(NamedTuple):
    """A minibatch of n-step transitions, ``B`` of them."""

    observations: torch.Tensor
    """(B, obs_size)."""
    actions: torch.Tensor
    """(B,) integers of a discrete action, or (B, n_act)."""
    rewards: torch.Tensor
    """Discounted sums of rewards, (B,)."""
    next_observations: torch.Tensor
    """Observations at the end of the sums, (B, obs_size)."""
    discounts: torch.Tensor
    """Factor of the value there; 0 where the episode terminated, (B,)."""
    weights: torch.Tensor
    """Importance weights, the greatest 1, (B,)."""
    indices: Ints
    """Places in the buffer, for :meth:`PrioritisedReplay.update`, (B,)."""


@kernel()
def _set_priority(tree: Floats, leaf: int, value: float) -> None:
    """Set a leaf of the sum tree, shape (2 * leaves,), and update the sums above it."""
    node = leaf + tree.shape[0] // 2
    tree[node] = value
    node //= 2
    while node >= 1:
        tree[node] = tree[2 * node] + tree[2 * node + 1]
        node //= 2


@kernel()
def _find(tree: Floats, mass: float) -> int:
    """Return the leaf at which the cumulative sum exceeds ``mass``."""
    node: int = 1
    leaves: int = tree.shape[0] // 2
    while node < leaves:
        node *= 2
        if mass >= tree[node] and tree[node + 1] > 0.0:
            mass -= tree[node]
            node += 1
    return node - leaves


@kernel(nogil=True)
def set_priorities(tree: Floats, leaves: Ints, values: Floats) -> None:
    """Set several leaves of the sum tree."""
    for i in range(leaves.shape[0]):
        _set_priority(tree, leaves[i], values[i])


@kernel(nogil=True)
def draw(tree: Floats, rng: random.State, leaves: Ints, chances: Floats) -> None:
    """Sample one leaf from each equal part of the total, with its probability."""
    total, n = tree[1], leaves.shape[0]
    for i in range(n):
        leaves[i] = _find(tree, (i + random.uniform(rng)) / n * total)
        chances[i] = tree[leaves[i] + tree.shape[0] // 2] / total


class Transitions(NamedTuple):
    """Stored transitions, a ring buffer: a row per step of all environments."""

    rewards: NDArray[np.float32]
    """Rewards, shape (rows, n_envs)."""
    dones: NDArray[np.float32]
    """1 where an episode ended, shape (rows, n_envs)."""
    timeouts: NDArray[np.float32]
    """1 where it was truncated, shape (rows, n_envs)."""


class Returns(NamedTuple):
    """n-step returns of n sampled transitions."""

    returns: Floats
    """Discounted sums of rewards, shape (n,)."""
    discounts: Floats
    """Factors of the value after the last step, shape (n,)."""
    last: Ints
    """Rows of the last step, shape (n,)."""


@kernel(nogil=True)
def sum_returns(
    stored: Transitions, leaves: Ints, head: int, n_steps: int, gamma: float, out: Returns
) -> None:
    """Compute n-step returns of sampled transitions.

    Args:
        stored: Stored transitions.
        leaves: Sampled transitions, ``row * n_envs + environment``, shape (n,).
        head: Row that is written next; sums end before it.
        n_steps: Maximum number of steps.
        gamma: Discount factor.
        out: Filled.
    """
    n_rows, n_envs = stored.rewards.shape
    for i in range(leaves.shape[0]):
        row, env = leaves[i] // n_envs, leaves[i] % n_envs
        total, factor = 0.0, 1.0
        for k in range(n_steps):
            total += factor * stored.rewards[row, env]
            factor *= gamma
            out.last[i] = row
            if stored.dones[row, env] > 0.0:
                if stored.timeouts[row, env] == 0.0:
                    factor = 0.0
                break
            following = (row + 1) % n_rows
            if following == head or k == n_steps - 1:
                break
            row = following
        out.returns[i], out.discounts[i] = total, factor


class PrioritisedReplay(ReplayBuffer):
    """Stable-Baselines3's buffer with priorities and n-step returns.

    Args:
        buffer_size: Capacity in transitions.
        device: Device of minibatches.
        n_envs: Number of environments.
        n_steps: Maximum number of steps of a return.
        gamma: Discount factor.
        alpha: Exponent of the priorities; 0 samples uniformly.
        seed: Seed of the sampling.
    """

    def __init__(
        self,
        buffer_size: int,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
        device: torch.device | str = "cpu",
        n_envs: int = 1,
        n_steps: int = 1,
        gamma: float = 0.99,
        alpha: float = 0.6,
        seed: int = 0,
        **_: Any,
    ) -> None:
        super().__init__(buffer_size, observation_space, action_space, device, n_envs)
        self._n_steps, self._gamma, self._alpha = n_steps, gamma, alpha
        leaves = 1 << (self.buffer_size * n_envs - 1).bit_length()  # a power of two
        self._tree = np.zeros(2 * leaves)
        self._greatest = 1.0
        self._rng = np.zeros(1, dtype=np.uint64)
        random.start_stream(seed, 0, 0, self._rng)

    def add(
        self,
        obs: NDArray[Any],
        next_obs: NDArray[Any],
        action: NDArray[Any],
        reward: NDArray[Any],
        done: NDArray[Any],
        infos: list[dict[str, Any]],
    ) -> None:
        """Add one transition per environment with the greatest priority so far."""
        leaves = self.pos * self.n_envs + np.arange(self.n_envs)
        super().add(obs, next_obs, action, reward, done, infos)
        set_priorities(self._tree, leaves, np.full(self.n_envs, self._greatest))

    def draw(self, batch_size: int, beta: float) -> ReplaySamples:
        """Sample a minibatch.

        Args:
            batch_size: Number of transitions.
            beta: Exponent of the importance weights.
        """
        leaves, last = np.empty((2, batch_size), dtype=np.int64)
        chances, returns, discounts = np.empty((3, batch_size))
        draw(self._tree, self._rng, leaves, chances)
        size = self.buffer_size if self.full else self.pos
        stored = Transitions(self.rewards, self.dones, self.timeouts)
        found = Returns(returns, discounts, last)
        sum_returns(stored, leaves, self.pos, self._n_steps, self._gamma, found)
        rows, envs = leaves // self.n_envs, leaves % self.n_envs
        weights = (size * self.n_envs * chances) ** -beta
        return ReplaySamples(
            observations=torch.as_tensor(self.observations[rows, envs]),
            actions=torch.as_tensor(self._actions_of(rows, envs)),
            rewards=torch.as_tensor(returns, dtype=torch.float32),
            next_observations=torch.as_tensor(self.next_observations[last, envs]),
            discounts=torch.as_tensor(discounts, dtype=torch.float32),
            weights=torch.as_tensor(weights / weights.max(), dtype=torch.float32),
            indices=leaves,
        )

    def _actions_of(self, rows: Ints, envs: Ints) -> NDArray[Any]:
        if isinstance(self.action_space, spaces.Discrete):
            return np.asarray(self.actions[rows, envs, 0].astype(np.int64))
        return np.asarray(self.actions[rows, envs])

    def update(self, indices: Ints, errors: NDArray[np.floating]) -> None:
        """Set priorities by temporal-difference errors.

        Args:
            indices: Places from a minibatch.
            errors: Absolute errors, shape (B,).
        """
        values = (np.asarray(errors, dtype=np.float64) + 1e-4) ** self._alpha
        self._greatest = max(self._greatest, float(values.max()))
        set_priorities(self._tree, indices, values)
