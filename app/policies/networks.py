"""The networks of TD3: a residual actor and critics with layer normalisation.

The actor adds to a base motion that is part of the observation,
``tanh(atanh(0.9 base) + net)``; its last layer starts near zero, so that the untrained policy
is the straight joint move. These plain modules decide in the service; ``td3.py`` trains the
same modules inside Stable-Baselines3.

Source: thesis section 5.3.4 (TD3); Lillicrap et al. 2016 and Fujimoto et al. 2018 for the
losses. Deviates: the residual action and layer normalisation are ours.
"""

import torch
from torch import nn

from app.sim.kernels.arm import CONTROLLED
from app.sim.kernels.features import BASE_START, N_FEATURES

BASE_WEIGHT = 0.9
"""Share of the full speed the base motion may ask for, so that atanh stays finite."""
FIRST_RESIDUAL = 0.05
"""Factor on the initial weights of the actor's last layer."""


class ResidualActor(nn.Module):
    """Maps observations to actions in [-1, 1].

    Args:
        width: Units per hidden layer.
        n_obs: Length of observations.
    """

    def __init__(self, width: int, n_obs: int = N_FEATURES) -> None:
        super().__init__()
        last = nn.Linear(width, CONTROLLED)
        with torch.no_grad():
            last.weight.mul_(FIRST_RESIDUAL)
            last.bias.zero_()
        self.net = nn.Sequential(
            nn.Linear(n_obs, width),
            nn.ReLU(),
            nn.Linear(width, width),
            nn.ReLU(),
            last,
        )

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return actions, shape (n, 5), for observations, shape (n, n_obs)."""
        base = obs[:, BASE_START : BASE_START + CONTROLLED]
        return torch.tanh(self.net(obs) + torch.atanh(BASE_WEIGHT * base.clamp(-1.0, 1.0)))


class QNetwork(nn.Sequential):
    """Maps (observation, action) to one value.

    Args:
        width: Units per hidden layer.
        n_obs: Length of observations.
    """

    def __init__(self, width: int, n_obs: int = N_FEATURES) -> None:
        super().__init__(
            nn.Linear(n_obs + CONTROLLED, width),
            nn.LayerNorm(width),
            nn.ReLU(),
            nn.Linear(width, width),
            nn.LayerNorm(width),
            nn.ReLU(),
            nn.Linear(width, 1),
        )


class TwinCritic(nn.Module):
    """The two value functions of TD3.

    Args:
        width: Units per hidden layer.
        n_obs: Length of observations.
    """

    def __init__(self, width: int, n_obs: int = N_FEATURES) -> None:
        super().__init__()
        self.q1 = QNetwork(width, n_obs)
        self.q2 = QNetwork(width, n_obs)

    def forward(self, obs: torch.Tensor, act: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return both values, shape (n, 1) each, of (n, n_obs) and (n, 5)."""
        both = torch.cat([obs, act], dim=1)
        return self.q1(both), self.q2(both)

    def least(self, obs: torch.Tensor, act: torch.Tensor) -> torch.Tensor:
        """Return the smaller of both values, shape (n,): the cautious estimate."""
        q1, q2 = self.forward(obs, act)
        return torch.minimum(q1, q2).squeeze(1)
