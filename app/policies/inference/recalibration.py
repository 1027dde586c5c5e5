"""Recalibration of the outcome probabilities of a policy by outcomes observed in one cell.

An observation does not reveal what kind of people work in a cell, so that probabilities fitted
to a mixture of people are biased beside each kind. A slope of the log-probabilities and an
offset of each outcome are fitted to predictions whose outcome is known. They become part of the
last layers of the checkpoint's ensemble: actions and values of a recalibrated policy are the
same, and code that uses it does not change. What the outcomes tell about the cell makes the
intervals narrower.

Source: Guo et al., *On calibration of modern neural networks* (2017); Alexandari et al.,
*Maximum likelihood with bias-corrected calibration* (2020). Deviates: normal priors around no
change, so that few outcomes change little; the fit is to the mean of the ensemble, and each
member is changed by it.
"""

from typing import NamedTuple

import numpy as np
import scipy  # loads its subpackages where they are first used
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import Checkpoint, pack
from app.policies.networks.outcome import MEMBERS, OUTCOMES

Float = NDArray[np.float64]
N = len(OUTCOMES)
LEAST_PROBABILITY = 1e-4
"""Probability that smaller ones are raised to before their logarithm is taken."""
SLOPE_STD, OFFSET_STD = 0.5, 1.0
"""Standard deviations of the priors of the slope, around 1, and of the offsets, around 0."""
MIN_OUTCOMES = 20
"""Fewest outcomes of a recalibration."""
BETWEEN = "outcome.between"
"""Name of the offsets of log-odds between cells."""
LAST = "outcome.members.{}.4."
"""Prefix of the names of the last layer of each member."""


class OutcomeMap(NamedTuple):
    """Correction of probabilities ``p``: ``softmax(slope log p + offset)``."""

    slope: float
    """Factor on the log-probabilities."""
    offset: Float
    """Offset of each outcome, shape (3,)."""

    def __call__(self, probability: Float) -> Float:
        """Return corrected probabilities of success, contact and timeout, shape (n, 3)."""
        corrected: Float = scipy.special.softmax(
            self.slope * _logarithms(probability) + self.offset, axis=1
        )
        return corrected


def _logarithms(probability: Float) -> Float:
    logarithms: Float = np.log(np.clip(probability, LEAST_PROBABILITY, 1.0))
    return logarithms


def with_timeout(success: Float, contact: Float) -> Float:
    """Return the probabilities of all three outcomes, shape (n, 3)."""
    return np.column_stack([success, contact, np.maximum(0.0, 1.0 - success - contact)])


def fit_map(probability: Float, outcome: NDArray[np.int64]) -> OutcomeMap:
    """Return the most probable correction of predictions whose outcome is known.

    Args:
        probability: Predicted probabilities of the outcomes, shape (n, 3).
        outcome: Index of the outcome of each in ``OUTCOMES``, shape (n,).
    """
    logarithms, rows = _logarithms(probability), np.arange(len(outcome))

    def loss(x: Float) -> float:
        scores = x[0] * logarithms + x[1:]
        surprise = scipy.special.logsumexp(scores, axis=1) - scores[rows, outcome]
        prior = ((x[0] - 1.0) / SLOPE_STD) ** 2 + ((x[1:] / OFFSET_STD) ** 2).sum()
        return float(surprise.sum() + 0.5 * prior)

    bounds = [(0.0, None), *[(None, None)] * N]
    x = scipy.optimize.minimize(loss, np.eye(1, 1 + N)[0], bounds=bounds).x
    return OutcomeMap(float(x[0]), np.asarray(x[1:]))


def narrowed(between: NDArray[np.float32], probability: Float) -> NDArray[np.float32]:
    """Return what is left of the offsets between cells once outcomes of a cell are known.

    The information of n outcomes on an offset of log-odds is the sum of ``p (1 - p)``; the ends
    are taken to be 1.96 standard deviations of a normal distribution.

    Args:
        between: Least and greatest offset before, shape (3, 2).
        probability: Corrected probabilities of the outcomes that were observed, shape (n, 3).
    """
    information = (probability * (1.0 - probability)).sum(axis=0)[:, None]
    return np.asarray(between / np.sqrt(1.0 + (between / 1.96) ** 2 * information), dtype="f4")


def recalibrated(
    checkpoint: Checkpoint, probability: Float, outcome: NDArray[np.int64]
) -> Checkpoint:
    """Return a checkpoint whose outcome probabilities are corrected by observed outcomes.

    Args:
        checkpoint: The policy that made the predictions.
        probability: Its predictions for picks that were then executed, shape (n, 3).
        outcome: Index of the outcome of each in ``OUTCOMES``, shape (n,).

    Raises:
        InvalidInput: The checkpoint predicts no outcomes, or there are too few of them.
    """
    arrays = checkpoint.arrays()
    if LAST.format(0) + "weight" not in arrays:
        raise InvalidInput("checkpoint", checkpoint.sha256[:12], "must predict outcomes")
    if len(outcome) < MIN_OUTCOMES:
        raise InvalidInput("outcomes", len(outcome), f"must be at least {MIN_OUTCOMES}")
    found = fit_map(probability, outcome)
    for member in range(MEMBERS):
        for name in ("weight", "bias"):
            array = arrays[LAST.format(member) + name].copy()
            array[:N] *= found.slope
            array[:N] += found.offset if name == "bias" else 0.0
            arrays[LAST.format(member) + name] = array
    if BETWEEN in arrays:
        arrays[BETWEEN] = narrowed(arrays[BETWEEN], found(probability))
    counts = np.bincount(outcome, minlength=N).tolist()
    record = {
        "from": checkpoint.sha256,
        "outcomes": dict(zip(OUTCOMES, counts, strict=True)),
        "predicted": dict(zip(OUTCOMES, probability.mean(axis=0).tolist(), strict=True)),
        "slope": found.slope,
        "offset": dict(zip(OUTCOMES, found.offset.tolist(), strict=True)),
    }
    return pack({**checkpoint.manifest, "recalibration": record}, arrays)
