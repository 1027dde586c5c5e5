"""Exploration over batched cells: correlated noise on a ladder, and random options.

Row by row the noise grows from none (the first rows, whose episodes make the learning curve) to
``sigma_max``; it is an AR(1) process, so that motions stay smooth. In every second noisy row,
now and then an *option* takes over for 4 to 29 steps: hold still, go home, go to a posture
nearby, go to another station. Options meet people in places the policy alone would not seek.

Deviates: the thesis explores by parameter-space noise (section 5.3.4).
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.policies.pick_preset import PickPreset
from app.sim.kernels.arm import CONTROLLED
from app.sim.kernels.features import BASE_GAIN
from app.sim.pick import PickBatch

HOLD, HOME, NEARBY, STATION = range(4)
OPTION_STEPS = (4, 30)
"""Shortest length of an option and the end of the range."""


class Exploration:
    """Changes the policy's actions row by row; keeps its own state between steps.

    Args:
        preset: Gives noise and option rates.
        batch: The cells that are stepped.
        rng: Random numbers.
    """

    def __init__(self, preset: PickPreset, batch: PickBatch, rng: np.random.Generator) -> None:
        self._batch, self._rng = batch, rng
        n = batch.n_envs
        self.n_greedy = max(1, round(preset.greedy_share * n))
        ladder = np.geomspace(0.1, 1.0, max(1, n - self.n_greedy)) * preset.sigma_max
        self._sigma = np.concatenate([np.zeros(self.n_greedy), ladder])[:n, None]
        self._memory = math.exp(-batch.arm.dt / preset.noise_time_s)
        self._noise = np.zeros((n, CONTROLLED))
        rows = np.arange(n)
        self._may_option = (rows >= self.n_greedy) & (rows % 2 == 0)
        self._rate = preset.option_rate
        self._left = np.zeros(n, dtype=np.int64)
        self._goal = np.zeros((n, CONTROLLED))

    def apply(self, act: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return the actions to take, shape (n_envs, 5), given the policy's."""
        fresh = self._rng.standard_normal(self._noise.shape)
        spread = math.sqrt(1.0 - self._memory**2) * self._sigma
        self._noise = self._memory * self._noise + spread * fresh
        noisy = np.clip(act + self._noise, -1.0, 1.0)
        self._start_options()
        active = self._left > 0
        if active.any():
            noisy[active] = self._toward_goals()[active]
            self._left[active] -= 1
        return noisy.astype(np.float32)

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
