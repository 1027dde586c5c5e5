"""A batch of cells as a Gymnasium vector environment, stepped by one compiled call."""

from typing import Any

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from app.sim.envs.rows import (
    TIMEOUT,
    Batch,
    Obs,
    act_space,
    add_final,
    next_episode,
    obs_space,
)
from app.sim.pick import OUTCOMES

NAMES = np.array(OUTCOMES, dtype=object)
Steps = tuple[Obs, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]


class BatchVectorEnv(VectorEnv[Obs, Obs, NDArray[Any]]):
    """A batch as it is: ``AutoresetMode.SAME_STEP``.

    Where an episode ends, the next one starts within the same step: the observation returned is
    already the new episode's first, the last one is in ``infos["final_obs"]`` (an array of
    objects, None elsewhere), outcome and number of the episode in ``infos["final_info"]``;
    ``infos["_final_obs"]`` marks the rows. ``outcome``, ``episode_number``, ``clearance_m`` and
    ``time_left_s`` tell of the episodes that run now.

    Args:
        batch: The cells.
        n_act: Length of an action.
        sees_time: Whether the time left is observed; decides what a time-out is, as in
            ``SingleEnv``.
    """

    metadata: dict[str, Any] = {
        "autoreset_mode": AutoresetMode.SAME_STEP,
        "render_modes": [],
    }

    def __init__(self, batch: Batch, n_act: int, *, sees_time: bool) -> None:
        self.num_envs = batch.n_envs
        self.single_action_space = act_space(n_act)
        self.single_observation_space = obs_space(batch)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self._rows, self._n_act, self._sees_time = batch, n_act, sees_time
        self._seeded = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Obs, dict[str, Any]]:
        """Start episode 0 of a seed in every cell, or the next one where no seed is given.

        Args:
            seed: Seed of all cells: cell ``k`` equals a single environment with this seed and
                ``first_env=k``.
            options: ``{"episode": n}`` starts episode ``n`` instead.
        """
        super().reset(seed=seed)
        if seed is None and not self._seeded:
            seed = int(self.np_random.integers(2**31))
        self._seeded = True
        episode = (options or {}).get("episode")
        next_episode(self._rows, self._rows.state.episode, seed, episode)
        return self._rows.restart().copy(), self._info()

    def step(self, actions: Obs) -> Steps:
        """Move every cell through one control period.

        Args:
            actions: In [-1, 1], shape (num_envs, n_act).

        Raises:
            ResetNeeded: ``reset`` was never called.
            SimulationError: An action is NaN or infinite.
        """
        if not self._seeded:
            raise ResetNeeded("call reset() before the first step()")
        act = np.asarray(actions, dtype=np.float32).reshape(self.num_envs, self._n_act)
        result = self._rows.step(act, auto_reset=True)
        done = result.ended > 0
        late = (result.ended == TIMEOUT) & (not self._sees_time)
        infos = self._info()
        if done.any():
            add_final(
                infos, result.last_obs, done, NAMES[result.ended], self._rows.state.episode
            )
        return result.obs.copy(), result.rew.astype(np.float64), done & ~late, late, infos

    def _info(self) -> dict[str, Any]:
        state = self._rows.state
        infos: dict[str, Any] = {
            "outcome": NAMES[state.outcome],
            "episode_number": state.episode.copy(),
            "clearance_m": state.clear[:, 0].copy(),
            "time_left_s": state.time_left.copy(),
        }
        for name in tuple(infos):
            infos[f"_{name}"] = np.ones(self.num_envs, dtype=np.bool_)
        return infos
