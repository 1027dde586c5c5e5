"""One cell of a batch as a Gymnasium environment; the scenarios add their data sheets."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded

from app.sim.envs.rows import TIMEOUT, Batch, Obs, act_space, next_episode, obs_space
from app.sim.pick import OUTCOMES


class SingleEnv(gymnasium.Env[Obs, Obs]):
    """A thin view of a batch of one row.

    Args:
        batch: The cell.
        n_act: Length of an action.
        sees_time: Whether the time left is observed. A time-out then terminates, since it is
            part of the task; otherwise it truncates.
    """

    def __init__(self, batch: Batch, n_act: int, *, sees_time: bool) -> None:
        self.action_space = act_space(n_act)
        self.observation_space = obs_space(batch)
        self._rows, self._n_act, self._sees_time = batch, n_act, sees_time
        self._running, self._seeded = False, False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Obs, dict[str, Any]]:
        """Start episode 0 of a seed, or the next episode where no seed is given.

        Args:
            seed: Seed of this and the following episodes.
            options: ``{"episode": k}`` starts episode ``k`` instead.
        """
        super().reset(seed=seed)
        if seed is None and not self._seeded:
            seed = int(self.np_random.integers(2**31))
        self._seeded = True
        episode = (options or {}).get("episode")
        next_episode(self._rows, self._rows.state.episode, seed, episode)
        self._running = True
        return self._rows.restart()[0].copy(), self._info()

    def step(self, action: Obs) -> tuple[Obs, float, bool, bool, dict[str, Any]]:
        """Move through one control period.

        Args:
            action: In [-1, 1], see the action space.

        Raises:
            ResetNeeded: The episode has ended.
            SimulationError: The action is NaN or infinite.
        """
        if not self._running:
            raise ResetNeeded("the episode has ended: call reset() before the next step()")
        act = np.asarray(action, dtype=np.float32).reshape(1, self._n_act)
        result = self._rows.step(act, auto_reset=False)
        ended = int(result.ended[0])
        truncated = ended == TIMEOUT and not self._sees_time
        self._running = not ended
        terminated = bool(ended) and not truncated
        return (
            result.obs[0].copy(),
            float(result.rew[0]),
            terminated,
            truncated,
            self._info(),
        )

    def _info(self) -> dict[str, Any]:
        state = self._rows.state
        return {
            "outcome": OUTCOMES[int(state.outcome[0])],
            "episode_number": int(state.episode[0]),
            "clearance_m": float(state.clear[0, 0]),
            "time_left_s": float(state.time_left[0]),
        }
