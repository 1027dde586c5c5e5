"""Networks of TD3: actors, and critics with layer normalisation.

The residual actor corrects the action of a nominal controller, which is part of the
observation: ``tanh(atanh(0.9 base) + net)``. Its last layer is initialised near zero, so that
the untrained policy is the nominal controller; an untrained plain actor does not move.
``td3.py`` trains these modules in Stable-Baselines3; inference uses them directly.

Source: thesis section 5.3.4 (TD3); Lillicrap et al. 2016 and Fujimoto et al. 2018 for the
losses. Deviates: the residual action and layer normalisation are ours.
"""

from functools import reduce
from typing import NamedTuple

import torch
from torch import nn
from torch.nn import functional

from app.sim.pick.kernels.observation_layout import BASE_START, N_FEATURES
from app.sim.robot.kernels.arm import CONTROLLED

BASE_WEIGHT = 0.9
"""Factor on the nominal action, which keeps atanh finite."""
FIRST_RESIDUAL = 0.05
"""Factor on the initial weights of the actor's last layer."""
SET_WIDTH = 64
"""Number of features of the set encoding."""


class PeopleSetShape(NamedTuple):
    """Position of the people set in an observation (``reach/kernels/people_set.py``)."""

    first: int
    """Index of the first block."""
    n_people: int
    """Number of blocks, one per person."""
    n_block: int
    """Length of a block; its first number is 1 if the person is present, otherwise 0."""


class ResidualFading(NamedTuple):
    """Fading of a residual with the distance to people, in units of the observation."""

    place: int
    """Index of the distance to the nearest person in an observation."""
    full: float
    """Distance below which the residual counts fully."""
    zero: float
    """Distance beyond which the base motion acts alone."""


class PeopleSetEncoder(nn.Module):
    """Set encoding: replaces the blocks of all people in an observation by SET_WIDTH numbers.

    Each block passes through the same layers; the maximum over present people is invariant to
    their order and number.

    Source: Zaheer et al., *Deep sets* (2017); the maximum as in Qi et al., *PointNet* (2017).
    """

    def __init__(self, shape: PeopleSetShape) -> None:
        super().__init__()
        self._shape = shape
        self.block = nn.Sequential(*hidden(shape.n_block, SET_WIDTH, 2))

    def forward(self, rows: torch.Tensor) -> torch.Tensor:
        """Return observations with encoded people, shape (n, first + SET_WIDTH + rest)."""
        first, n_people, n_block = self._shape
        last = first + n_people * n_block
        blocks = rows[:, first:last].reshape(-1, n_people, n_block)
        pooled = (self.block(blocks) * blocks[:, :, :1]).amax(dim=1)
        return torch.cat([rows[:, :first], pooled, rows[:, last:]], dim=1)


def _first_layer(people_set: PeopleSetShape | None, n_obs: int) -> tuple[int, list[nn.Module]]:
    """Return the input size of the first layer, and the modules before it."""
    if people_set is None:
        return n_obs, []
    n_blocks = people_set.n_people * people_set.n_block
    return n_obs - n_blocks + SET_WIDTH, [PeopleSetEncoder(people_set)]


class ResidualActor(nn.Module):
    """Map observations to actions in [-1, 1] as corrections of a nominal action.

    Args:
        width: Units per hidden layer.
        n_obs: Input size: length of the observation's part that the actor uses.
        n_act: Length of an action.
        base: Index of the nominal action in an observation.
        layers: Number of hidden layers.
        people_set: Position of the people set; None without one.
        fade: Fading of the residual away from people; None without one.
    """

    def __init__(
        self,
        width: int,
        n_obs: int = N_FEATURES,
        n_act: int = CONTROLLED,
        base: int = BASE_START,
        layers: int = 2,
        people_set: PeopleSetShape | None = None,
        fade: ResidualFading | None = None,
    ) -> None:
        super().__init__()
        n_seen, before = _first_layer(people_set, n_obs)
        last = nn.Linear(width, n_act)
        with torch.no_grad():
            last.weight.mul_(FIRST_RESIDUAL)
            last.bias.zero_()
        self.people_set = nn.Sequential(*before)
        self.net = nn.Sequential(*hidden(n_seen, width, layers), last)
        self.n_obs, self.base, self.fade = n_obs, slice(base, base + n_act), fade

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return actions, shape (n, n_act), for observations, shape (n, n_obs or more)."""
        base = obs[:, self.base].clamp(-1.0, 1.0)
        residual = self.net(self.people_set(obs[:, : self.n_obs]))
        act = torch.tanh(residual + torch.atanh(BASE_WEIGHT * base))
        if self.fade is None:
            return act
        clearance = obs[:, self.fade.place : self.fade.place + 1]
        share = (self.fade.zero - clearance) / (self.fade.zero - self.fade.full)
        return torch.lerp(base, act, share.clamp(0.0, 1.0))


class PlainActor(nn.Module):
    """Map observations to actions in [-1, 1] without a nominal action.

    Args:
        normed: Whether hidden layers are normalised; the others as in :class:`ResidualActor`.
    """

    def __init__(
        self,
        width: int,
        n_obs: int,
        n_act: int,
        layers: int = 2,
        people_set: PeopleSetShape | None = None,
        normed: bool = False,
    ) -> None:
        super().__init__()
        n_seen, before = _first_layer(people_set, n_obs)
        self.n_obs = n_obs
        self.people_set = nn.Sequential(*before)
        layers_before = hidden(n_seen, width, layers, normed)
        self.net = nn.Sequential(*layers_before, nn.Linear(width, n_act))
        with torch.no_grad():
            self.net[-1].weight.mul_(FIRST_RESIDUAL)  # type: ignore[operator]
            self.net[-1].bias.zero_()  # type: ignore[operator]

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return actions, shape (n, n_act), for observations, shape (n, n_obs or more)."""
        return torch.tanh(self.net(self.people_set(obs[:, : self.n_obs])))


def hidden(n_in: int, width: int, layers: int, normed: bool = False) -> list[nn.Module]:
    """Return hidden layers of rectified units, with layer normalisation if ``normed``."""
    made: list[nn.Module] = []
    for layer in range(layers):
        made.append(nn.Linear(width if layer else n_in, width))
        if normed:
            made.append(nn.LayerNorm(width))
        made.append(nn.ReLU())
    return made


def initialise_glorot(module: nn.Module) -> None:
    """Set Glorot-uniform weights and zero biases, as Stable-Baselines 2 does."""
    for layer in module.modules():
        if isinstance(layer, nn.Linear):
            nn.init.xavier_uniform_(layer.weight)
            nn.init.zeros_(layer.bias)


class QNetwork(nn.Sequential):
    """Map observation and action to one or several values.

    Args:
        normed: Whether hidden layers are normalised.
        n_values: Number of values: 1, or quantiles of one; the others as in
            :class:`ResidualActor`.
    """

    def __init__(
        self,
        width: int,
        n_obs: int,
        n_act: int,
        layers: int = 2,
        normed: bool = True,
        n_values: int = 1,
        people_set: PeopleSetShape | None = None,
    ) -> None:
        n_seen, before = _first_layer(people_set, n_obs)
        last = hidden(n_seen + n_act, width, layers, normed)
        super().__init__(*before, *last, nn.Linear(width, n_values))


class Critics(nn.Module):
    """The value functions ``q1``, ``q2``, ...: two of them in TD3, one in DDPG.

    Args:
        networks: Map observations beside actions, shape (n, n_obs + n_act), to values.
    """

    def __init__(self, *networks: nn.Module) -> None:
        super().__init__()
        for number, network in enumerate(networks, 1):
            self.add_module(f"q{number}", network)

    def forward(self, obs: torch.Tensor, act: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Return all values, shape (n, 1) each, of (n, n_obs) and (n, n_act)."""
        both = torch.cat([obs, act], dim=1)
        return tuple(q(both) for q in self.children())

    def least(self, obs: torch.Tensor, act: torch.Tensor) -> torch.Tensor:
        """Return the minimum over the value functions, shape (n,)."""
        return reduce(torch.minimum, self.forward(obs, act)).squeeze(1)

    def targets(self, obs: torch.Tensor, act: torch.Tensor) -> torch.Tensor:
        """Return the values for temporal-difference targets, shape (n, 1): the minimum."""
        return self.least(obs, act).unsqueeze(1)

    def first(self, obs: torch.Tensor, act: torch.Tensor) -> torch.Tensor:
        """Return the value that the actor maximises, shape (n, 1): the first function's."""
        value: torch.Tensor = next(self.children())(torch.cat([obs, act], dim=1))
        return value

    def loss(
        self,
        obs: torch.Tensor,
        act: torch.Tensor,
        target: torch.Tensor,
        weights: torch.Tensor | None,
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return the sum of mean squared errors, and mean absolute errors, shape (n,).

        Args:
            obs: Observations, shape (n, n_obs).
            act: Actions, shape (n, n_act).
            target: Target values, shape (n, 1).
            weights: Importance weights, shape (n, 1); None for equal weights.
        """
        values = [value.float() for value in self.forward(obs, act)]
        if weights is None:
            losses = [functional.mse_loss(value, target) for value in values]
        else:
            losses = [(weights * (value - target) ** 2).mean() for value in values]
        errors = torch.stack([(value.detach() - target).abs() for value in values])
        return reduce(torch.add, losses), errors.mean(dim=0).squeeze(1)


class MeanCritics(Critics):
    """Value functions whose mean is the target.

    The minimum underestimates: its values of pick episodes were 1.5 below the returns.
    """

    def targets(self, obs: torch.Tensor, act: torch.Tensor) -> torch.Tensor:
        """Return the values for temporal-difference targets, shape (n, 1): the mean."""
        return torch.stack(self.forward(obs, act)).mean(dim=0)
