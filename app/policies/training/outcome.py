"""Fit of the outcome probabilities of a pick to episodes of the finished policy.

The policy acts greedily in the environments of its training. At random steps the observation is
kept; when the episode ends it is labelled with the outcome and the time that it still took.
Half of the episodes have less time than those of the training, down to almost none. Each member
of the ensemble learns from a bootstrap sample of the episodes: probabilities by cross-entropy,
the time to success by its squared error, whose minimum is the expected time.

People of one cell are of one kind, those of the training a mixture. How much rates differ
between cells where the observation is the same is fitted to episodes in cells drawn from that
mixture: the log-odds of an outcome have an offset in each cell.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import scipy  # loads its subpackages where they are first used
import torch
from numpy.typing import NDArray
from torch import nn
from torch.nn import functional

from app.policies.networks.actor_critic import Critics
from app.policies.networks.outcome import CERTAIN, MEMBERS, OUTCOMES, OutcomeHead
from app.sim.pick.batch import PickBatch
from app.sim.scenario.kernels.episode import COLLISION, SUCCESS, TIMEOUT, UNFEASIBLE

LABELS = {SUCCESS: 0, COLLISION: 1, TIMEOUT: 2, UNFEASIBLE: 2}
"""Place among the probabilities of each outcome of an episode; unfeasible ends count as
timeouts."""
KEEP = 0.05
"""Share of the steps that are kept; first steps are always kept."""
SHORTENED = 0.5
"""Share of the episodes whose time left at the start is drawn from 0 to their limit."""
EPOCHS, BATCH, RATE, DECAY = 12, 1024, 1e-3, 0.1
"""Passes over the data, size of a minibatch, learning rate and weight decay."""
LEAST_BATCHES = 16
"""Fewest minibatches of a pass; they are smaller where there is little data."""
LEAST_SPREAD = 1e-3
"""Spread that errors are compared with where the members agree more closely: one factor widens
all intervals, so that small errors of nearly certain outcomes would make the others useless."""
OFFSET_STD, MOST_OFFSET = 2.0, 30.0
"""Standard deviation of the prior of an offset, which keeps it small where an outcome never
happens, and a bound that it therefore does not reach."""
TIME_WEIGHT = 0.05
"""Weight of the squared error of the time [1/s^2], relative to the cross-entropy."""


class FitStopped(Exception):
    """A stop was asked for before the outcome probabilities were fitted."""


class OutcomeData(NamedTuple):
    """Labelled observations."""

    obs: NDArray[np.float32]
    """Observations, shape (n, n_obs)."""
    value: NDArray[np.float32]
    """The critic's values, shape (n,)."""
    label: NDArray[np.int64]
    """Outcome of the episode, shape (n,)."""
    time_s: NDArray[np.float32]
    """Time from the observation to the end [s], shape (n,)."""
    episode: NDArray[np.int64]
    """Number of the episode, shape (n,)."""


def _continue_unless(should_stop: Callable[[], bool]) -> None:
    """Raise FitStopped where a stop is asked for."""
    if should_stop():
        raise FitStopped


def collect(
    batch: PickBatch,
    actor: nn.Module,
    critic: Critics,
    n_steps: int,
    seed: int,
    should_stop: Callable[[], bool],
    shortened: float = SHORTENED,
) -> OutcomeData:
    """Return labelled observations of episodes under a greedy policy.

    Every episode that begins within the steps is simulated to its end: without those that are
    still running, long episodes would be missing more often than short ones.

    Args:
        n_steps: Steps of all environments in which episodes begin.
        seed: Seed of the steps that are kept.
        should_stop: Called before every step.
        shortened: Share of the episodes whose time left at the start is drawn.

    Raises:
        FitStopped: ``should_stop`` asked for it.
    """
    rng, n = np.random.default_rng(seed), batch.n_envs
    batch.reset()
    kept: list[list[tuple[NDArray[np.float32], float, float]]] = [[] for _ in range(n)]
    rows: list[tuple[NDArray[np.float32], float, int, float, int]] = []
    episode, dt = np.arange(n), batch.arm.dt
    steps, collected = 0, np.full(n, n_steps > 0)  # whether the episode began in time
    while collected.any():
        _continue_unless(should_stop)
        first = batch.state.elapsed < 0.5 * dt
        short = np.flatnonzero(first & (rng.random(n) < shortened))
        batch.shorten(short, rng.random(len(short)))
        with torch.inference_mode():
            obs = torch.as_tensor(batch.obs)
            act = actor(obs)
            value = critic.least(obs, act).numpy()
        for e in np.flatnonzero(collected & (first | (rng.random(n) < KEEP))).tolist():
            sample = batch.obs[e].copy(), float(value[e]), float(batch.state.elapsed[e])
            kept[e].append(sample)
        elapsed = batch.state.elapsed + dt
        ended = batch.step(act.numpy()).ended
        for e in np.flatnonzero(collected & (ended > 0)).tolist():
            label = LABELS[int(ended[e])]
            rows += [(o, v, label, elapsed[e] - t, int(episode[e])) for o, v, t in kept[e]]
            kept[e], episode[e] = [], episode[e] + n
        steps += 1
        collected &= (ended == 0) | (steps < n_steps)
    seen, values, labels, times, episodes = zip(*rows, strict=True) if rows else ((),) * 5
    return OutcomeData(
        np.array(seen, dtype=np.float32).reshape(-1, batch.obs_size),
        np.array(values, dtype=np.float32),
        np.array(labels, dtype=np.int64),
        np.array(times, dtype=np.float32),
        np.array(episodes, dtype=np.int64),
    )


def fit(data: OutcomeData, seed: int, should_stop: Callable[[], bool]) -> OutcomeHead:
    """Return the ensemble fitted to labelled observations.

    A tenth of the episodes is kept apart: on them the spread is widened until the rate of
    success lies inside the interval in nine of ten bins (in bins of nearly certain outcomes,
    inside LEAST_SPREAD times the same factor).

    Args:
        data: Labelled observations.
        seed: Seed of weights, bootstrap and order.
        should_stop: Called before every pass over the data.

    Raises:
        FitStopped: ``should_stop`` asked for it.
    """
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    names = np.unique(data.episode)
    apart = np.isin(data.episode, rng.choice(names, len(names) // 10, replace=False))
    head = OutcomeHead(data.obs.shape[1])
    both = torch.as_tensor(np.column_stack([data.obs, data.value]))
    head.mean.copy_(both.mean(dim=0))
    head.scale.copy_(both.std(dim=0) + 1e-3)
    rest = names[~np.isin(names, data.episode[apart])]
    for member in range(MEMBERS):
        drawn = rng.choice(rest, len(rest))
        times = np.bincount(np.searchsorted(names, drawn), minlength=len(names))
        weight = times[np.searchsorted(names, data.episode)]
        _fit_member(head, member, data, weight, rng, should_stop)
    _widen(head, data, apart)
    return head.eval()


def _fit_member(
    head: OutcomeHead,
    member: int,
    data: OutcomeData,
    weight: NDArray[np.int64],
    rng: np.random.Generator,
    should_stop: Callable[[], bool],
) -> None:
    """Fit one member to the observations of a bootstrap sample."""
    network = head.members[member]
    optimizer = torch.optim.AdamW(network.parameters(), lr=RATE, weight_decay=DECAY)
    rows = np.repeat(np.arange(len(weight)), weight)
    inputs = head.standardised(torch.as_tensor(data.obs), torch.as_tensor(data.value))
    label, time_s = torch.as_tensor(data.label), torch.as_tensor(data.time_s)
    if (label == 0).any():
        with torch.no_grad():
            network[-1].bias[-1] = time_s[label == 0].mean()  # type: ignore[index]
    size = max(1, min(BATCH, len(rows) // LEAST_BATCHES))
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimizer, RATE, total_steps=EPOCHS * (len(rows) // size) + 1
    )
    for _ in range(EPOCHS):
        _continue_unless(should_stop)
        rng.shuffle(rows)
        for first in range(0, len(rows) - size + 1, size):
            one = torch.as_tensor(rows[first : first + size])
            out = network(inputs[one])
            loss = functional.cross_entropy(out[:, : len(OUTCOMES)], label[one])
            won = label[one] == 0
            if won.any():
                error = functional.mse_loss(out[won, -1], time_s[one][won])
                loss = loss + TIME_WEIGHT * error
            optimizer.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimizer.step()
            schedule.step()


def _widen(head: OutcomeHead, data: OutcomeData, apart: NDArray[np.bool_]) -> None:
    """Widen the spread until the calibration error on other episodes lies inside it."""
    found = head.predict(torch.as_tensor(data.obs[apart]), torch.as_tensor(data.value[apart]))
    probability, spread = found.probability[:, 0], 0.5 * (found.high - found.low)[:, 0]
    won = data.label[apart] == 0
    order = np.argsort(probability)
    ratios = [
        abs(won[part].mean() - probability[part].mean())
        / max(spread[part].mean(), LEAST_SPREAD)
        for part in np.array_split(order, 10)
        if len(part)
    ]
    head.widen.fill_(max(1.0, float(np.quantile(ratios, 0.9))))


def offsets_between(head: OutcomeHead, cells: Sequence[OutcomeData]) -> NDArray[np.float32]:
    """Return the least and the greatest offset of log-odds in a number of cells, shape (3, 2).

    In each cell, the rate of an outcome is that of predictions whose log-odds have an offset.
    In a further cell drawn alike it lies between the least and the greatest of n cells with
    probability ``(n - 1) / (n + 1)``, whatever its distribution (order statistics).

    Args:
        head: Predictions.
        cells: Labelled observations in each cell; every episode counts once.
    """
    found = [
        head.predict(torch.as_tensor(one.obs), torch.as_tensor(one.value)) for one in cells
    ]
    offsets = [
        [_offset(one.probability[:, k], data, k) for k in range(len(OUTCOMES))]
        for one, data in zip(found, cells, strict=True)
    ]
    ends = np.min(offsets, axis=0).clip(max=0.0), np.max(offsets, axis=0).clip(min=0.0)
    return np.column_stack(ends).astype(np.float32)


def _offset(probability: NDArray[np.float32], data: OutcomeData, outcome: int) -> float:
    """Return the most probable offset of the log-odds of an outcome in one cell.

    Args:
        probability: Predictions of the outcome, shape (n,).
        data: What they were made for.
        outcome: Index of the outcome.
    """
    odds = scipy.special.logit(np.clip(probability.astype(np.float64), CERTAIN, 1.0 - CERTAIN))
    happened, weight = data.label == outcome, 1.0 / np.bincount(data.episode)[data.episode]

    def slope(offset: float) -> float:
        missing = weight @ (happened - scipy.special.expit(odds + offset))
        return float(missing - offset / OFFSET_STD**2)

    return float(scipy.optimize.brentq(slope, -MOST_OFFSET, MOST_OFFSET))
