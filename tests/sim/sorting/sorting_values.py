"""Every state of a small sorting task, and its best values by value iteration.

Transitions and rewards are asked of the compiled batch itself: every state is an
environment, every action is tried in all of them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.sim.sorting.batch import SortingBatch, SortingSettings
from app.sim.sorting.kernels.reward import SortingWeights
from app.sim.sorting.kernels.task import RUNNING, SUCCESS
from app.sim.sorting.state import SortingShape, SortingState

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TIE = 1e-7
"""Values nearer than this are equal."""
STEP = 4096
"""Environments of the batch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A task as a table; ``n`` states, ``A`` actions."""

    codes: NDArray[np.int8]
    """States: clutter, then towers, shape (n, K + C K)."""
    after: Ints
    """State after an action that succeeds, shape (n, A)."""
    rew: Floats
    """Its reward, shape (n, A)."""
    failed_rew: Floats
    """Reward of a pick that fails, shape (n, A)."""
    fail: Floats
    """Chance that it fails, shape (n, A)."""
    solved: NDArray[np.bool_]
    """Which states meet the goal, shape (n,)."""


class _Table:
    """A batch whose environments are put into any states."""

    def __init__(
        self, task: SortingState, shape: SortingShape, weights: SortingWeights
    ) -> None:
        settings = SortingSettings(weights=weights, horizon_factor=1e6)
        self.batch = SortingBatch(shape, np.zeros(shape.n_slots), STEP, 0, settings)
        self.batch.reset()
        self._k = shape.n_slots
        self._levels = (shape.n_colours, shape.n_slots)
        envs = self.batch.envs
        envs.goal[:], envs.goal_heights[:] = task.goal, (task.goal != 0).sum(axis=1)

    def tried(self, codes: NDArray[np.int8], action: int) -> tuple[NDArray[np.int8], Floats]:
        """Return states and rewards after an action in each of the states."""
        envs, after = self.batch.envs, np.empty_like(codes)
        rew = np.empty(len(codes))
        for begin in range(0, len(codes), STEP):
            part = slice(begin, min(begin + STEP, len(codes)))
            n = part.stop - begin
            envs.clutter[:n] = codes[part, : self._k]
            envs.towers[:n] = codes[part, self._k :].reshape(n, *self._levels)
            envs.heights[:n] = (envs.towers[:n] != 0).sum(axis=2)
            envs.outcome[:], envs.outcome[:n] = SUCCESS, RUNNING
            result = self.batch.step(np.full(STEP, action), auto_reset=False)
            after[part] = np.hstack([envs.clutter[:n], envs.towers[:n].reshape(n, -1)])
            rew[part] = result.rew[:n]
        return after, rew


def model_of(task: SortingState, shape: SortingShape, weights: SortingWeights) -> Model:
    """Return all states that moves lead to from a task, as a table."""
    table = _Table(task, shape, weights)
    codes = np.concatenate([task.clutter, task.towers.ravel()])[None]
    seen: dict[bytes, int] = {codes[0].tobytes(): 0}
    new = codes
    while len(new):
        found = []
        for action in range(shape.n_actions):
            for row in table.tried(new, action)[0]:
                if row.tobytes() not in seen:
                    seen[row.tobytes()] = len(seen)
                    found.append(row)
        new = np.array(found, dtype=np.int8).reshape(-1, codes.shape[1])
        codes = np.concatenate([codes, new])
    after = np.empty((len(codes), shape.n_actions), dtype=np.int64)
    rew, fail = np.empty(after.shape), np.zeros(after.shape)
    for action in range(shape.n_actions):
        reached, rew[:, action] = table.tried(codes, action)
        after[:, action] = [seen[row.tobytes()] for row in reached]
        if action < shape.n_slots * shape.n_colours:
            cell = action // shape.n_colours
            fail[:, action] = np.where(codes[:, cell] != 0, task.fail[cell], 0.0)
    # The last action puts an object back where it was, or picks none: it costs as much.
    distance = rew[:, -1] + weights.move + weights.stuck
    assert weights.empty == weights.stuck
    failed = np.broadcast_to(distance[:, None] - weights.move - weights.fail, rew.shape)
    solved = (codes[:, shape.n_slots :] == task.goal.ravel()).all(axis=1)
    return Model(codes=codes, after=after, rew=rew, failed_rew=failed, fail=fail, solved=solved)


def values(model: Model, gamma: float) -> Floats:
    """Return the best values of all actions by value iteration, shape (n, A)."""
    value = np.where(model.solved, 0.0, -20.0)
    while True:
        good = model.rew + gamma * value[model.after]
        bad = model.failed_rew + gamma * value[:, None]
        q = (1.0 - model.fail) * good + model.fail * bad
        best = np.where(model.solved, 0.0, q.max(axis=1))
        if np.abs(best - value).max() < 1e-11:
            return q
        value = best


def moves_to_go(model: Model) -> Ints:
    """Return the fewest moves to the goal from every state, shape (n,)."""
    far = len(model.solved)
    moves = np.where(model.solved, 0, far)
    while True:
        best = np.where(model.solved, 0, 1 + moves[model.after].min(axis=1))
        if (best == moves).all():
            return moves
        moves = np.minimum(best, far)


def attempts_to_go(model: Model, moves: Ints | None) -> Floats:
    """Return the fewest expected attempts, of plans with the fewest moves or (None) of all.

    A failed pick changes nothing, so a pick costs ``1 / (1 - p)`` attempts.
    """
    cost = 1.0 / (1.0 - model.fail)
    if moves is not None:
        cost = np.where(moves[model.after] == moves[:, None] - 1, cost, np.inf)
    attempts = np.where(model.solved, 0.0, 1e6)
    while True:
        best = np.where(model.solved, 0.0, (cost + attempts[model.after]).min(axis=1))
        if np.abs(best - attempts).max() < 1e-12:
            return attempts
        attempts = best


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """How the best policy of the reward plays, over all unsolved states of a task."""

    n: int
    """States looked at."""
    fewest: int
    """States in which every best action begins a plan with the fewest moves."""
    safest_duplicate: int
    """States in which no best action picks an object whose duplicate lies safer."""
    least_attempts: int
    """States from which it needs the fewest expected attempts of all plans."""
    as_planned: int
    """States from which it needs the fewest among plans with the fewest moves."""
    worst_attempts: float
    """Most expected attempts of it over the fewest of all plans."""


def judged(model: Model, shape: SortingShape, fail: Floats, gamma: float) -> Verdict:
    """Judge the best policy of a reward on a task."""
    q = values(model, gamma)
    best = q >= q.max(axis=1, keepdims=True) - TIE
    moves = moves_to_go(model)
    off = best & (moves[model.after] != moves[:, None] - 1)
    spent = _attempts_of(model, q.argmax(axis=1))
    least, planned = attempts_to_go(model, None), attempts_to_go(model, moves)
    risky = best & _has_safer_duplicate(model, shape, fail)
    there = ~model.solved
    return Verdict(
        n=int(there.sum()),
        fewest=int((~off.any(axis=1))[there].sum()),
        safest_duplicate=int((~risky.any(axis=1))[there].sum()),
        least_attempts=int((spent <= least + 1e-6)[there].sum()),
        as_planned=int((spent <= planned + 1e-6)[there].sum()),
        worst_attempts=float((spent[there] / least[there]).max()),
    )


def _attempts_of(model: Model, policy: Ints) -> Floats:
    """Return the expected attempts of a policy from every state, shape (n,)."""
    rows = np.arange(len(policy))
    cost, after = 1.0 / (1.0 - model.fail[rows, policy]), model.after[rows, policy]
    attempts = np.zeros(len(policy))
    for _ in range(200):
        attempts = np.where(model.solved, 0.0, cost + attempts[after])
    return attempts


def _has_safer_duplicate(model: Model, shape: SortingShape, fail: Floats) -> NDArray[np.bool_]:
    """Return which actions pick an object with a duplicate in a safer slot, shape (n, A)."""
    risky = np.zeros(model.after.shape, dtype=np.bool_)
    clutter = model.codes[:, : shape.n_slots]
    for action in range(shape.n_slots * shape.n_colours):
        cell = action // shape.n_colours
        duplicates = (clutter == clutter[:, [cell]]) & (clutter != 0)
        risky[:, action] = (duplicates & (fail < fail[cell])).any(axis=1)
    return risky
