"""Actions, values and predicted outcomes of a policy for picks (compiled)."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.policies.networks.actor_critic import BASE_WEIGHT
from app.policies.networks.forward import (
    FEW,
    Flags,
    Floats,
    Layers,
    UnitsWorkspace,
    forward_few,
    new_units,
)
from app.policies.networks.outcome import (
    CLIP,
    MEMBERS,
    N_OUT,
    OutcomePrediction,
    combine_members,
)
from app.sim.core.jit import kernel


class ActorCritic(NamedTuple):
    """Networks of a policy for picks."""

    actor: Layers
    """Residual motion (``ResidualActor``)."""
    critics: tuple[Layers, ...]
    """Critics; the least value counts."""
    members: tuple[Layers, ...]
    """Members of the outcome ensemble."""
    base: int
    """Index of the base motion in an observation."""
    fade: Floats
    """Index of the clearance in an observation, and the clearances between which the residual
    fades; shape (3,), or (0,) without fading."""
    mean: Floats
    """Mean of each input of the ensemble, shape (n_obs + 1,)."""
    scale: Floats
    """Standard deviation of each, shape (n_obs + 1,)."""
    widen: float
    """Factor of the ensemble's spread."""
    between: Floats
    """Least and greatest offset of the log-odds of each outcome between cells, shape (3, 2)."""


class Workspace(NamedTuple):
    """Work space of one call."""

    units: UnitsWorkspace
    """Of the forward passes."""
    rows: Floats
    """Inputs of the critics, shape (FEW, n_obs + n_act)."""
    inputs: Floats
    """Inputs of the ensemble, shape (FEW, n_obs + 1)."""
    varying: NDArray[np.bool_]
    """Whether an input differs between rows, shape (n_obs + n_act,)."""
    value: Floats
    """Values by one critic, shape (FEW, 1)."""
    outputs: Floats
    """Outputs of the ensemble, shape (MEMBERS, FEW, N_OUT)."""


def new_workspace(networks: ActorCritic, n_obs: int, n_act: int) -> Workspace:
    """Return work space for observations and actions of these lengths."""
    every = (networks.actor, *networks.critics, *networks.members)
    return Workspace(
        new_units(every, FEW),
        np.empty((FEW, n_obs + n_act), dtype=np.float32),
        np.empty((FEW, n_obs + 1), dtype=np.float32),
        np.empty(n_obs + n_act, dtype=np.bool_),
        np.empty((FEW, 1), dtype=np.float32),
        np.empty((MEMBERS, FEW, N_OUT), dtype=np.float32),
    )


@kernel()
def compare(rows: Floats, varying: Flags) -> None:
    """Write which inputs differ between rows, shape (n, n_in)."""
    for k in range(rows.shape[1]):
        varying[k] = False
    for i in range(1, rows.shape[0]):
        for k in range(rows.shape[1]):
            varying[k] |= rows[i, k] != rows[0, k]


@kernel()
def add_base(obs: Floats, base_at: int, fade: Floats, act: Floats) -> None:
    """Turn residuals into actions, shape (n, n_act); see ``ResidualActor``, ``ActorCritic``."""
    share, one, most = np.float32(1.0), np.float32(1.0), np.float32(20.0)
    for i in range(act.shape[0]):
        if fade.shape[0] > 0:
            share = (fade[2] - obs[i, int(fade[0])]) / (fade[2] - fade[1])
            share = min(one, max(np.float32(0.0), share))
        for j in range(act.shape[1]):
            base = min(one, max(-one, obs[i, base_at + j]))
            weighted, grown = np.float32(BASE_WEIGHT) * base, math.exp(2 * min(most, act[i, j]))
            up, down = grown * (one + weighted), one - weighted
            moved = (up - down) / (up + down)  # tanh(act + atanh(weighted))
            act[i, j] = base + share * (moved - base)


@kernel()
def evaluate_few(
    networks: ActorCritic,
    obs: Floats,
    work: Workspace,
    act: Floats,
    values: Floats,
    outcomes: OutcomePrediction,
) -> None:
    """Write actions, values and outcomes of up to ``FEW`` observations.

    Args:
        obs: Observations, shape (n, n_obs).
        act: Filled, shape (n, n_act).
        values: Filled, shape (n,).
        outcomes: Filled, for n observations.
    """
    n, n_obs, n_act = obs.shape[0], obs.shape[1], act.shape[1]
    varying, value = work.varying, work.value[:n]
    compare(obs, varying[:n_obs])
    forward_few(networks.actor, obs, varying[:n_obs], work.units, act)
    rows, inputs, clip = work.rows[:n], work.inputs[:n], np.float32(CLIP)
    add_base(obs, networks.base, networks.fade, act)
    for i in range(n):
        for k in range(n_obs):
            rows[i, k] = obs[i, k]
        for j in range(n_act):
            rows[i, n_obs + j] = act[i, j]
        values[i] = np.inf
    varying[n_obs:] = True
    for critic in networks.critics:
        forward_few(critic, rows, varying, work.units, value)
        for i in range(n):
            values[i] = min(values[i], value[i, 0])
    for i in range(n):
        for k in range(n_obs + 1):
            given = obs[i, k] if k < n_obs else values[i]
            standard = (given - networks.mean[k]) / networks.scale[k]
            inputs[i, k] = min(clip, max(-clip, standard))
    compare(inputs, varying[: n_obs + 1])
    m = 0
    for member in networks.members:
        forward_few(member, inputs, varying[: n_obs + 1], work.units, work.outputs[m, :n])
        m += 1
    combine_members(work.outputs, networks.widen, networks.between, outcomes)
