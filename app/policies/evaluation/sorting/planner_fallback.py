"""The hand-over rule of ``app/sim/sorting/progress_monitor.py`` for many sorting tasks at once.

A test walks random episodes and compares every verdict with that of the rule for one task. In
evaluations picks fail as the failure map says and nobody moves another object than was meant,
so a state that stays as it was is a failed pick; people interfere at known times.
"""

import numpy as np
from numpy.typing import NDArray

from app.sim.sorting.kernels.task import SortingRows
from app.sim.sorting.progress_monitor import MAX_SEEN, PATIENCE

Index = NDArray[np.int64]
Flags = NDArray[np.bool_]
Keys = NDArray[np.uint64]


def state_keys(rows: SortingRows, which: Index) -> Keys:
    """Return a number for each state, equal for equal clutter and towers, shape (n,).

    A sum of codes times fixed odd 64-bit numbers, modulo 2^64: two states of a task share a
    key with a chance of about one in 10^18.
    """
    n, k, c = len(which), rows.clutter.shape[1], rows.towers.shape[1]
    draw = np.random.default_rng(0)
    odd = draw.integers(0, 2**63, k * (1 + c), dtype=np.uint64) * np.uint64(2) + np.uint64(1)
    codes = np.concatenate([rows.clutter[which], rows.towers[which].reshape(n, k * c)], axis=1)
    return np.asarray((codes.astype(np.uint64) * odd).sum(axis=1, dtype=np.uint64))


class HandOver:
    """Who of many tasks has to be handed over to the exact planner.

    Args:
        n: Number of tasks.
    """

    def __init__(self, n: int) -> None:
        self.planner_fallback: Flags = np.zeros(n, dtype=np.bool_)
        """Where the exact planner decides, shape (n,)."""
        self._seen: Keys = np.zeros((n, MAX_SEEN), dtype=np.uint64)
        self._n_seen: Index = np.zeros(n, dtype=np.int64)
        self._attempts: Index = np.zeros(n, dtype=np.int64)
        self._budget = np.zeros(n)

    def begin(self, which: Index, keys: Keys, expected_attempts: NDArray[np.float64]) -> None:
        """Begin anew, at a start or after somebody interfered.

        Args:
            which: Tasks.
            keys: Of their states, shape (len(which),).
            expected_attempts: Attempts the exact planner expects from there, same shape.
        """
        self.planner_fallback[which] = False
        self._seen[which, 0], self._n_seen[which] = keys, 1
        self._attempts[which], self._budget[which] = 0, PATIENCE * expected_attempts

    def look(self, which: Index, keys: Keys, moved: Flags) -> tuple[Index, Flags]:
        """Take in what an attempt gave.

        Args:
            which: Tasks.
            keys: Of their states after the attempt, shape (len(which),).
            moved: Whether the attempt moved an object; otherwise the pick failed, same shape.

        Returns:
            The tasks that are handed over now, and whether a repeated state is why.
        """
        self._attempts[which] += 1
        mine = ~self.planner_fallback[which]
        which, keys, moved = which[mine], keys[mine], moved[mine]
        width = int(self._n_seen[which].max(initial=0))
        known = np.arange(width) < self._n_seen[which, None]
        repeated = moved & (known & (self._seen[which, :width] == keys[:, None])).any(axis=1)
        spent = self._attempts[which] >= self._budget[which]
        over = repeated | spent | (self._n_seen[which] >= MAX_SEEN)
        self.planner_fallback[which[over]] = True
        new = which[moved & ~over]
        self._seen[new, self._n_seen[new]] = keys[moved & ~over]
        self._n_seen[new] += 1
        return which[over], repeated[over]
