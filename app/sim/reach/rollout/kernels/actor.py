"""A policy's network asked for few states at once, compiled.

The actor adds to the base motion (``reach_prospect.py``): ``tanh(net(obs) + atanh(w base))``,
with two hidden layers of rectified units, three in four of which say nothing. A library's
matrices cannot leave those out, and cost more than they do to call. Beyond ``FEW`` states they
are as fast.
"""

import math
from typing import NamedTuple

import numpy as np

from app.sim.core.jit import kernel
from app.sim.prediction.kernels.networks import Floats, Network, layer
from app.sim.reach.kernels.observation import BASE_START, Obs

N_ACT = 6
"""Joints."""
FEW = 32
"""States up to which the kernel is faster than a library: 8 targets beside each of 4 people."""


class ResidualActor(NamedTuple):
    """Network and work space; used by one thread at a time."""

    net: Network
    """The network."""
    base_weight: float
    """Share of the base motion in its action."""
    h1: Floats
    """First hidden layer, shape (width,)."""
    h2: Floats
    """Second hidden layer, shape (width,)."""


def new_residual_actor(net: Network, base_weight: float) -> ResidualActor:
    """Return a network with work space of its own."""
    h1, h2 = np.zeros((2, len(net.b1)), dtype=np.float32)
    return ResidualActor(net, base_weight, h1, h2)


@kernel()
def answer(actor: ResidualActor, obs: Obs, act: Floats) -> None:
    """Write the action for one state.

    Args:
        actor: Network and work space.
        obs: What is observed, shape (n_obs,).
        act: Filled, in [-1, 1], shape (N_ACT,).
    """
    net = actor.net
    layer(obs, net.w1, net.b1, True, actor.h1)
    layer(actor.h1, net.w2, net.b2, True, actor.h2)
    layer(actor.h2, net.w3, net.b3, False, act)
    for j in range(N_ACT):
        base = min(1.0, max(-1.0, obs[BASE_START + j]))
        act[j] = math.tanh(act[j] + math.atanh(actor.base_weight * base))


@kernel(nogil=True)
def answers(actor: ResidualActor, obs: Obs, acts: Floats) -> None:
    """Write the actions for some states, each by itself: no answer hangs on the others.

    Args:
        actor: Network and work space.
        obs: What is observed, shape (n, n_obs).
        acts: Filled, in [-1, 1], shape (n, N_ACT).
    """
    for row in range(obs.shape[0]):
        answer(actor, obs[row], acts[row])
