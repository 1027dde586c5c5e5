"""Commands and results of the reach steps under speed and separation monitoring."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec


class Commands(NamedTuple):
    """Commands of one control period: actions, or segments."""

    act: NDArray[np.float32]
    """Actions of all environments, shape (n_envs, 6)."""
    segments: Vec
    """Second coefficients of segments of degree 2, one per stepped environment [rad/s^2], shape
    (k, 6); no rows for actions."""


class StepResults(NamedTuple):
    """Results of one control period; entries of other environments are left unchanged."""

    rew: NDArray[np.float32]
    """Rewards, shape (n_envs,)."""
    ended: NDArray[np.int64]
    """Outcome of episodes that ended now, RUNNING elsewhere, shape (n_envs,)."""
