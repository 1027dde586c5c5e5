"""One environment of a batch as a Gymnasium environment."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from app.sim.envs.arguments import check_render_mode, options_of
from app.sim.envs.raycast import Image
from app.sim.envs.tasks import BatchTask, episodes_of, next_episode, seed_of

ROW = np.zeros(1, dtype=np.int64)


class SingleEnv(gymnasium.Env[NDArray[Any], Any]):
    """A batch of one environment; copies continue independently.

    ``gymnasium.wrappers.RecordVideo`` records videos if moviepy is installed.

    Args:
        render_mode: ``rgb_array``, or None.

    Raises:
        InvalidInput: The render mode is unknown.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}

    def __init__(self, task: BatchTask, render_mode: str | None) -> None:
        self._task = task
        self.action_space, self.observation_space = task.action_space, task.observation_space
        self.render_mode = check_render_mode(render_mode)
        self.metadata = {**self.metadata, "render_fps": task.render_fps}
        self._running, self._seeded = False, False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Start episode 0 of a seed, or the next episode if no seed is given.

        Args:
            seed: Seed of this and the following episodes.
            options: ``{"episode": k}`` starts episode ``k`` instead.

        Raises:
            InvalidInput: The seed or the number of the episode is out of range, or there is no
                such option; nothing is changed.
        """
        stated = options_of(options, ("episode",))
        seed, episodes = seed_of(seed), episodes_of(stated.get("episode"), len(ROW))
        super().reset(seed=seed)
        if seed is None and not self._seeded:
            seed = int(self.np_random.integers(2**31))
        batch = self._task.batch
        next_episode(batch, ROW, seed, episodes)
        self._seeded = self._running = True
        return batch.obs[0].copy(), self._info()

    def step(self, action: Any) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        """Execute one control period, or one attempt of the sorting task.

        Raises:
            ResetNeeded: The episode has ended.
            SimulationError: The action is NaN or infinite.
            InvalidInput: The action does not exist, or has another shape.
        """
        if not self._running:
            raise ResetNeeded("the episode has ended: call reset() before the next step()")
        task = self._task
        result = task.batch.step(task.actions(action), auto_reset=False)
        over, truncated = bool(result.ended[0]), bool(task.truncates(result.ended)[0])
        self._running = not over
        obs, rew = task.batch.obs[0].copy(), float(result.rew[0])
        return obs, rew, over and not truncated, truncated, self._info()

    def render(self) -> Image | None:
        """Return an image of the present state, uint8, shape (360, 480, 3).

        Returns:
            None if the environment was made without a ``render_mode``.

        Raises:
            ResetNeeded: ``reset`` was never called.
        """
        if self.render_mode is None:
            gymnasium.logger.warn("render() needs an environment made with a render_mode")
            return None
        if not self._seeded:
            raise ResetNeeded("call reset() before the first render()")
        return self._task.picture(0)

    def _info(self) -> dict[str, Any]:
        firsts = {name: values[0] for name, values in self._task.infos().items()}
        return {
            name: one.item() if isinstance(one, np.generic) else one
            for name, one in firsts.items()
        }
