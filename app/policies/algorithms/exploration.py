"""Exploration in parallel environments: noise with a scale per environment, and options.

The scale of the AR(1) noise grows from 0 in the first, greedy environments to ``sigma_max`` in
the last; environments with different numbers of people take turns in this order. In half of the
noisy environments a random *option* takes over from time to time, for 4 to 29 control periods:
hold still, move home, move to a configuration nearby or to that of another task; in picks, half
of the time, move straight to the target. Options reach states near people that the policy alone
would not visit, and leave states in which it hesitates.

Deviates: the thesis explores by an Ornstein-Uhlenbeck process (table 4.2), which is here too,
and by parameter-space noise (section 5.3.4; ``parameter_noise.py``).
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from app.policies.configs.reach import ReachExploration
from app.policies.configs.td3 import NoiseExploration
from app.sim.core.arrays import Vec
from app.sim.pick.batch import PickBatch
from app.sim.pick.kernels.base_motion import base_motions
from app.state_dict import Stateful

HOLD, HOME, NEARBY, ELSEWHERE = range(4)
STRAIGHT_ON = 0.5
"""Share of the options that move straight to the target, as the base motion does."""
OPTION_STEPS = (4, 30)
"""Shortest duration of an option and end of the range [control periods]."""


class Exploration(Stateful, ABC):
    """Perturbs the actions of a policy."""

    n_greedy: int
    """Environments without exploration; the first ones where no order is given."""

    @abstractmethod
    def apply(self, act: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return perturbed actions, shape (n_envs, n_act)."""


class PerEnvAR1Noise(Exploration):
    """AR(1) noise with a scale per environment.

    Args:
        shape: Environments and numbers of an action, (n_envs, n_act).
        dt: Control period [s].
        config: Largest scale, correlation time and greedy share.
        order: Environments in the order of growing scales, shape (n_envs,); by default that of
            their numbers.
    """

    STATE = ("_noise", "_rng")

    def __init__(
        self,
        shape: tuple[int, int],
        dt: float,
        config: NoiseExploration,
        rng: np.random.Generator,
        order: NDArray[np.int64] | None = None,
    ) -> None:
        n_envs = shape[0]
        self.n_greedy = config.n_greedy(n_envs)
        scales = np.geomspace(0.1, 1.0, n_envs - self.n_greedy) * config.sigma_max
        scales[-1:] = config.sigma_max  # also where only one environment has noise
        if order is None:
            order = np.arange(n_envs)
        self._sigma = np.zeros((n_envs, 1))
        self._sigma[order[self.n_greedy :], 0] = scales
        self._memory = math.exp(-dt / config.noise_time_s)
        self._noise, self._rng = np.zeros(shape), rng

    def apply(self, act: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return perturbed actions, shape (n_envs, n_act)."""
        fresh = self._rng.standard_normal(self._noise.shape)
        spread = math.sqrt(1.0 - self._memory**2) * self._sigma
        self._noise = self._memory * self._noise + spread * fresh
        return np.clip(act + self._noise, -1.0, 1.0).astype(np.float32)


class OUNoise(Exploration):
    """Ornstein-Uhlenbeck noise: ``x += -theta x dt + sigma sqrt(dt) N(0, 1)`` per period.

    The process starts at 0 with every episode. The time step ``dt`` is one of the process, not
    of the robot; Stable-Baselines 2, the library of the thesis, has 0.01.

    Args:
        shape: Environments and numbers of an action, (n_envs, n_act).
        config: Rate ``ou_theta``, scale ``ou_sigma`` and time step ``ou_dt``.
        started: Returns which environments are at the start of an episode, shape (n_envs,).
    """

    STATE = ("_noise", "_rng")
    n_greedy = 0

    def __init__(
        self,
        shape: tuple[int, int],
        config: ReachExploration,
        started: Callable[[], NDArray[np.bool_]],
        rng: np.random.Generator,
    ) -> None:
        self._pull = config.ou_theta * config.ou_dt
        self._push = config.ou_sigma * math.sqrt(config.ou_dt)
        self._started, self._rng = started, rng
        self._noise = np.zeros(shape)

    def apply(self, act: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return perturbed actions, shape (n_envs, n_act)."""
        self._noise[self._started()] = 0.0
        fresh = self._rng.standard_normal(self._noise.shape)
        self._noise += self._push * fresh - self._pull * self._noise
        return np.clip(act + self._noise, -1.0, 1.0).astype(np.float32)


class OptionExploration(Exploration):
    """AR(1) noise, and temporally extended options in every second noisy environment.

    Deviates: an option does not end with its episode. It goes on in the next episode of the
    environment until its duration is over, toward the goal that it had. The shipped pick
    policies were trained so, and other trainings with AR(1) noise would get other bits.

    Args:
        configurations: Goals of options besides home [rad], shape (n, 6).
        rate: Probability per control period that an option starts.
    """

    STATE = ("_noise", "_rng", "_left", "_goal")

    def __init__(
        self,
        noise: PerEnvAR1Noise,
        batch: PickBatch,
        configurations: Vec,
        rate: float,
        rng: np.random.Generator,
    ) -> None:
        self._noise, self._batch, self._rng = noise, batch, rng
        self._configurations, self._rate = configurations, rate
        self.n_greedy = noise.n_greedy
        self._straight_on = batch.settings.grasp.depth > 0.0
        envs = np.arange(batch.n_envs)
        self._may_option = (envs >= self.n_greedy) & (envs % 2 == 0)
        self._left = np.zeros(batch.n_envs, dtype=np.int64)
        self._goal = np.zeros((batch.n_envs, batch.n_act))

    def apply(self, act: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return perturbed actions, shape (n_envs, n_act)."""
        noisy = self._noise.apply(act)
        self._start_options()
        active = self._left > 0
        if active.any():
            noisy[active] = self._toward_goals()[active]
            self._left[active] -= 1
        return noisy

    def _start_options(self) -> None:
        draw = self._rng.random(len(self._left)) < self._rate
        for env in np.flatnonzero(draw & self._may_option & (self._left == 0)):
            self._goal[env] = self._draw_goal(int(env))
            self._left[env] = self._rng.integers(*OPTION_STEPS)

    def _draw_goal(self, env: int) -> Vec:
        n = self._batch.n_act
        q = self._batch.state.q[env, :n]
        if self._straight_on and self._rng.random() < STRAIGHT_ON:
            return self._batch.state.q_goal[env, :n].copy()
        kind = self._rng.integers(4)
        if kind == HOLD:
            return q.copy()
        if kind == HOME:
            return self._batch.arm.home[:n]
        if kind == NEARBY:
            return q + self._rng.normal(0.0, 0.3, n)
        return self._configurations[self._rng.integers(len(self._configurations)), :n]

    def _toward_goals(self) -> Vec:
        motions = np.empty_like(self._goal)
        base_motions(self._batch.arm, self._batch.state.q, self._goal, motions)
        return motions
