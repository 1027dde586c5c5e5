"""A batch as Stable-Baselines3's ``VecEnv``, for every scenario.

Spaces, actions and truncation are those of the Gymnasium environments (``envs/tasks.py``).
Ended environments restart within the step; their final observation is in
``infos[i]["terminal_observation"]``.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from app.sim.envs.tasks import SteppedTask
from app.state_dict import Stateful

COUNTERS = ("num_timesteps", "_n_updates", "_episode_num", "_current_progress_remaining")
"""Counters of Stable-Baselines3's algorithms."""


class BatchVecEnv(VecEnv, Stateful):
    """The environments of one batch."""

    STATE = ("batch", "ended")

    def __init__(self, task: SteppedTask) -> None:
        self._task = task
        self.batch = task.batch
        """The environments."""
        self.ended: NDArray[np.int64] = np.zeros(task.batch.n_envs, dtype=np.int64)
        """Outcome of the episodes that ended in the last step, 0 elsewhere, (n_envs,)."""
        self._actions: NDArray[Any] = np.zeros(0)
        self._infos: list[dict[str, Any]] = [{} for _ in range(task.batch.n_envs)]
        self.render_mode = None
        super().__init__(task.batch.n_envs, task.observation_space, task.action_space)

    def reset(self) -> NDArray[Any]:
        """Start episode 0 in every environment; return observations, (n_envs, obs_size)."""
        return self.batch.reset().copy()

    def step_async(self, actions: NDArray[Any]) -> None:
        """Store the actions of the next :meth:`step_wait`."""
        self._actions = self._task.actions(actions)

    def step_wait(
        self,
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any], list[dict[str, Any]]]:
        """Step all environments; return observations, rewards, ends and infos."""
        result = self.batch.step(self._actions)
        self.ended = result.ended.copy()
        infos, truncated = self._infos.copy(), self._task.truncates(self.ended)
        for env in np.flatnonzero(self.ended):
            infos[env] = {
                "terminal_observation": result.last_obs[env].copy(),
                "TimeLimit.truncated": bool(truncated[env]),
            }
        return result.obs.copy(), result.rew.copy(), self.ended > 0, infos

    def close(self) -> None:
        """Do nothing: a batch holds no resources."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute of the batch, once per environment."""
        return [getattr(self.batch, attr_name, None)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refuse: the environments share one batch."""
        raise NotImplementedError(f"cannot set {attr_name}: environments share one batch")

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Refuse: the environments share one batch."""
        raise NotImplementedError(f"cannot call {method_name}: environments share one batch")

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that no environment is wrapped."""
        return [False] * len(list(self._get_indices(indices)))
