"""TD3 on Stable-Baselines3, extended at its extension points.

Added are own networks, exploration per environment, an actor that is frozen at first, an
averaged actor and prioritised replay (``prioritized_replay.py``); uniform replay with n-step
returns is Stable-Baselines3's. DDPG is TD3 with one critic, no delay and no target noise.

Source: Fujimoto, van Hoof, Meger, *Addressing function approximation error in actor-critic
methods* (2018); Lillicrap et al., *Continuous control with deep reinforcement learning* (2016);
thesis sections 2.7.2 and 4.4.
"""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from numpy.typing import NDArray
from stable_baselines3 import TD3
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.td3.policies import Actor, TD3Policy
from torch import Tensor, nn

from app.policies.algorithms.exploration import Exploration
from app.policies.algorithms.parameter_noise import ADAPT_EVERY, ParameterNoise
from app.policies.algorithms.prioritized_replay import Ints, PrioritisedReplay
from app.policies.algorithms.vecenv import COUNTERS, BatchVecEnv
from app.policies.configs.td3 import TD3Learning
from app.policies.networks.actor_critic import Critics
from app.policies.networks.ddpg import RunningNormalisation
from app.state_dict import Stateful


@dataclass(frozen=True, slots=True, kw_only=True)
class Networks:
    """Factories of the networks of a training."""

    actor: Callable[[], nn.Module]
    """Returns a new actor."""
    critic: Callable[[], Critics]
    """Returns new critics."""
    width: int
    """Units per hidden layer."""
    norm: RunningNormalisation | None = None
    """Normalisation of observations that all networks share; None without one."""


class Minibatch(NamedTuple):
    """Minibatch of ``B`` n-step transitions."""

    obs: Tensor
    """(B, obs_size)."""
    act: Tensor
    """(B, n_act)."""
    rewards: Tensor
    """Discounted sums of rewards, (B, 1)."""
    next_obs: Tensor
    """Observations at the end of the sums, (B, obs_size)."""
    discounts: Tensor
    """Factors of the values there; 0 where the episode ended, (B, 1)."""
    weights: Tensor | None = None
    """Importance weights, (B, 1); None for equal ones."""
    indices: Ints | None = None
    """Places in a prioritised replay buffer, (B,)."""


def critics_of(critic: ContinuousCritic) -> Critics:
    """Return the networks inside a critic of :class:`BatchTD3Policy`."""
    assert isinstance(critic.own, Critics)
    return critic.own


class BatchTD3Policy(TD3Policy):
    """Policy with the networks of this project in place of Stable-Baselines3's."""

    def __init__(self, *args: Any, networks: Networks, **kwargs: Any) -> None:
        self._networks = networks
        super().__init__(*args, **kwargs)

    def make_actor(self, features_extractor: BaseFeaturesExtractor | None = None) -> Actor:
        """Return an actor with the network of this project."""
        actor = super().make_actor(features_extractor)
        actor.mu = self._networks.actor()  # type: ignore[assignment]
        return actor

    def make_critic(
        self, features_extractor: BaseFeaturesExtractor | None = None
    ) -> ContinuousCritic:
        """Return critics with the networks of this project."""
        critic = super().make_critic(features_extractor)
        for index in range(critic.n_critics):
            delattr(critic, f"qf{index}")
        critic.own = self._networks.critic()
        critic.q_networks = list(critic.own.children())
        return critic


class BatchTD3(TD3, Stateful):
    """TD3 with exploration per environment, a frozen start and an averaged actor."""

    STATE = (*COUNTERS, "exploration")

    def __init__(
        self,
        learning: TD3Learning,
        env: BatchVecEnv,
        seed: int,
        *,
        exploration: Exploration,
        networks: Networks,
    ) -> None:
        start, end = learning.lr_start, learning.lr_end
        self.learning, self.exploration = learning, exploration
        self._norm = networks.norm
        replay: dict[str, Any] = {"n_steps": learning.n_steps}
        if learning.alpha > 0.0:
            own = {"gamma": learning.gamma, "alpha": learning.alpha, "seed": seed}
            replay = {
                "replay_buffer_class": PrioritisedReplay,
                "replay_buffer_kwargs": {**replay, **own},
            }
        super().__init__(
            BatchTD3Policy,
            env,
            learning_rate=lambda remaining: end * (start / end) ** remaining,
            buffer_size=learning.buffer_size,
            learning_starts=learning.learning_starts,
            batch_size=learning.batch_size,
            tau=learning.tau,
            gamma=learning.gamma,
            train_freq=1,
            gradient_steps=learning.gradient_steps,
            policy_delay=learning.policy_delay,
            target_policy_noise=learning.target_noise,
            target_noise_clip=learning.target_noise_clip,
            policy_kwargs={
                "net_arch": [networks.width, networks.width],
                "networks": networks,
                "optimizer_kwargs": {"fused": True},
            },
            seed=seed,
            device="cpu",
            **replay,
        )
        shared = {} if self._norm is None else {id(self._norm): self._norm}
        self.ema_actor = deepcopy(self.actor.mu, shared) if learning.ema > 0.0 else None
        """The actor with averaged weights; None where no average is kept."""

    @property
    def evaluated_actor(self) -> nn.Module:
        """The actor of checkpoints and learning curves."""
        return self.actor.mu if self.ema_actor is None else self.ema_actor

    def _sample_action(
        self, learning_starts: int, action_noise: Any = None, n_envs: int = 1
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return actions, twice: to take and to store. There is no uniform warm-up phase."""
        assert self._last_obs is not None
        obs = torch.as_tensor(self._last_obs)
        if self._norm is not None:
            self._norm.update(obs)
        with torch.inference_mode():
            act = self.actor(obs).numpy()
        explored = self.exploration.apply(act)
        return explored, explored

    def train(self, gradient_steps: int, batch_size: int = 512) -> None:
        """Update the critics, and every ``policy_delay``-th time actor and targets.

        Deviates: in Stable-Baselines3's loop a frozen actor would freeze the target critics.
        """
        if self.num_timesteps // self.n_envs % self.learning.update_every:
            return
        self._update_learning_rate([self.actor.optimizer, self.critic.optimizer])
        for group in self.actor.optimizer.param_groups:
            group["lr"] *= self.learning.actor_lr_ratio
        for _ in range(gradient_steps):
            self._n_updates += 1
            data = self._draw(batch_size)
            self._update_critics(data)
            if self._n_updates % ADAPT_EVERY == 0 and isinstance(
                self.exploration, ParameterNoise
            ):
                self.exploration.adapt(data.obs.numpy())
            if self._n_updates % self.policy_delay == 0:
                if self._n_updates > self.learning.actor_frozen_updates:
                    self._update_actor(data.obs)
                _polyak_update(self.critic_target, self.critic, self.tau)
                _polyak_update(self.actor_target, self.actor, self.tau)

    def _draw(self, batch_size: int) -> Minibatch:
        memory = self.replay_buffer
        if isinstance(memory, PrioritisedReplay):
            done = 1.0 - self._current_progress_remaining
            beta = self.learning.beta + done * (1.0 - self.learning.beta)
            drawn = memory.draw(batch_size, beta)
            return Minibatch(
                obs=drawn.observations,
                act=drawn.actions,
                rewards=drawn.rewards.unsqueeze(1),
                next_obs=drawn.next_observations,
                discounts=drawn.discounts.unsqueeze(1),
                weights=drawn.weights.unsqueeze(1),
                indices=drawn.indices,
            )
        assert memory is not None
        data = memory.sample(batch_size)
        discounts = self.gamma if data.discounts is None else data.discounts
        return Minibatch(
            obs=data.observations,
            act=data.actions,
            rewards=data.rewards,
            next_obs=data.next_observations,
            discounts=(1.0 - data.dones) * discounts,
        )

    def _update_critics(self, data: Minibatch) -> None:
        critics = critics_of(self.critic)
        with torch.no_grad():
            noise = torch.randn_like(data.act) * self.target_policy_noise
            noise = noise.clamp(-self.target_noise_clip, self.target_noise_clip)
            act = (self.actor_target(data.next_obs) + noise).clamp(-1.0, 1.0)
            values = critics_of(self.critic_target).targets(data.next_obs, act)
        target = data.rewards + data.discounts * values
        loss, errors = critics.loss(data.obs, data.act, target, data.weights)
        self.critic.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self.critic.optimizer.step()
        if data.indices is not None:
            assert isinstance(self.replay_buffer, PrioritisedReplay)
            self.replay_buffer.update(data.indices, errors.numpy())

    def _update_actor(self, obs: Tensor) -> None:
        critics = critics_of(self.critic)
        loss = -critics.first(obs, self.actor(obs)).mean()
        self.actor.optimizer.zero_grad()
        updated = list(self.actor.mu.parameters())  # the critics keep their gradients
        loss.backward(inputs=updated)  # type: ignore[no-untyped-call]
        self.actor.optimizer.step()
        if self.ema_actor is not None:
            learned = (self._n_updates - self.learning.actor_frozen_updates) / self.policy_delay
            decay = min(self.learning.ema, learned / (learned + 9.0))
            _polyak_update(self.ema_actor, self.actor.mu, 1.0 - decay)


def _polyak_update(target: nn.Module, source: nn.Module, tau: float) -> None:
    """Move the weights of one network toward those of another by a share.

    Deviates: Stable-Baselines3's ``polyak_update`` does the same one tensor at a time.
    """
    with torch.no_grad():
        torch._foreach_lerp_(list(target.parameters()), list(source.parameters()), tau)
