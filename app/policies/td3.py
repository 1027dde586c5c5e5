"""TD3 on Stable-Baselines3, with what it lacks added at its extension points.

Own networks (residual actor, normalised critics), exploration over batched rows in place of one
action noise, and an actor that stays frozen until the critics mean something. Replay with
n-step returns is Stable-Baselines3's own.

Source: Fujimoto, van Hoof, Meger, *Addressing function approximation error in actor-critic
methods* (2018); thesis section 2.7.2.
"""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import TD3
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.utils import polyak_update
from stable_baselines3.td3.policies import Actor, TD3Policy
from torch.nn import functional

from app.policies.exploration import Exploration
from app.policies.networks import ResidualActor, TwinCritic
from app.policies.pick_preset import PickPreset
from app.policies.vecenv import PickVecEnv


class _SB3Actor(Actor):
    """Stable-Baselines3's actor with :class:`ResidualActor` in place of its own network."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.mu = ResidualActor(self.net_arch[0], self.features_dim)  # type: ignore[assignment]


class _SB3Critic(ContinuousCritic):
    """Stable-Baselines3's critic with :class:`TwinCritic` in place of its own networks."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        for index in range(self.n_critics):
            delattr(self, f"qf{index}")
        self.twin = TwinCritic(kwargs["net_arch"][0], kwargs["features_dim"])
        self.q_networks = [self.twin.q1, self.twin.q2]


def twin_of(critic: ContinuousCritic) -> TwinCritic:
    """Return this project's networks inside one of Stable-Baselines3's critics."""
    assert isinstance(critic, _SB3Critic)
    return critic.twin


class PickPolicy(TD3Policy):
    """Builds the networks of this project instead of Stable-Baselines3's defaults."""

    def make_actor(self, features_extractor: BaseFeaturesExtractor | None = None) -> Actor:
        """Return the residual actor."""
        kwargs = self._update_features_extractor(self.actor_kwargs, features_extractor)
        return _SB3Actor(**kwargs).to(self.device)

    def make_critic(
        self, features_extractor: BaseFeaturesExtractor | None = None
    ) -> ContinuousCritic:
        """Return the twin critics."""
        kwargs = self._update_features_extractor(self.critic_kwargs, features_extractor)
        return _SB3Critic(**kwargs).to(self.device)


class PickTD3(TD3):
    """TD3 with row-wise exploration and a frozen start of the actor.

    Args:
        preset: Hyper-parameters.
        env: The batched scenario.
        seed: Seed of networks, replay and exploration.
    """

    def __init__(self, preset: PickPreset, env: PickVecEnv, seed: int) -> None:
        start, end = preset.lr_start, preset.lr_end
        self.preset = preset
        self.exploration = Exploration(preset, env.batch, np.random.default_rng(seed))
        super().__init__(
            PickPolicy,
            env,
            learning_rate=lambda remaining: end * (start / end) ** remaining,
            buffer_size=preset.buffer_size,
            learning_starts=preset.learning_starts,
            batch_size=preset.batch_size,
            tau=preset.tau,
            gamma=preset.gamma,
            train_freq=1,
            gradient_steps=1,
            n_steps=preset.n_steps,
            policy_delay=preset.policy_delay,
            target_policy_noise=preset.target_noise,
            target_noise_clip=preset.target_noise_clip,
            policy_kwargs={"net_arch": [preset.width, preset.width]},
            seed=seed,
            device="cpu",
        )

    def _sample_action(
        self, learning_starts: int, action_noise: Any = None, n_envs: int = 1
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return actions and what to store; the untrained policy is the base motion."""
        assert self._last_obs is not None
        with torch.inference_mode():
            act = self.actor(torch.as_tensor(self._last_obs)).numpy()
        explored = self.exploration.apply(act)
        return explored, explored

    def train(self, gradient_steps: int, batch_size: int = 512) -> None:
        """Update critics, and every ``policy_delay``-th time actor and targets.

        Deviates: Stable-Baselines3's loop, where a frozen actor would freeze the target critics
        with it.
        """
        self.policy.set_training_mode(True)
        self._update_learning_rate([self.actor.optimizer, self.critic.optimizer])
        for _ in range(gradient_steps):
            self._n_updates += 1
            assert self.replay_buffer is not None
            data = self.replay_buffer.sample(batch_size)
            self._update_critics(data)
            if self._n_updates % self.policy_delay == 0:
                if self._n_updates > self.preset.actor_frozen_updates:
                    self._update_actor(data.observations)
                polyak_update(
                    self.critic.parameters(), self.critic_target.parameters(), self.tau
                )
                polyak_update(self.actor.parameters(), self.actor_target.parameters(), self.tau)

    def _update_critics(self, data: Any) -> None:
        with torch.no_grad():
            noise = torch.randn_like(data.actions) * self.target_policy_noise
            noise = noise.clamp(-self.target_noise_clip, self.target_noise_clip)
            act = (self.actor_target(data.next_observations) + noise).clamp(-1.0, 1.0)
            q1, q2 = self.critic_target(data.next_observations, act)
            target = data.rewards + (1.0 - data.dones) * data.discounts * torch.minimum(q1, q2)
        q1, q2 = self.critic(data.observations, data.actions)
        loss = functional.mse_loss(q1, target) + functional.mse_loss(q2, target)
        self.critic.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self.critic.optimizer.step()

    def _update_actor(self, obs: torch.Tensor) -> None:
        loss = -self.critic.q1_forward(obs, self.actor(obs)).mean()
        self.actor.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self.actor.optimizer.step()
