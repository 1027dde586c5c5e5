"""The batched sorting task as Stable-Baselines3's VecEnv.

An episode that is cut off at the horizon is truncated, not terminated: attempts left are not
observed, so the value there goes on.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from app.sim.sorting import OUTCOMES, SortingBatch

TIMEOUT = OUTCOMES.index("timeout")


class SortingVecEnv(VecEnv):
    """One :class:`SortingBatch`, seen by Stable-Baselines3.

    Args:
        batch: The tasks.
    """

    def __init__(self, batch: SortingBatch) -> None:
        self.batch = batch
        self._actions = np.zeros(batch.n_envs, dtype=np.int64)
        self._infos: list[dict[str, Any]] = [{} for _ in range(batch.n_envs)]
        self.render_mode = None
        shape = batch.shape
        super().__init__(
            batch.n_envs,
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

    def close(self) -> None:
        """Nothing to close."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the batch, once per row."""
        return [getattr(self.batch, attr_name, None)] * len(self._rows(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Rows share one batch: single attributes cannot be set."""
        raise NotImplementedError(f"cannot set {attr_name} of rows that share one batch")

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Rows share one batch: there is no environment to call."""
        raise NotImplementedError(f"rows share one batch, no method {method_name} per row")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Rows are never wrapped."""
        return [False] * len(self._rows(indices))

    def _rows(self, indices: None | int | Sequence[int]) -> Sequence[int]:
        return list(self._get_indices(indices))
