"""Exploration over batched cells: correlated noise on a ladder, and random options.

Row by row the noise grows from none (the first rows, which act as the policy does) to
``sigma_max``; it is an AR(1) process, so that motions stay smooth. In every second noisy row,
now and then an *option* takes over for 4 to 29 steps: hold still, go home, go to a posture
nearby, go to another station. Options meet people in places the policy alone would not seek.

Deviates: the thesis explores by parameter-space noise (section 5.3.4) and by an
Ornstein-Uhlenbeck process (table 4.2), which is here too, the same in every row.
"""

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.policies.pick_preset import PickPreset
from app.sim.kernels.arm import CONTROLLED
from app.sim.kernels.features import BASE_GAIN
from app.sim.pick import PickBatch

HOLD, HOME, NEARBY, STATION = range(4)
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
    """Ladder noise and random options of the pick scenario.

    Args:
        preset: Gives noise and option rates.
        batch: The cells that are stepped.
        rng: Random numbers.
    """

    def __init__(self, preset: PickPreset, batch: PickBatch, rng: np.random.Generator) -> None:
        self._batch, self._rng = batch, rng
        n = batch.n_envs
        self._noise = LadderNoise(
            n,
            CONTROLLED,
            batch.arm.dt,
            sigma_max=preset.sigma_max,
            time_s=preset.noise_time_s,
            greedy_share=preset.greedy_share,
            rng=rng,
        )
        self.n_greedy = self._noise.n_greedy
        rows = np.arange(n)
        self._may_option = (rows >= self.n_greedy) & (rows % 2 == 0)
        self._rate = preset.option_rate
        self._left = np.zeros(n, dtype=np.int64)
        self._goal = np.zeros((n, CONTROLLED))

    def apply(self, act: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the actions to take, shape (n_envs, 5), given the policy's."""
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

    def _draw_goal(self, row: int) -> NDArray[np.float64]:
        q = self._batch.state.q[row, :CONTROLLED]
        kind = self._rng.integers(4)
        if kind == HOLD:
            return q.copy()
        if kind == HOME:
            return self._batch.arm.home[:CONTROLLED]
        if kind == NEARBY:
            return q + self._rng.normal(0.0, 0.3, CONTROLLED)
        stations = self._batch.world.station_q
        return np.asarray(stations[self._rng.integers(len(stations)), :CONTROLLED])

    def _toward_goals(self) -> NDArray[np.float64]:
        away = self._goal - self._batch.state.q[:, :CONTROLLED]
        widest = np.maximum(np.abs(away).max(axis=1, keepdims=True), 1e-9)
        pace = np.minimum(1.0, BASE_GAIN * widest / self._batch.arm.qd_max[0])
        return np.asarray(away / widest * pace)
