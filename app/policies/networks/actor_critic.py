"""The networks of TD3: actors, and critics with layer normalisation.

The residual actor adds to a base motion that is part of the observation,
``tanh(atanh(0.9 base) + net)``; its last layer starts near zero, so that the untrained policy
is the straight joint move. The plain actor has no base: untrained, it holds still. These plain
modules decide in the service; ``td3.py`` trains the same modules inside Stable-Baselines3.

Source: thesis section 5.3.4 (TD3); Lillicrap et al. 2016 and Fujimoto et al. 2018 for the
losses. Deviates: the residual action and layer normalisation are ours.
"""

from functools import reduce
from typing import NamedTuple

import torch
from torch import nn
from torch.nn import functional

from app.sim.pick.kernels.observation import BASE_START, N_FEATURES
from app.sim.robot.kernels.arm import CONTROLLED

BASE_WEIGHT = 0.9
"""Share of the full speed the base motion may ask for, so that atanh stays finite."""
FIRST_RESIDUAL = 0.05
"""Factor on the initial weights of the actor's last layer."""
CROWD_WIDTH = 64
"""Numbers by which networks that see everybody as a set describe the set."""


class CrowdShape(NamedTuple):
    """Where people stand as a set in an observation (``reach/kernels/people_set.py``)."""

    first: int
    """Numbers before them."""
    n_people: int
    """Blocks, one for each person."""
    n_block: int
    """Numbers of a block, of which the first is 1, or 0 where nobody is."""


class CrowdEncoder(nn.Module):
    """Replaces the blocks of all people in an observation by CROWD_WIDTH numbers.

    Each block goes through the same layers; of everybody who is there the greatest of each
    number counts, so that neither order nor number of people matters.

    Args:
        shape: Where the blocks are.

    Source: Zaheer et al., *Deep sets* (2017); the maximum as in Qi et al., *PointNet* (2017).
    """

    def __init__(self, shape: CrowdShape) -> None:
        super().__init__()
        self._shape = shape
        self.block = nn.Sequential(*hidden(shape.n_block, CROWD_WIDTH, 2))

    def forward(self, rows: torch.Tensor) -> torch.Tensor:
        """Return rows, shape (n, first + CROWD_WIDTH + rest), of (n, first + all + rest)."""
        first, n_people, n_block = self._shape
        last = first + n_people * n_block
        blocks = rows[:, first:last].reshape(-1, n_people, n_block)
        pooled = (self.block(blocks) * blocks[:, :, :1]).amax(dim=1)
        return torch.cat([rows[:, :first], pooled, rows[:, last:]], dim=1)


def _seen(crowd: CrowdShape | None, n_obs: int) -> tuple[int, list[nn.Module]]:
    """Return the numbers that the first layer sees, and what stands before it."""
    if crowd is None:
        return n_obs, []
    return n_obs - crowd.n_people * crowd.n_block + CROWD_WIDTH, [CrowdEncoder(crowd)]


class ResidualActor(nn.Module):
    """Maps observations to actions in [-1, 1], on top of a base motion among what it sees.

    Args:
        width: Units per hidden layer.
        n_obs: Numbers it sees, the first ones of an observation.
        n_act: Numbers of an action.
        base: Where in an observation the base motion starts.
        layers: Hidden layers.
        crowd: Where people stand as a set; None: nowhere.
    """

    def __init__(
        self,
        width: int,
        n_obs: int = N_FEATURES,
        n_act: int = CONTROLLED,
        base: int = BASE_START,
        layers: int = 2,
        crowd: CrowdShape | None = None,
    ) -> None:
        super().__init__()
        n_seen, before = _seen(crowd, n_obs)
        last = nn.Linear(width, n_act)
        with torch.no_grad():
            last.weight.mul_(FIRST_RESIDUAL)
            last.bias.zero_()
        self.crowd = nn.Sequential(*before)
        self.net = nn.Sequential(*hidden(n_seen, width, layers), last)
        self.n_obs, self.base = n_obs, slice(base, base + n_act)

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return actions, shape (n, n_act), for observations, shape (n, n_obs or more)."""
        base = obs[:, self.base].clamp(-1.0, 1.0)
        residual = self.net(self.crowd(obs[:, : self.n_obs]))
        return torch.tanh(residual + torch.atanh(BASE_WEIGHT * base))


class PlainActor(nn.Module):
    """Maps observations to actions in [-1, 1], with no motion to start from.

    Args:
        width: Units per hidden layer.
        n_obs: Numbers it sees, the first ones of an observation.
        n_act: Numbers of an action.
        layers: Hidden layers.
        crowd: Where people stand as a set; None: nowhere.
    """

    def __init__(
        self,
        width: int,
        n_obs: int,
        n_act: int,
        layers: int = 2,
        crowd: CrowdShape | None = None,
    ) -> None:
        super().__init__()
        n_seen, before = _seen(crowd, n_obs)
        self.n_obs = n_obs
        self.crowd = nn.Sequential(*before)
        self.net = nn.Sequential(*hidden(n_seen, width, layers), nn.Linear(width, n_act))
        with torch.no_grad():
            self.net[-1].weight.mul_(FIRST_RESIDUAL)  # type: ignore[operator]
            self.net[-1].bias.zero_()  # type: ignore[operator]

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return actions, shape (n, n_act), for observations, shape (n, n_obs or more)."""
        return torch.tanh(self.net(self.crowd(obs[:, : self.n_obs])))


def hidden(n_in: int, width: int, layers: int, normed: bool = False) -> list[nn.Module]:
    """Return hidden layers of rectified units, each normalised or none."""
    made: list[nn.Module] = []
    for layer in range(layers):
        made.append(nn.Linear(width if layer else n_in, width))
        if normed:
            made.append(nn.LayerNorm(width))
        made.append(nn.ReLU())
    return made


class QNetwork(nn.Sequential):
    """Maps (observation, action) to one value, or several.

    Args:
        width: Units per hidden layer.
        n_obs: Length of observations.
        n_act: Numbers of an action.
        layers: Hidden layers.
        normed: Whether they are normalised.
        n_values: Values.
        crowd: Where people stand as a set; None: nowhere.
    """

    def __init__(
        self,
        width: int,
        n_obs: int = N_FEATURES,
        n_act: int = CONTROLLED,
        layers: int = 2,
        normed: bool = True,
        n_values: int = 1,
        crowd: CrowdShape | None = None,
    ) -> None:
        n_seen, before = _seen(crowd, n_obs)
        last = hidden(n_seen + n_act, width, layers, normed)
        super().__init__(*before, *last, nn.Linear(width, n_values))


class Critics(nn.Module):
    """The value functions ``q1``, ``q2``, ...: two of them in TD3, one in DDPG.

    Args:
        width: Units per hidden layer.
        n_obs: Length of observations.
        n_act: Numbers of an action.
        n_critics: Number of value functions.
        layers: Hidden layers of each.
        normed: Whether they are normalised.
        n_values: Values that each says.
        crowd: Where people stand as a set; None: nowhere.
    """

    def __init__(
        self,
        width: int,
        n_obs: int = N_FEATURES,
        n_act: int = CONTROLLED,
        n_critics: int = 2,
        layers: int = 2,
        normed: bool = True,
        n_values: int = 1,
        crowd: CrowdShape | None = None,
    ) -> None:
        super().__init__()
        self.n_critics = n_critics
        for number in range(1, n_critics + 1):
            q = QNetwork(width, n_obs, n_act, layers, normed, n_values, crowd)
            self.add_module(f"q{number}", q)

    def forward(self, obs: torch.Tensor, act: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return all values, shape (n, 1) each, of (n, n_obs) and (n, n_act)."""
        both = torch.cat([obs, act], dim=1)
        return tuple(q(both) for q in self.children())

    def least(self, obs: torch.Tensor, act: torch.Tensor) -> torch.Tensor:
        """Return the smallest of all values, shape (n,): the cautious estimate."""
        return reduce(torch.minimum, self.forward(obs, act)).squeeze(1)

    def targets(self, obs: torch.Tensor, act: torch.Tensor) -> torch.Tensor:
        """Return the values that targets are made of, shape (n, 1): the smallest."""
        return self.least(obs, act).unsqueeze(1)

    def first(self, obs: torch.Tensor, act: torch.Tensor) -> torch.Tensor:
        """Return the first value, shape (n, 1), which an actor climbs."""
        value: torch.Tensor = next(self.children())(torch.cat([obs, act], dim=1))
        return value

    def loss(
        self,
        obs: torch.Tensor,
        act: torch.Tensor,
        target: torch.Tensor,
        weights: torch.Tensor | None,
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the sum of all squared errors' means, and errors of each row, (n,).

        Args:
            obs: Observations, (n, n_obs).
            act: Actions, (n, n_act).
            target: What they should say, (n, 1).
            weights: Importance weights, (n, 1); None: all equal.
        """
        values = [value.float() for value in self.forward(obs, act)]
        if weights is None:
            losses = [functional.mse_loss(value, target) for value in values]
        else:
            losses = [(weights * (value - target) ** 2).mean() for value in values]
        errors = torch.stack([(value.detach() - target).abs() for value in values])
        return reduce(torch.add, losses), errors.mean(dim=0).squeeze(1)
