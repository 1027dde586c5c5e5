"""Commands and results of the reach steps under speed and separation monitoring."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec


class Commands(NamedTuple):
    """Commands of one control period: actions, or segments."""

    act: NDArray[np.float32]
    """Actions of all environments in [-1, 1], shape (n_envs, 6)."""
    segments: Vec
    """Coefficients of t^2 (half the acceleration) of segments, a row per stepped environment
    [rad/s^2], shape (k, 6); no rows where actions are given."""


class StepResults(NamedTuple):
    """Results of one control period; entries of other environments are left unchanged."""

    rew: NDArray[np.float32]
    """Rewards, shape (n_envs,)."""
    ended: NDArray[np.int64]
    """Outcome of episodes that ended now, RUNNING elsewhere, shape (n_envs,)."""
