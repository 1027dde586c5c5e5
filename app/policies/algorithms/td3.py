"""TD3 on Stable-Baselines3, with what it lacks added at its extension points.

Own networks, exploration over batched rows in place of one action noise, and an actor that may
stay frozen until the critics mean something. One class serves every scenario that moves the
arm, and DDPG too: that is TD3 with one critic, no delay and no noise on targets. Replay with
n-step returns is Stable-Baselines3's own, or ``replay.py`` where it is prioritised.

Source: Fujimoto, van Hoof, Meger, *Addressing function approximation error in actor-critic
methods* (2018); Lillicrap et al., *Continuous control with deep reinforcement learning* (2016);
thesis sections 2.7.2 and 4.4.
"""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import torch
from numpy.typing import NDArray
from stable_baselines3 import TD3
from stable_baselines3.common.policies import ContinuousCritic
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.td3.policies import Actor, TD3Policy
from torch import Tensor, nn

from app.policies.algorithms.exploration import Explorer
from app.policies.algorithms.prioritized_replay import Ints, PrioritisedReplay
from app.policies.algorithms.vecenv import CellVecEnv
from app.policies.networks.actor_critic import Critics


class TD3Numbers(Protocol):
    """The hyper-parameters of TD3; ``PickPreset`` and ``ReachPreset`` say what they are."""

    @property
    def buffer_size(self) -> int: ...  # noqa: D102
    @property
    def batch_size(self) -> int: ...  # noqa: D102
    @property
    def learning_starts(self) -> int: ...  # noqa: D102
    @property
    def lr_start(self) -> float: ...  # noqa: D102
    @property
    def lr_end(self) -> float: ...  # noqa: D102
    @property
    def gamma(self) -> float: ...  # noqa: D102
    @property
    def n_steps(self) -> int: ...  # noqa: D102
    @property
    def tau(self) -> float: ...  # noqa: D102
    @property
    def policy_delay(self) -> int: ...  # noqa: D102
    @property
    def target_noise(self) -> float: ...  # noqa: D102
    @property
    def target_noise_clip(self) -> float: ...  # noqa: D102
    @property
    def actor_frozen_updates(self) -> int: ...  # noqa: D102
    @property
    def width(self) -> int: ...  # noqa: D102


@dataclass(frozen=True, slots=True, kw_only=True)
class Networks:
    """How the networks of a training are made."""

    actor: Callable[[], nn.Module]
    """Returns a new actor."""
    critic: Callable[[], Critics]
    """Returns new critics."""
    fused: bool = False
    """Whether Adam's steps are fused: the same formula, rounded otherwise, in less time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Extras:
    """What a training may have beyond plain TD3; nothing by default."""

    update_every: int = 1
    """Vector steps per update."""
    actor_lr_ratio: float = 1.0
    """Learning rate of the actor over that of the critics."""
    alpha: float = 0.0
    """Exponent of replay priorities; 0 draws evenly."""
    beta: float = 1.0
    """Exponent of the importance weights at the start; it grows to 1."""
    ema: float = 0.0
    """Share of the actor's averaged weights that one update leaves; 0 keeps none."""
    bfloat16: bool = False
    """Whether networks are trained with products in bfloat16; weights stay float32."""


PLAIN = Extras()


class Minibatch(NamedTuple):
    """What one update learns from, ``B`` n-step transitions."""

    obs: Tensor
    """(B, obs_size)."""
    act: Tensor
    """(B, n_act)."""
    rewards: Tensor
    """Discounted sums of rewards, (B, 1)."""
    next_obs: Tensor
    """Where the sums end, (B, obs_size)."""
    discounts: Tensor
    """What the value there is multiplied by; 0 where the episode ended, (B, 1)."""
    weights: Tensor | None = None
    """Importance weights, (B, 1); None: all equal."""
    indices: Ints | None = None
    """Places in a prioritised replay memory, (B,)."""


class _SB3Actor(Actor):
    """Stable-Baselines3's actor with one of ours in place of its own network."""

    def __init__(self, *args: Any, networks: Networks, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.mu = networks.actor()  # type: ignore[assignment]


class _SB3Critic(ContinuousCritic):
    """Stable-Baselines3's critic with :class:`Critics` in place of its own networks."""

    def __init__(self, *args: Any, networks: Networks, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        for index in range(self.n_critics):
            delattr(self, f"qf{index}")
        self.own = networks.critic()
        self.q_networks = list(self.own.children())


def critics_of(critic: ContinuousCritic) -> Critics:
    """Return this project's networks inside one of Stable-Baselines3's critics."""
    assert isinstance(critic, _SB3Critic)
    return critic.own


class OwnPolicy(TD3Policy):
    """Builds the networks of this project instead of Stable-Baselines3's defaults."""

    def __init__(self, *args: Any, networks: Networks, **kwargs: Any) -> None:
        self._networks = networks
        super().__init__(*args, **kwargs)

    def make_actor(self, features_extractor: BaseFeaturesExtractor | None = None) -> Actor:
        """Return an actor of ours."""
        kwargs = self._update_features_extractor(self.actor_kwargs, features_extractor)
        return _SB3Actor(**kwargs, networks=self._networks).to(self.device)

    def make_critic(
        self, features_extractor: BaseFeaturesExtractor | None = None
    ) -> ContinuousCritic:
        """Return critics of ours."""
        kwargs = self._update_features_extractor(self.critic_kwargs, features_extractor)
        return _SB3Critic(**kwargs, networks=self._networks).to(self.device)


class BatchTD3(TD3):
    """TD3 with row-wise exploration and a frozen start of the actor.

    Args:
        preset: Hyper-parameters.
        env: The batched scenario.
        seed: Seed of networks and replay.
        exploration: Changes the actions that are tried.
        networks: How actor and critics are made.
        extras: What goes beyond plain TD3.
    """

    def __init__(
        self,
        preset: TD3Numbers,
        env: CellVecEnv,
        seed: int,
        *,
        exploration: Explorer,
        networks: Networks,
        extras: Extras = PLAIN,
    ) -> None:
        start, end = preset.lr_start, preset.lr_end
        self.preset, self.exploration, self.extras = preset, exploration, extras
        replay: dict[str, Any] = {"n_steps": preset.n_steps}
        if extras.alpha > 0.0:
            own = {"gamma": preset.gamma, "alpha": extras.alpha, "seed": seed}
            replay = {
                "replay_buffer_class": PrioritisedReplay,
                "replay_buffer_kwargs": {**replay, **own},
            }
        super().__init__(
            OwnPolicy,
            env,
            learning_rate=lambda remaining: end * (start / end) ** remaining,
            buffer_size=preset.buffer_size,
            learning_starts=preset.learning_starts,
            batch_size=preset.batch_size,
            tau=preset.tau,
            gamma=preset.gamma,
            train_freq=1,
            gradient_steps=1,
            policy_delay=preset.policy_delay,
            target_policy_noise=preset.target_noise,
            target_noise_clip=preset.target_noise_clip,
            policy_kwargs={
                "net_arch": [preset.width, preset.width],
                "networks": networks,
                "optimizer_kwargs": {"fused": True} if networks.fused else {},
            },
            seed=seed,
            device="cpu",
            **replay,
        )
        self.averaged = deepcopy(self.actor.mu) if extras.ema > 0.0 else None
        """The actor with averaged weights, if they are kept."""

    @property
    def decider(self) -> nn.Module:
        """The actor that checkpoints and curves are made of."""
        return self.actor.mu if self.averaged is None else self.averaged

    def _sample_action(
        self, learning_starts: int, action_noise: Any = None, n_envs: int = 1
    ) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return actions and what to store; the untrained policy explores like any other."""
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
        if self.num_timesteps // self.n_envs % self.extras.update_every:
            return
        self._update_learning_rate([self.actor.optimizer, self.critic.optimizer])
        for group in self.actor.optimizer.param_groups:
            group["lr"] *= self.extras.actor_lr_ratio
        for _ in range(gradient_steps):
            self._n_updates += 1
            data = self._draw(batch_size)
            self._update_critics(data)
            if self._n_updates % self.policy_delay == 0:
                if self._n_updates > self.preset.actor_frozen_updates:
                    self._update_actor(data.obs)
                _follow(self.critic_target, self.critic, self.tau)
                _follow(self.actor_target, self.actor, self.tau)

    def _draw(self, batch_size: int) -> Minibatch:
        memory = self.replay_buffer
        if isinstance(memory, PrioritisedReplay):
            done = 1.0 - self._current_progress_remaining
            beta = self.extras.beta + done * (1.0 - self.extras.beta)
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
        with torch.no_grad(), self._precision():
            noise = torch.randn_like(data.act) * self.target_policy_noise
            noise = noise.clamp(-self.target_noise_clip, self.target_noise_clip)
            act = (self.actor_target(data.next_obs) + noise).clamp(-1.0, 1.0)
            values = critics_of(self.critic_target).targets(data.next_obs, act).float()
        target = data.rewards + data.discounts * values
        with self._precision():
            loss, errors = critics.loss(data.obs, data.act, target, data.weights)
        self.critic.optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        self.critic.optimizer.step()
        if data.indices is not None:
            assert isinstance(self.replay_buffer, PrioritisedReplay)
            self.replay_buffer.update(data.indices, errors.numpy())

    def _update_actor(self, obs: Tensor) -> None:
        critics = critics_of(self.critic)
        with self._precision():
            loss = -critics.first(obs, self.actor(obs)).mean()
        self.actor.optimizer.zero_grad()
        learning = list(self.actor.mu.parameters())  # and not the critics it goes through
        loss.backward(inputs=learning)  # type: ignore[no-untyped-call]
        self.actor.optimizer.step()
        if self.averaged is not None:
            learned = (self._n_updates - self.preset.actor_frozen_updates) / self.policy_delay
            decay = min(self.extras.ema, learned / (learned + 9.0))
            _follow(self.averaged, self.actor.mu, 1.0 - decay)

    def _precision(self) -> torch.autocast:
        return torch.autocast("cpu", torch.bfloat16, enabled=self.extras.bfloat16)


def _follow(behind: nn.Module, ahead: nn.Module, share: float) -> None:
    """Move the weights of one network by a share of the way to those of another.

    Deviates: Stable-Baselines3's ``polyak_update`` says the same one tensor at a time.
    """
    with torch.no_grad():
        torch._foreach_lerp_(list(behind.parameters()), list(ahead.parameters()), share)
