"""Protocol ``risk-calibration``: whether predicted probabilities of outcomes agree with rates.

Each row has people of one kind. In ``mixture`` they are those of the training, in postures that
it did not have; in ``short-time`` they are the library's, and the episodes have any time left,
down to almost none. In every episode one random target is pursued; at the start and at one
random step the probabilities of success and contact are compared with the outcome. The expected
calibration error (ECE) is the mean absolute difference of probability and rate over ten bins of
equal counts; ``ece_floor`` is the ECE of perfectly calibrated predictions with these counts, if
the two predictions of an episode come true together as often as possible. The Brier score is
compared with that of a constant; AUC measures how well the probability ranks episodes.
The expected time to success is compared with the time that passed in the episodes that
succeeded.

The probabilities were fitted to the mixture of people of the training; an observation does not
reveal the kind of a person. ``recalibrated`` states ECE, Brier score and the bins with their
intervals after a recalibration (``recalibration.py``) by one prediction of each of few and of
many episodes beside the same kind of people, measured on the half of the episodes that the fit
did not use.

Source: Guo et al., *On calibration of modern neural networks* (2017); Brier (1950).
"""

from dataclasses import replace
from functools import partial

import numpy as np
import scipy  # loads scipy.stats where it is first used

from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.pick.episodes import Evaluator, PickBench, SelectionInput
from app.policies.evaluation.pick.people import beside_recordings
from app.policies.evaluation.pick.tasks import FASTER, PAIR, settings_of
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import Flags, Index
from app.policies.inference.recalibration import OutcomeMap, fit_map, narrowed, with_timeout
from app.policies.networks.outcome import CERTAIN, Floats
from app.policies.training.pick import work_of, workers_of
from app.sim.core.arrays import Vec
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.scenario.kernels.episode import COLLISION, SUCCESS

DEFAULT_EPISODES = 2000
BINS = 10
"""Bins of equal counts."""
FEW = 200
"""Episodes of a recalibration by few of them."""
LATEST_S = 4.0
"""Latest time at which a prediction is taken [s]."""
MIXTURE, SHORT_TIME = "mixture", "short-time"
"""Rows of the people of the training, and of episodes with any time left."""


class _Predictions:
    """Selection rule of one target that keeps predictions at the start and at a random step."""

    def __init__(self, n: int, dt: float, seed: int) -> None:
        self._at = np.random.default_rng(seed).integers(1, round(LATEST_S / dt), n)
        self._step, self._dt = 0, dt
        self.rows: list[Index] = []
        self.times: list[Vec] = []
        """Time since the start [s], (k,)."""
        self.predictions: list[Vec] = []
        """Probabilities of success and contact, lower and upper ends of their intervals, and
        expected times to success [s], (k, 7)."""

    def __call__(self, view: SelectionInput) -> Index:
        wanted, now_s = view.first | (self._at[view.rows] == self._step), self._step * self._dt
        self._step += 1
        if wanted.any() and view.outcomes is not None:
            self.rows.append(view.rows[wanted])
            self.times.append(np.full(np.count_nonzero(wanted), now_s))
            self.predictions.append(view.outcomes[wanted, 0])
        return np.zeros(len(view.rows), dtype=np.int64)


def run_calibration(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Compare predicted probabilities with rates, for each kind of people by itself.

    Raises:
        InvalidInput: The checkpoint predicts no outcomes, or there is too much recorded motion.
    """
    bench = bench_of(checkpoint, request)
    kinds = kinds_of(bench)
    rows, stated = request.rows(len(kinds)), {}
    for name, settings in kinds.items():
        evaluator = bench.evaluator(settings)
        rows.append(calibration_row(evaluator, name, request.seed))
        stated[name] = settings_of(evaluator.batch)
    return {"settings": stated, "results": rows}


def bench_of(checkpoint: Checkpoint, request: EvaluationRequest) -> PickBench:
    """Return the bench of a checkpoint, with one target per episode.

    Raises:
        InvalidInput: The checkpoint predicts no outcomes.
    """
    bench = PickBench(checkpoint, request, (1, 1), DEFAULT_EPISODES)
    if not bench.networks.predicts:
        raise InvalidInput("checkpoint", checkpoint.sha256[:12], "must predict outcomes")
    return bench


def kinds_of(bench: PickBench) -> dict[str, PickSettings]:
    """Return the settings of each kind of people, by the name of its row.

    Raises:
        InvalidInput: There is too much recorded motion.
    """
    usual, trained_beside = bench.usual, bench.preset.people
    trained = replace(work_of(trained_beside), seed=usual.work.seed)
    kinds: dict[str, PickSettings] = {
        "library": usual,
        "faster": replace(usual, work=replace(usual.work, pace=FASTER)),
        "two-people": replace(usual, people=PAIR),
        "off-task": replace(usual, work=replace(usual.work, off_task=1.0)),
        "stops": replace(usual, work=replace(usual.work, at_rest=1.0)),
        MIXTURE: replace(usual, people=workers_of(trained_beside), work=trained),
        SHORT_TIME: usual,
    }
    if bench.request.motions:
        kinds["recorded"] = beside_recordings(usual, bench.request.motions, bench.cell)
    return kinds


def calibration_row(evaluator: Evaluator, name: str, seed: int) -> Json:
    """Return the row of one kind of people.

    Args:
        evaluator: Episodes with one target.
        name: Name of the row.
        seed: Seed of the steps at which predictions are taken, and of the recalibrations.
    """
    batch = evaluator.batch
    rule = _Predictions(batch.n_envs, batch.arm.dt, seed)
    start = partial(_shorten, seed=seed) if name == SHORT_TIME else None
    run = evaluator.run(rule, start=start, predicts=True)
    kept = np.concatenate(rule.rows)
    found = np.concatenate(rule.predictions)
    row: Json = {"name": name, "n": batch.n_envs, "predictions": len(kept)}
    after = _recalibrated(found, run.outcome, kept, seed, evaluator.networks.between)
    for k, (what, outcome) in enumerate((("success", SUCCESS), ("contact", COLLISION))):
        happened = run.outcome[kept] == outcome
        row[what] = calibration(found[:, k], found[:, (2 + k, 4 + k)], happened, kept, seed)
        row[what]["recalibrated"] = {
            size: _errors(one[:, k], happened)
            | {"bins": _compared(one[:, k], one[:, (2 + k, 4 + k)], happened)}
            for size, one in after.items()
        }
    won = run.outcome[kept] == SUCCESS
    left_s = run.duration_s[kept] - np.concatenate(rule.times)
    return row | times_of(found[won, 6], left_s[won])


def _shorten(batch: PickBatch, seed: int) -> None:
    """Draw the time left of each episode from 0 to its limit."""
    shares = np.random.default_rng(seed).random(batch.n_envs)
    batch.shorten(np.arange(batch.n_envs), shares)


def calibration(
    probability: Vec,
    interval: Vec,
    happened: Flags,
    episode: Index,
    seed: int,
) -> Json:
    """Return measures of calibration of predicted probabilities.

    Args:
        probability: Predictions, shape (n,).
        interval: Lower and upper ends of their 95 % intervals, shape (n, 2).
        happened: Whether each event happened, shape (n,).
        episode: Number of the episode of each, shape (n,).
        seed: Seed of the chance level.
    """
    parts = _bins(probability)
    drawn = np.random.default_rng(seed).random((200, episode.max(initial=0) + 1))
    floor = [_ece(probability, one[episode] < probability, parts) for one in drawn]
    rate = happened.mean()
    return {
        "rate": float(rate),
        "mean": float(probability.mean()),
        **_errors(probability, happened),
        "ece_floor": float(np.mean(floor)),
        "brier_constant": float(rate * (1.0 - rate)),
        "auc": _auc(probability, happened),
        "bins": _compared(probability, interval, happened),
    }


def _compared(probability: Vec, interval: Vec, happened: Flags) -> list[Json]:
    """Return mean probability, rate and mean interval of each bin; see :func:`calibration`."""
    return [
        {
            "probability": float(probability[part].mean()),
            "rate": float(happened[part].mean()),
            "n": len(part),
            "low": float(interval[part, 0].mean()),
            "high": float(interval[part, 1].mean()),
        }
        for part in _bins(probability)
    ]


def times_of(predicted: Vec, passed: Vec) -> Json:
    """Return how expected times to success agree with those that passed; empty without any.

    ``time_ece_s`` is the mean absolute difference of their means over ten bins of equal counts,
    ``time_error_s`` that of the single times, and ``time_error_constant_s`` that of the single
    times and their mean.

    Args:
        predicted: Expected times to success [s], shape (n,).
        passed: Times that passed until success [s], shape (n,).
    """
    if not len(passed):
        return {}
    return {
        "time_to_success_s": float(passed.mean()),
        "expected_time_s": float(predicted.mean()),
        "time_ece_s": _ece(predicted, passed, _bins(predicted)),
        "time_error_s": float(np.abs(passed - predicted).mean()),
        "time_error_constant_s": float(np.abs(passed - passed.mean()).mean()),
    }


def _recalibrated(
    found: Vec, outcome: Index, episode: Index, seed: int, between: Floats
) -> dict[str, Vec]:
    """Return predictions after recalibrations, each half of the episodes by the other one.

    Args:
        found: Probabilities of success and contact, lower and upper ends of their intervals,
            in the first columns of n rows.
        outcome: Outcome of each episode, shape (n_episodes,).
        episode: Number of the episode of each prediction, shape (n,).
        seed: Seed of the halves, and of the prediction of each episode that is used.
        between: The checkpoint's offsets of log-odds between cells, shape (3, 2).

    Returns:
        Columns as in ``found``, shape (n, 6), after recalibration by FEW episodes and by all of
        a half.
    """
    predicted = with_timeout(found[:, 0], found[:, 1])
    label = np.where(outcome == SUCCESS, 0, np.where(outcome == COLLISION, 1, 2))[episode]
    rng = np.random.default_rng(seed)
    place = rng.permutation(len(outcome))[episode]
    halves = np.split(np.argsort(place), [np.count_nonzero(2 * place < len(outcome))])
    mixed = rng.permutation(len(episode))
    used = np.zeros(len(episode), dtype=np.bool_)
    used[mixed[np.unique(episode[mixed], return_index=True)[1]]] = True
    after = {name: np.empty((len(label), 6)) for name in ("few", "half")}
    for rows, others in (halves, halves[::-1]):
        known = others[used[others]]
        for name, fitted in (("few", known[:FEW]), ("half", known)):
            mapped = fit_map(predicted[fitted], label[fitted])
            left = narrowed(between, mapped(predicted[fitted]))
            after[name][rows] = corrected(found[rows, :6], mapped, between, left)
    return after


def corrected(found: Vec, mapped: OutcomeMap, between: Floats, left: Floats) -> Vec:
    """Return the predictions of a recalibrated policy from those that it made before.

    Args:
        found: Probabilities of success and contact, lower and upper ends of their intervals,
            shape (n, 6).
        mapped: The correction of the probabilities.
        between: Offsets of log-odds between cells before, shape (3, 2).
        left: What is left of them, shape (3, 2).
    """
    after = np.empty_like(found)
    after[:, :2] = mapped(with_timeout(found[:, 0], found[:, 1]))[:, :2]
    for end, at in enumerate((slice(2, 4), slice(4, 6))):
        whole = _log_odds(found[:, at]) - _log_odds(found[:, :2])
        spread = np.maximum(0.0, whole**2 - between[:2, end] ** 2)  # that of the ensemble
        beyond = np.sqrt(mapped.slope**2 * spread + left[:2, end] ** 2)
        odds = _log_odds(after[:, :2]) + np.copysign(beyond, end - 0.5)
        after[:, at] = scipy.special.expit(odds)
    return after


def _log_odds(probability: Vec) -> Vec:
    odds: Vec = scipy.special.logit(np.clip(probability, CERTAIN, 1.0 - CERTAIN))
    return odds


def _errors(probability: Vec, happened: Flags) -> dict[str, float]:
    """Return expected calibration error and Brier score."""
    brier = float(((probability - happened) ** 2).mean())
    return {"ece": _ece(probability, happened, _bins(probability)), "brier": brier}


def _bins(probability: Vec) -> list[Index]:
    """Return the predictions of each bin; fewer bins where there are fewer predictions."""
    return np.array_split(np.argsort(probability, kind="stable"), min(BINS, len(probability)))


def _ece(predicted: Vec, observed: Vec | Flags, parts: list[Index]) -> float:
    errors = [abs(predicted[one].mean() - observed[one].mean()) * len(one) for one in parts]
    return float(sum(errors) / len(predicted))


def _auc(probability: Vec, happened: Flags) -> float | None:
    """Return the area under the ROC curve; None where all outcomes are equal."""
    positive, negative = probability[happened], probability[~happened]
    if not len(positive) or not len(negative):
        return None
    higher = scipy.stats.mannwhitneyu(positive, negative).statistic
    return float(higher / (len(positive) * len(negative)))
