"""Batched scenarios as Stable-Baselines3's VecEnv."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from app.sim.people.kernels.pedestrian import PedestrianState
from app.sim.pick.batch import OUTCOMES, PickBatch
from app.sim.prediction.kernels.privileged import N_AHEAD, look_ahead_of_walkers
from app.sim.reach.batch import ReachBatch
from app.sim.reach.mixed_batch import ReachRows
from app.sim.scenario.kernels.episode import TIMEOUT
from app.sim.sorting.batch import SortingBatch


class BatchVecEnv(VecEnv):
    """What the VecEnvs of all scenarios share: their rows are one batch.

    Args:
        batch: The rows.
        observation_space: Space of one row's observations.
        action_space: Space of one row's actions.
    """

    def __init__(
        self,
        batch: PickBatch | ReachRows | SortingBatch,
        observation_space: spaces.Space[Any],
        action_space: spaces.Space[Any],
    ) -> None:
        self._rows_of: PickBatch | ReachRows | SortingBatch = batch
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


class Foresight:
    """Where the walkers of a batch will be, for critics.

    Args:
        batch: The scenario.
    """

    def __init__(self, batch: ReachBatch) -> None:
        people = batch.state.people.walkers
        self._rules, self._dt, self._walkers = batch.world.people.walkers, batch.arm.dt, people
        self._copy = PedestrianState(people.rows.copy(), people.stream.copy())
        n_envs, n_pedestrians = people.rows.shape[:2]
        self.size = n_pedestrians * N_AHEAD
        """Numbers per row."""
        self._ahead = np.zeros((n_envs, self.size))

    def after(self, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return observations with the future behind them, shape (n_envs, F + size)."""
        look_ahead_of_walkers(self._rules, self._walkers, self._copy, self._dt, self._ahead)
        return np.concatenate([obs, self._ahead], axis=1, dtype=np.float32)


class CellVecEnv(BatchVecEnv):
    """One :class:`PickBatch` or :class:`ReachBatch`, seen by Stable-Baselines3.

    Where the time left is observed, every end of an episode is a true end: a time-out gives no
    more reward, so nothing is marked as truncated.

    Args:
        batch: The scenario.
        sees_time: Whether observations tell the time left; if not, time-outs are marked as
            truncated, and values go on beyond them.
        foresight: What critics see behind an observation; None: nothing. Final observations
            have zeros there.
    """

    def __init__(
        self,
        batch: PickBatch | ReachRows,
        sees_time: bool = True,
        foresight: Foresight | None = None,
    ) -> None:
        self.batch, self._foresight = batch, foresight
        beyond = 0 if foresight is None else foresight.size
        self.n_seen = batch.obs_size + beyond
        """Numbers that critics see."""
        self._nothing = np.zeros(beyond, dtype=np.float32)
        self.ended = np.zeros(batch.n_envs, dtype=np.int64)
        """Outcome of the episodes that ended in the last step, 0 elsewhere."""
        self._sees_time = sees_time
        self._actions = np.zeros((batch.n_envs, batch.n_act), dtype=np.float32)
        self._infos: list[dict[str, Any]] = [{} for _ in range(batch.n_envs)]
        super().__init__(
            batch,
            spaces.Box(-np.inf, np.inf, (self.n_seen,), np.float32),
            spaces.Box(-1.0, 1.0, (batch.n_act,), np.float32),
        )

    def reset(self) -> NDArray[np.float32]:
        """Start episode 0 of every cell."""
        return self._with_future(self.batch.reset())

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
                "terminal_observation": np.concatenate([result.last_obs[row], self._nothing]),
                "outcome": OUTCOMES[self.ended[row]],
            }
            if not self._sees_time and self.ended[row] == TIMEOUT:
                infos[row]["TimeLimit.truncated"] = True
        return self._with_future(result.obs), result.rew.copy(), self.ended > 0, infos

    def _with_future(self, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        return obs.copy() if self._foresight is None else self._foresight.after(obs)
