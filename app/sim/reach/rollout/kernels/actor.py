"""Actor network evaluated for few states at once (compiled).

The action adds to the base motion (``base_controller.py``): ``tanh(net(obs) + atanh(w base))``,
with two hidden layers of rectified linear units. Three in four of the units are zero and are
skipped, which a library's matrix product cannot do; a library is as fast beyond ``FEW`` states.
"""

import math
from typing import NamedTuple

from app.sim.core.jit import kernel
from app.sim.prediction.kernels.networks import Floats, Hidden, Network, evaluate, new_hidden
from app.sim.reach.kernels.observation import BASE_START
from app.sim.scenario.kernels.person_observation import Obs

N_ACT = 6
"""Joints."""
FEW = 32
"""Number of states up to which this kernel is faster: 8 targets beside each of 4 people."""


class CompiledActor(NamedTuple):
    """Network and work space; for one thread."""

    net: Network
    """The network."""
    base_weight: float
    """Weight of the base motion in the action."""
    hidden: Hidden
    """Of the network."""


def new_compiled_actor(net: Network, base_weight: float) -> CompiledActor:
    """Return a network with its own work space."""
    return CompiledActor(net, base_weight, new_hidden(net))


@kernel()
def act_once(actor: CompiledActor, obs: Obs, act: Floats) -> None:
    """Write the action for one state.

    Args:
        actor: Network and work space.
        obs: Observation, shape (n_obs,).
        act: Filled, in [-1, 1], shape (N_ACT,).
    """
    evaluate(actor.net, obs, actor.hidden, act)
    for j in range(N_ACT):
        base = min(1.0, max(-1.0, obs[BASE_START + j]))
        act[j] = math.tanh(act[j] + math.atanh(actor.base_weight * base))


@kernel()
def act_batch(actor: CompiledActor, obs: Obs, acts: Floats) -> None:
    """Write the actions for some states; each result is independent of the other states.

    Args:
        actor: Network and work space.
        obs: Observations, shape (n, n_obs).
        acts: Filled, in [-1, 1], shape (n, N_ACT).
    """
    for row in range(obs.shape[0]):
        act_once(actor, obs[row], acts[row])
