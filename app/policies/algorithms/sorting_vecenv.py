"""The batched sorting task as Stable-Baselines3's VecEnv.

An episode that is cut off at the horizon is truncated, not terminated: attempts left are not
observed, so the value there goes on.
"""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from app.policies.algorithms.vecenv import BatchVecEnv
from app.sim.sorting.batch import OUTCOMES, SortingBatch

TIMEOUT = OUTCOMES.index("timeout")


class SortingVecEnv(BatchVecEnv):
    """One :class:`SortingBatch`, seen by Stable-Baselines3.

    Args:
        batch: The tasks.
    """

    def __init__(self, batch: SortingBatch) -> None:
        self.batch = batch
        self._actions = np.zeros(batch.n_envs, dtype=np.int64)
        self._infos: list[dict[str, Any]] = [{} for _ in range(batch.n_envs)]
        shape = batch.shape
        super().__init__(
            batch,
            spaces.Box(0, 255, (shape.obs_size,), np.uint8),
            spaces.Discrete(shape.n_actions),
        )

    def reset(self) -> NDArray[np.uint8]:
        """Start episode 0 of every row."""
        return self.batch.reset().copy()

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which moves change something now, shape (n_envs, n_actions); overwritten."""
        return self.batch.masks()

    def step_async(self, actions: NDArray[Any]) -> None:
        """Keep the actions, shape (n_envs,), for the next step_wait."""
        self._actions = np.asarray(actions, dtype=np.int64)

    def step_wait(
        self,
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], list[dict[str, Any]]]:
        """Step all rows; ended ones start anew and carry their final observation."""
        result = self.batch.step(self._actions)
        infos = self._infos.copy()
        for row in np.flatnonzero(result.ended):
            infos[row] = {
                "terminal_observation": result.last_obs[row].copy(),
                "TimeLimit.truncated": bool(result.ended[row] == TIMEOUT),
                "outcome": OUTCOMES[result.ended[row]],
            }
        return result.obs.copy(), result.rew.copy(), result.ended > 0, infos
