"""Networks of DDPG as Stable-Baselines 2 makes them, for the recipes of thesis chapter 4.

Hidden layers have Glorot-uniform weights and zero biases, last layers weights in ±0.003. The
critic takes the action after its first layer. Observations are normalised by their running
mean and standard deviation and clipped; all networks of a training share one normalisation.

Source: Lillicrap et al. (2016), section 7; Glorot and Bengio (2010); the constants are those of
Stable-Baselines 2 and of the authors' parameters (docs/method.md 2.5).
"""

import torch
from torch import nn

from app.policies.networks.actor_critic import PlainActor, hidden, initialise_glorot

LAST_WEIGHT = 3e-3
"""Bound of the initial weights of last layers."""
PRIOR = 1e-2
"""Initial number of observations, and initial sum of their squares."""
LEAST_VARIANCE = 1e-2
"""Lower bound of the variance that observations are divided by."""
CLIP = 5.0
"""Bound of normalised observations."""


class RunningNormalisation(nn.Module):
    """Normalise observations by the mean and standard deviation of all that were counted."""

    def __init__(self, n_obs: int) -> None:
        super().__init__()
        zeros = torch.zeros(n_obs, dtype=torch.float64)
        self.register_buffer("total", zeros)
        self.register_buffer("squares", zeros + PRIOR)
        self.register_buffer("count", torch.tensor([PRIOR], dtype=torch.float64))
        self.total: torch.Tensor
        self.squares: torch.Tensor
        self.count: torch.Tensor

    def update(self, obs: torch.Tensor) -> None:
        """Count observations, shape (n, n_obs)."""
        rows = obs.double()
        self.total += rows.sum(dim=0)
        self.squares += (rows**2).sum(dim=0)
        self.count += len(rows)

    def moments(self) -> tuple[torch.Tensor, torch.Tensor]:
        """Return mean and standard deviation, float32 of shape (n_obs,) each."""
        mean = self.total / self.count
        variance = (self.squares / self.count - mean**2).clamp(min=LEAST_VARIANCE)
        return mean.float(), variance.sqrt().float()

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return normalised observations, shape (n, n_obs), within ±CLIP."""
        mean, spread = self.moments()
        return ((obs - mean) / spread).clamp(-CLIP, CLIP)


def initialise(net: nn.Sequential) -> None:
    """Set Glorot-uniform weights and zero biases; the last layer's weights lie in ±0.003."""
    initialise_glorot(net)
    nn.init.uniform_(net[-1].weight, -LAST_WEIGHT, LAST_WEIGHT)  # type: ignore[arg-type]


class DDPGActor(PlainActor):
    """Actor with the initial weights of DDPG.

    Args:
        norm: Normalisation of observations; None for raw ones. The others as in
            :class:`PlainActor`.
    """

    def __init__(
        self, width: int, n_obs: int, n_act: int, layers: int, norm: RunningNormalisation | None
    ) -> None:
        super().__init__(width, n_obs, n_act, layers)
        self.norm = norm
        initialise(self.net)

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return actions, shape (n, n_act), for observations, shape (n, n_obs)."""
        return super().forward(obs if self.norm is None else self.norm(obs))


class LateActionQ(nn.Module):
    """Map an observation and an action to a value; the action enters after the first layer.

    Args:
        layers: Number of hidden layers, at least 2; the others as in :class:`DDPGActor`.
    """

    def __init__(
        self, width: int, n_obs: int, n_act: int, layers: int, norm: RunningNormalisation | None
    ) -> None:
        super().__init__()
        self._n_obs, self.norm = n_obs, norm
        self.first = nn.Sequential(nn.Linear(n_obs, width), nn.ReLU())
        initialise_glorot(self.first)
        after = hidden(width + n_act, width, layers - 1)
        self.rest = nn.Sequential(*after, nn.Linear(width, 1))
        initialise(self.rest)

    def forward(self, both: torch.Tensor) -> torch.Tensor:
        """Return values, shape (n, 1), of observations beside actions, (n, n_obs + n_act)."""
        obs, act = both[:, : self._n_obs], both[:, self._n_obs :]
        seen = obs if self.norm is None else self.norm(obs)
        value: torch.Tensor = self.rest(torch.cat([self.first(seen), act], dim=1))
        return value
