"""DQN on Stable-Baselines3, extended at its extension points.

Double Q-learning, dueling networks, prioritised replay with n-step returns, action masks in
exploration, targets and prediction, and expert labels: in a part of each minibatch the exact
planner marks all optimal moves, and a large-margin loss raises one of them above the others.
The part is the first of the minibatch. The prioritised draw returns transitions in the order of
their places in the buffer, so that it is always the same region of places: until the buffer is
full the oldest transitions, afterwards those of the places that are written first. Labels
spread over the buffer gave no better policies (docs/notebook/sorting.md).

The double target is ``r + gamma^n Q_target(s', argmax_a Q_online(s', a))``.

Source: van Hasselt, Guez, Silver, *Deep reinforcement learning with double Q-learning* (2016);
Hester et al., *Deep Q-learning from demonstrations* (2018); docs/method.md 1.4, corrected.
Deviates: labels mark sets of moves, in the states that the learner visits (as in Ross, Gordon,
Bagnell, *A reduction of imitation learning to no-regret online learning*, 2011).
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import DQN
from stable_baselines3.common.type_aliases import PyTorchObs
from stable_baselines3.dqn.policies import DQNPolicy, QNetwork
from torch import Tensor
from torch.nn import functional

from app.policies.algorithms.prioritized_replay import PrioritisedReplay
from app.policies.algorithms.vecenv import COUNTERS, BatchVecEnv
from app.policies.configs.sorting import SortingPreset
from app.policies.networks.sorting_q import NETWORKS, NEVER, PrintedNetwork, SharedNetwork
from app.sim.sorting.batch import SortingBatch
from app.sim.sorting.state import SortingShape
from app.state_dict import Stateful

Expert = Callable[[NDArray[np.uint8]], NDArray[np.bool_]]
"""Marks the best moves of observations, shape (n, obs_size): shape (n, n_actions)."""


class _SB3QNetwork(QNetwork):
    """Stable-Baselines3's network with one of ours in place of its own layers."""

    q_net: SharedNetwork | PrintedNetwork  # type: ignore[assignment]

    def __init__(
        self, *args: Any, preset: SortingPreset, shape: SortingShape, **kwargs: Any
    ) -> None:
        super().__init__(*args, **{**kwargs, "net_arch": [1]})
        self.q_net = NETWORKS[preset.networks.kind](shape, preset.networks.width)

    def forward(self, obs: PyTorchObs) -> Tensor:
        """Return the values of all moves, (B, n_actions)."""
        values: Tensor = self.q_net(obs)
        return values

    def best(self, obs: Tensor) -> Tensor:
        """Return the moves of greatest value, (B,)."""
        return self.q_net.best(obs)


class SortingDQNPolicy(DQNPolicy):
    """Builds the networks of this project instead of Stable-Baselines3's default."""

    def __init__(
        self, *args: Any, preset: SortingPreset, shape: SortingShape, **kwargs: Any
    ) -> None:
        self._preset, self._shape = preset, shape
        super().__init__(*args, **kwargs)

    def make_q_net(self) -> QNetwork:
        """Return a network as the preset describes it."""
        kwargs = self._update_features_extractor(self.net_args, features_extractor=None)
        made = _SB3QNetwork(**kwargs, preset=self._preset, shape=self._shape)
        return made.to(self.device)


class SortingDQN(DQN, Stateful):
    """Double, dueling, prioritised, masked DQN with optional expert labels.

    Args:
        seed: Seed of networks, replay and exploration.
        expert: Marks optimal moves; needed where the preset uses labels.
    """

    STATE = (*COUNTERS, "exploration_rate", "_random")
    q_net: _SB3QNetwork

    def __init__(
        self,
        preset: SortingPreset,
        env: BatchVecEnv,
        tasks: SortingBatch,
        seed: int,
        expert: Expert | None = None,
    ) -> None:
        learning, exploration = preset.learning, preset.exploration
        start, end = learning.lr_start, learning.lr_end
        self.preset, self.tasks, self._expert = preset, tasks, expert
        self._random = np.random.default_rng(seed)
        super().__init__(
            SortingDQNPolicy,
            env,
            learning_rate=lambda remaining: end * (start / end) ** remaining,
            buffer_size=learning.buffer_size,
            learning_starts=learning.learning_starts,
            batch_size=learning.batch_size,
            gamma=learning.gamma,
            train_freq=1,
            gradient_steps=learning.gradient_steps,
            replay_buffer_class=PrioritisedReplay,
            replay_buffer_kwargs={
                "n_steps": learning.n_steps,
                "gamma": learning.gamma,
                "alpha": learning.alpha,
                "seed": seed,
            },
            exploration_initial_eps=exploration.eps_start,
            exploration_final_eps=exploration.eps_end,
            exploration_fraction=exploration.eps_share,
            max_grad_norm=learning.max_grad_norm,
            policy_kwargs={
                "preset": preset,
                "shape": tasks.shape,
                "optimizer_kwargs": {"fused": True},
            },
            seed=seed,
            device="cpu",
        )

    @property
    def memory(self) -> PrioritisedReplay:
        """The replay memory."""
        assert isinstance(self.replay_buffer, PrioritisedReplay)
        return self.replay_buffer

    def _on_step(self) -> None:
        """Follow the schedule of exploration; the target is copied per updates, in train."""
        self.exploration_rate = self.exploration_schedule(self._current_progress_remaining)

    def _sample_action(
        self, learning_starts: int, action_noise: Any = None, n_envs: int = 1
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Act greedily or at random among the moves, row by row."""
        masked = self.preset.networks.kind == "shared"
        moves = self.tasks.masks()
        chance = 1.0 if self.num_timesteps < learning_starts else self.exploration_rate
        at_random = self._random.random(n_envs) < chance
        scores = self._random.random(moves.shape, dtype=np.float32)
        actions = (scores * moves if masked else scores).argmax(axis=1)
        if not at_random.all():
            assert self._last_obs is not None
            with torch.no_grad():
                best = self.q_net.best(torch.as_tensor(self._last_obs))
            actions = np.where(at_random, actions, best.numpy())
        return actions, actions

    def train(self, gradient_steps: int, batch_size: int = 100) -> None:
        """Update the network ``gradient_steps`` times."""
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        done = 1.0 - self._current_progress_remaining
        beta = self.preset.learning.beta + done * (1.0 - self.preset.learning.beta)
        for _ in range(gradient_steps):
            self._update(batch_size, beta)
            self._n_updates += 1
            if self._n_updates % self.preset.learning.target_update_interval == 0:
                self.q_net_target.load_state_dict(self.q_net.state_dict())

    def _update(self, batch_size: int, beta: float) -> None:
        drawn = self.memory.draw(batch_size, beta)
        with torch.no_grad():
            following = self.q_net.best(drawn.next_observations)[:, None]
            there = self.q_net_target(drawn.next_observations).gather(1, following)[:, 0]
            target = drawn.rewards + drawn.discounts * there
        values = self.q_net(drawn.observations)
        taken = values.gather(1, drawn.actions[:, None])[:, 0]
        error = functional.smooth_l1_loss(taken, target, reduction="none")
        loss = (drawn.weights * error).mean()
        if self._expert is not None:
            n = max(1, round(self.preset.expert.share * batch_size))
            best = self._expert(drawn.observations[:n].numpy())
            short = large_margin_loss(
                values[:n], torch.as_tensor(best), self.preset.expert.margin
            )
            loss = loss + self.preset.expert.weight * short
        optimizer = self.policy.optimizer
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(optimizer.param_groups[0]["params"], self.max_grad_norm)
        optimizer.step()
        with torch.no_grad():
            self.memory.update(drawn.indices, (taken - target).abs().numpy())


def large_margin_loss(values: Tensor, best: Tensor, margin: float) -> Tensor:
    """Return the mean large-margin loss: a best move must exceed all others by ``margin``.

    Args:
        values: Values of all moves, shape (n, n_actions).
        best: Whether a move is best, shape (n, n_actions); at least one in every row.
        margin: Required difference of values.
    """
    of_best = values.masked_fill(~best, NEVER).amax(dim=1)
    of_others = (values + margin).masked_fill(best, NEVER).amax(dim=1)
    short: Tensor = functional.relu(of_others - of_best).mean()
    return short
