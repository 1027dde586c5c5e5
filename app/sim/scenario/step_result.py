"""Result of one batched step."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True)
class StepResult:
    """Result of one batched step; the arrays are overwritten by the next step."""

    obs: NDArray[Any]
    """Observations after the step, of new episodes where one ended, (n_envs, obs_size)."""
    last_obs: NDArray[Any]
    """Final observations of the environments whose episode ended, (n_envs, obs_size)."""
    rew: NDArray[np.float32]
    """Rewards, (n_envs,)."""
    ended: NDArray[np.int64]
    """Index into OUTCOMES of episodes that ended now, 0 elsewhere, (n_envs,)."""
