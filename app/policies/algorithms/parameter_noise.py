"""Parameter-space noise: each episode is acted by a perturbed copy of the actor.

When an episode starts, normal noise of standard deviation ``sigma`` is added to all weights and
biases of the linear layers of the actor; layer normalisation is copied. The copy acts until the
episode ends. ``sigma`` is adapted so that the root mean square of the difference between the
actions of the actor and of a newly perturbed copy, over a minibatch, approaches ``delta``:
``sigma`` is multiplied by ``FACTOR`` where it is at most ``delta``, otherwise divided by it.

Source: Plappert et al., *Parameter space noise for exploration* (2018), section 3 and appendix
B; thesis section 5.3.4.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import nn

from app.policies.algorithms.exploration import Exploration
from app.policies.networks.forward import EPSILON, Floats, Layer, Layers, layers_of
from app.sim.pick.batch import PickBatch

FACTOR = 1.01
"""Factor of one adaptation."""
ADAPT_EVERY = 50
"""Updates between two adaptations."""


class ParameterNoise(Exploration):
    """Perturbed copies of an actor, one per environment.

    Args:
        sigma: Standard deviation of the weights at first, and ``delta``, the wanted distance of
            the actions.
    """

    STATE = ("sigma", "_copies", "_rng")
    n_greedy = 0

    def __init__(self, batch: PickBatch, sigma: float, rng: np.random.Generator) -> None:
        self._batch, self._rng = batch, rng
        self.sigma, self.delta = sigma, sigma
        self._net: Any = None
        self._copies: Layers = ()

    def follow(self, actor: nn.Module) -> None:
        """Set the actor, whose ``net`` consists of linear and normalising layers."""
        self._net, n = actor.net, self._batch.n_envs
        self._copies = tuple(
            Layer(*(np.zeros((n, *one.shape), dtype=np.float32) for one in layer))
            for layer in layers_of(self._net)
        )

    def apply(self, act: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the actions of the perturbed copies, shape (n_envs, n_act).

        Args:
            act: Actions of the actor, which are not used.
        """
        for env in np.flatnonzero(self._batch.state.elapsed == 0.0):
            for copy, layer in zip(self._copies, self.perturbed(), strict=True):
                for kept, new in zip(copy, layer, strict=True):
                    kept[env] = new
        return forward(self._copies, self._batch.obs[:, None])[:, 0]

    def perturbed(self) -> Layers:
        """Return a new perturbed copy."""
        return tuple(
            layer._replace(weight=self._noisy(layer.weight), bias=self._noisy(layer.bias))
            for layer in layers_of(self._net)
        )

    def adapt(self, obs: Floats) -> None:
        """Adapt ``sigma`` to the distance of actions for observations, shape (n, n_obs)."""
        greedy, noisy = (
            forward(tuple(Layer(*(one[None] for one in layer)) for layer in layers), obs[None])
            for layers in (layers_of(self._net), self.perturbed())
        )
        near = distance(greedy, noisy) <= self.delta
        self.sigma = self.sigma * FACTOR if near else self.sigma / FACTOR

    def _noisy(self, values: Floats) -> Floats:
        drawn = self._rng.standard_normal(values.shape, dtype=np.float32)
        return values + np.float32(self.sigma) * drawn


def distance(first: Floats, second: Floats) -> float:
    """Return the root mean square of the differences of two sets of actions."""
    return float(np.sqrt(np.mean(np.square(first - second))))


def forward(layers: Layers, x: Floats) -> Floats:
    """Return the actions of k actors for n observations each, shape (k, n, n_act).

    Args:
        layers: Their layers, with the actors along the first axis.
        x: Observations, shape (k, n, n_obs).
    """
    for layer in layers:
        x = np.matmul(x, layer.weight) + layer.bias[:, None]
        if layer.gain.shape[-1]:
            centred = x - x.mean(axis=-1, keepdims=True)
            variance = np.square(centred).mean(axis=-1, keepdims=True)
            x = centred / np.sqrt(variance + np.float32(EPSILON))
            x = x * layer.gain[:, None] + layer.shift[:, None]
        if layer is not layers[-1]:
            x = np.maximum(x, np.float32(0.0))
    return np.tanh(x)
