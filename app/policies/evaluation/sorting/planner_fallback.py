"""Progress monitor (``app/sim/sorting/progress_monitor.py``) of many sorting tasks at once.

A test compares every result on random episodes with that of the monitor of one task.
In evaluations a pick fails by the failure map and no other object moves, so that an unchanged
state is a failed pick; interference comes at known times.
"""

import numpy as np
from numpy.typing import NDArray

from app.policies.evaluation.statistics import Flags, Index
from app.sim.core.arrays import Vec
from app.sim.sorting.kernels.task import SortingEnvs
from app.sim.sorting.progress_monitor import ATTEMPT_FACTOR, MAX_SEEN

Keys = NDArray[np.uint64]


def state_keys(envs: SortingEnvs, which: Index) -> Keys:
    """Return a number for each state, equal for equal clutter and towers, shape (n,).

    A sum of codes times fixed odd 64-bit numbers, modulo 2^64: two states of a task share a
    key with a probability of about 1e-18.
    """
    n, k, c = len(which), envs.clutter.shape[1], envs.towers.shape[1]
    draw = np.random.default_rng(0)
    odd = draw.integers(0, 2**63, k * (1 + c), dtype=np.uint64) * np.uint64(2) + np.uint64(1)
    codes = np.concatenate([envs.clutter[which], envs.towers[which].reshape(n, k * c)], axis=1)
    return np.asarray((codes.astype(np.uint64) * odd).sum(axis=1, dtype=np.uint64))


class BatchProgressMonitor:
    """Progress monitors of ``n`` tasks."""

    def __init__(self, n: int) -> None:
        self.planner_fallback: Flags = np.zeros(n, dtype=np.bool_)
        """Tasks of the exact planner, shape (n,)."""
        self._seen: Keys = np.zeros((n, MAX_SEEN), dtype=np.uint64)
        self._n_seen: Index = np.zeros(n, dtype=np.int64)
        self._attempts: Index = np.zeros(n, dtype=np.int64)
        self._budget = np.zeros(n)

    def begin(self, which: Index, keys: Keys, expected_attempts: Vec) -> None:
        """Restart monitors at a start or after an interference.

        Args:
            which: Tasks, shape (m,).
            keys: Keys of their states, shape (m,).
            expected_attempts: Expected attempts of the exact planner from there, shape (m,).
        """
        self.planner_fallback[which] = False
        self._seen[which, 0], self._n_seen[which] = keys, 1
        self._attempts[which], self._budget[which] = 0, ATTEMPT_FACTOR * expected_attempts

    def observe_transitions(
        self, which: Index, keys: Keys, moved: Flags
    ) -> tuple[Index, Flags]:
        """Update monitors with the results of attempts.

        Args:
            which: Tasks, shape (m,).
            keys: Keys of their states after the attempt, shape (m,).
            moved: Whether the attempt moved an object; otherwise the pick failed, shape (m,).

        Returns:
            Tasks with a new fallback, and whether a repeated state is the reason.
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
