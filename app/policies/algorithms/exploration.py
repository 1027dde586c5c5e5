"""Exploration over batched cells: correlated noise on a ladder, and random options.

Row by row the noise grows from none (the first rows, which act as the policy does) to
``sigma_max``; it is an AR(1) process, so that motions stay smooth. In every second noisy row,
now and then an *option* takes over for 4 to 29 steps: hold still, go home, go to a posture
nearby, go to where another task would be. Options meet people in places the policy alone would
not seek.

Deviates: the thesis explores by parameter-space noise (section 5.3.4) and by an
Ornstein-Uhlenbeck process (table 4.2), which is here too, the same in every row.
"""

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.pick.batch import PickBatch
from app.sim.pick.kernels.observation import BASE_GAIN
from app.sim.reach.batch import ReachBatch

HOLD, HOME, NEARBY, ELSEWHERE = range(4)
OPTION_STEPS = (4, 30)
"""Shortest length of an option and the end of the range."""


class Explorer(Protocol):
    """Changes a policy's actions so that other ones are tried."""

    n_greedy: int
    """Rows without exploration, the first ones."""

    def apply(self, act: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the actions to take, shape (n_envs, n_act), given the policy's."""


class LadderNoise:
    """AR(1) noise whose strength grows with the row; keeps its state between steps.

    Args:
        n_envs: Rows.
        n_act: Numbers of an action.
        dt: Control period [s].
        sigma_max: Strength in the last row.
        time_s: Correlation time [s].
        greedy_share: Share of rows without noise; at least one row.
        rng: Random numbers.
    """

    def __init__(
        self,
        n_envs: int,
        n_act: int,
        dt: float,
        *,
        sigma_max: float,
        time_s: float,
        greedy_share: float,
        rng: np.random.Generator,
    ) -> None:
        self.n_greedy = max(1, round(greedy_share * n_envs))
        ladder = np.geomspace(0.1, 1.0, max(1, n_envs - self.n_greedy)) * sigma_max
        self._sigma = np.concatenate([np.zeros(self.n_greedy), ladder])[:n_envs, None]
        self._memory = math.exp(-dt / time_s)
        self._noise, self._rng = np.zeros((n_envs, n_act)), rng

    def apply(self, act: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the actions to take, shape (n_envs, n_act), given the policy's."""
        fresh = self._rng.standard_normal(self._noise.shape)
        spread = math.sqrt(1.0 - self._memory**2) * self._sigma
        self._noise = self._memory * self._noise + spread * fresh
        return np.clip(act + self._noise, -1.0, 1.0).astype(np.float32)


class OUNoise:
    """The noise of thesis table 4.2: ``x += theta (0 - x) + sigma N(0, 1)`` per period.

    Args:
        n_envs: Rows; all explore.
        n_act: Numbers of an action.
        theta: Pull toward 0 per period.
        sigma: Strength of the push per period.
        rng: Random numbers.
    """

    n_greedy = 0

    def __init__(
        self, n_envs: int, n_act: int, theta: float, sigma: float, rng: np.random.Generator
    ) -> None:
        self._theta, self._sigma, self._rng = theta, sigma, rng
        self._noise = np.zeros((n_envs, n_act))

    def apply(self, act: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the actions to take, shape (n_envs, n_act), given the policy's."""
        fresh = self._rng.standard_normal(self._noise.shape)
        self._noise += self._sigma * fresh - self._theta * self._noise
        return np.clip(act + self._noise, -1.0, 1.0).astype(np.float32)


class OptionNoise:
    """Ladder noise, and random options in every second noisy row.

    Args:
        noise: The noise.
        batch: The cells that are stepped.
        postures: Where options may lead besides home [rad], shape (n, 6).
        rate: Chance per period that an option starts.
        rng: Random numbers.
    """

    def __init__(
        self,
        noise: LadderNoise,
        batch: PickBatch | ReachBatch,
        postures: Vec,
        rate: float,
        rng: np.random.Generator,
    ) -> None:
        self._noise, self._batch, self._rng = noise, batch, rng
        self._postures, self._rate = postures, rate
        self.n_greedy = noise.n_greedy
        rows = np.arange(batch.n_envs)
        self._may_option = (rows >= self.n_greedy) & (rows % 2 == 0)
        self._left = np.zeros(batch.n_envs, dtype=np.int64)
        self._goal = np.zeros((batch.n_envs, batch.n_act))

    def apply(self, act: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the actions to take, shape (n_envs, n_act), given the policy's."""
        noisy = self._noise.apply(act)
        self._start_options()
        active = self._left > 0
        if active.any():
            noisy[active] = self._toward_goals()[active]
            self._left[active] -= 1
        return noisy

    def _start_options(self) -> None:
        draw = self._rng.random(len(self._left)) < self._rate
        starting = np.flatnonzero(draw & self._may_option & (self._left == 0))
        for row in starting:
            self._goal[row] = self._draw_goal(int(row))
            self._left[row] = self._rng.integers(*OPTION_STEPS)

    def _draw_goal(self, row: int) -> Vec:
        n = self._batch.n_act
        q = self._batch.state.q[row, :n]
        kind = self._rng.integers(4)
        if kind == HOLD:
            return q.copy()
        if kind == HOME:
            return self._batch.arm.home[:n]
        if kind == NEARBY:
            return q + self._rng.normal(0.0, 0.3, n)
        return self._postures[self._rng.integers(len(self._postures)), :n]

    def _toward_goals(self) -> Vec:
        away = self._goal - self._batch.state.q[:, : self._batch.n_act]
        widest = np.maximum(np.abs(away).max(axis=1, keepdims=True), 1e-9)
        pace = np.minimum(1.0, BASE_GAIN * widest / self._batch.arm.limits.qd_max[0])
        return np.asarray(away / widest * pace)
