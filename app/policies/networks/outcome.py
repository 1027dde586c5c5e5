"""Probabilities of the outcomes of a pick, and its expected time.

An ensemble of small networks maps an observation, and the critic's value of it, to the
probabilities of success, contact and timeout under the policy, and to the time to success. Its
inputs are standardised by the data it was fitted to.

The interval of a probability is where the rate of its outcome lies in 95 % of cells. An
observation does not show what kind of people work in a cell, so that rates differ between cells
where the observation is the same. The log-odds of both ends differ from those of the
probability by the offsets between cells and the spread of the ensemble, widened by the factor
that held on data apart.

Source: ours. Lakshminarayanan et al., *Simple and scalable predictive uncertainty estimation
using deep ensembles* (2017). The thesis shows the critic's values only.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from app.policies.networks.actor_critic import hidden
from app.sim.core.jit import direct, kernel

Floats = NDArray[np.float32]
MEMBERS = 3
"""Networks of the ensemble."""
WIDTH = 64
"""Units per hidden layer."""
OUTCOMES = ("success", "contact", "timeout")
"""Outcomes, in the order of the probabilities."""
CLIP = 6.0
"""Bound of a standardised input."""
CERTAIN = 1e-4
"""Probability that log-odds are bounded at, and one minus that at the other end."""
N_OUT = len(OUTCOMES) + 1
"""Outputs of a network: a logit per outcome, and the time to success [s]."""


class OutcomePrediction(NamedTuple):
    """Prediction for n observations."""

    probability: Floats
    """Probability of each outcome, shape (n, 3)."""
    low: Floats
    """Lower end of the 95 % interval of each, shape (n, 3)."""
    high: Floats
    """Upper end, shape (n, 3)."""
    time_s: Floats
    """Expected time to success [s], shape (n,)."""


class OutcomeHead(nn.Module):
    """Ensemble that predicts the outcome of a pick.

    Args:
        n_obs: Length of observations.
    """

    mean: torch.Tensor
    """Mean of each input, shape (n_obs + 1,)."""
    scale: torch.Tensor
    """Standard deviation of each input, shape (n_obs + 1,)."""
    widen: torch.Tensor
    """Factor of the spread of the ensemble, shape (1,)."""
    between: torch.Tensor
    """Least and greatest offset of the log-odds of each outcome between cells, shape (3, 2)."""

    def __init__(self, n_obs: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(n_obs + 1))
        self.register_buffer("scale", torch.ones(n_obs + 1))
        self.register_buffer("widen", torch.ones(1))
        self.register_buffer("between", torch.zeros(len(OUTCOMES), 2))
        self.members = nn.ModuleList(
            nn.Sequential(*hidden(n_obs + 1, WIDTH, 2), nn.Linear(WIDTH, N_OUT))
            for _ in range(MEMBERS)
        )

    def standardised(self, obs: torch.Tensor, value: torch.Tensor) -> torch.Tensor:
        """Return inputs of the members, shape (n, n_obs + 1).

        Args:
            obs: Observations, shape (n, n_obs).
            value: The critic's values, shape (n,).
        """
        both = torch.cat([obs, value.unsqueeze(1)], dim=1)
        return ((both - self.mean) / self.scale).clamp(-CLIP, CLIP)

    def forward(self, obs: torch.Tensor, value: torch.Tensor) -> torch.Tensor:
        """Return the outputs of all members, shape (MEMBERS, n, N_OUT)."""
        rows = self.standardised(obs, value)
        return torch.stack([member(rows) for member in self.members])

    def predict(self, obs: torch.Tensor, value: torch.Tensor) -> OutcomePrediction:
        """Return the prediction for observations, shape (n, n_obs), and values, shape (n,)."""
        with torch.inference_mode():
            outputs = self(obs, value).numpy()
            return combine(outputs, float(self.widen), self.between.numpy())


@kernel(nogil=True)
def combine_members(
    outputs: Floats, widen: float, between: Floats, to: OutcomePrediction
) -> None:
    """Write the prediction of an ensemble.

    Args:
        outputs: Outputs of the members, shape (MEMBERS, n or more, N_OUT); the logits become
            probabilities.
        widen: Factor of the spread of the ensemble.
        between: Least and greatest offset of the log-odds of each outcome between cells, shape
            (3, 2).
        to: Filled, for n observations.
    """
    members, outcomes = outputs.shape[0], outputs.shape[2] - 1
    for i in range(to.time_s.shape[0]):
        for m in range(members):
            row, largest, total = outputs[m, i], outputs[m, i, 0], np.float32(0.0)
            for k in range(1, outcomes):
                largest = max(largest, row[k])
            for k in range(outcomes):
                row[k] = math.exp(row[k] - largest)
                total += row[k]
            for k in range(outcomes):
                row[k] /= total
        for k in range(outcomes + 1):
            mean, square = 0.0, 0.0
            for m in range(members):
                mean += outputs[m, i, k] / members
            for m in range(members):
                square += (outputs[m, i, k] - mean) ** 2
            if k == outcomes:
                to.time_s[i] = max(mean, 0.0)
            else:
                inside = min(max(mean, CERTAIN), 1.0 - CERTAIN)
                spread = widen * math.sqrt(square / (members - 1)) / (inside * (1.0 - inside))
                odds = math.log(inside / (1.0 - inside))
                below = math.sqrt((1.96 * spread) ** 2 + between[k, 0] ** 2)
                above = math.sqrt((1.96 * spread) ** 2 + between[k, 1] ** 2)
                to.probability[i, k] = mean
                to.low[i, k] = min(mean, 1.0 / (1.0 + math.exp(below - odds)))
                to.high[i, k] = max(mean, 1.0 / (1.0 + math.exp(-above - odds)))


@kernel()
def _write_estimates(found: OutcomePrediction, out: Floats) -> None:
    """See :func:`estimates_of`."""
    for i in range(out.shape[0]):
        for k in range(2):
            out[i, 3 * k] = found.probability[i, k]
            out[i, 3 * k + 1] = found.low[i, k]
            out[i, 3 * k + 2] = found.high[i, k]
        out[i, 6] = found.time_s[i]


@cache
def _estimating() -> Callable[..., None]:
    return direct(_write_estimates, (new_prediction(1), np.empty((1, 7), dtype=np.float32)))


def estimates_of(predicted: OutcomePrediction) -> Floats:
    """Return the fields of an ``OutcomeEstimate`` for each of n observations, shape (n, 7)."""
    found = np.empty((len(predicted.time_s), 7), dtype=np.float32)
    _estimating()(predicted, found)
    return found


def new_prediction(n: int) -> OutcomePrediction:
    """Return room for the prediction of n observations."""
    shapes = *[(n, len(OUTCOMES))] * 3, (n,)
    return OutcomePrediction(*(np.empty(shape, dtype=np.float32) for shape in shapes))


def combine(outputs: Floats, widen: float, between: Floats) -> OutcomePrediction:
    """Return the prediction of an ensemble; see :func:`combine_members`."""
    found = new_prediction(outputs.shape[1])
    combine_members(outputs, widen, between, found)
    return found
