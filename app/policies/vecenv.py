"""Batched scenarios as Stable-Baselines3's VecEnv."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from app.sim.kernels.episode import TIMEOUT
from app.sim.pick import OUTCOMES, PickBatch
from app.sim.reach import ReachBatch
from app.sim.sorting import SortingBatch


class BatchVecEnv(VecEnv):
    """What the VecEnvs of all scenarios share: their rows are one batch.

    Args:
        batch: The rows.
        observation_space: Space of one row's observations.
        action_space: Space of one row's actions.
    """

    def __init__(
        self,
        batch: PickBatch | ReachBatch | SortingBatch,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
    ) -> None:
        self._rows_of: PickBatch | ReachBatch | SortingBatch = batch
        self.render_mode = None
        super().__init__(batch.n_envs, observation_space, action_space)

    def close(self) -> None:
        """Nothing to close."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the batch, once per row."""
        return [getattr(self._rows_of, attr_name, None)] * len(self._rows(indices))

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


class CellVecEnv(BatchVecEnv):
    """One :class:`PickBatch` or :class:`ReachBatch`, seen by Stable-Baselines3.

    Where the time left is observed, every end of an episode is a true end: a time-out gives no
    more reward, so nothing is marked as truncated.

    Args:
        batch: The scenario.
        sees_time: Whether observations tell the time left; if not, time-outs are marked as
            truncated, and values go on beyond them.
    """

    def __init__(self, batch: PickBatch | ReachBatch, sees_time: bool = True) -> None:
        self.batch = batch
        self.ended = np.zeros(batch.n_envs, dtype=np.int64)
        """Outcome of the episodes that ended in the last step, 0 elsewhere."""
        self._sees_time = sees_time
        self._actions = np.zeros((batch.n_envs, batch.n_act), dtype=np.float32)
        self._infos: list[dict[str, Any]] = [{} for _ in range(batch.n_envs)]
        super().__init__(
            batch,
            spaces.Box(-np.inf, np.inf, (batch.obs_size,), np.float32),
            spaces.Box(-1.0, 1.0, (batch.n_act,), np.float32),
        )

    def reset(self) -> NDArray[np.float32]:
        """Start episode 0 of every cell."""
        return self.batch.reset().copy()

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keep the actions, shape (n_envs, n_act), for the next step_wait."""
        self._actions = np.asarray(actions, dtype=np.float32)

    def step_wait(
        self,
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], list[dict[str, Any]]]:
        """Step all cells; ended rows start anew and carry their final observation."""
        result = self.batch.step(self._actions)
        self.ended = result.ended.copy()
        infos = self._infos.copy()
        for row in np.flatnonzero(self.ended):
            infos[row] = {
                "terminal_observation": result.last_obs[row].copy(),
                "outcome": OUTCOMES[self.ended[row]],
            }
            if not self._sees_time and self.ended[row] == TIMEOUT:
                infos[row]["TimeLimit.truncated"] = True
        return result.obs.copy(), result.rew.copy(), self.ended > 0, infos
