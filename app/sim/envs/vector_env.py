"""A batch as a Gymnasium vector environment."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from app.errors import InvalidInput
from app.sim.envs.arguments import action_array, check_render_mode, options_of
from app.sim.envs.raycast import Image
from app.sim.envs.tasks import BatchTask, Mask, Rows, episodes_of, next_episode, seed_of

MODES = tuple(mode.value for mode in AutoresetMode)
Steps = tuple[NDArray[Any], NDArray[np.float64], Mask, Mask, dict[str, Any]]


class BatchVectorEnv(VectorEnv[NDArray[Any], NDArray[Any], NDArray[Any]]):
    """A batch with the autoreset modes of Gymnasium; copies continue independently.

    | ``autoreset_mode`` | where an episode ended |
    |--------------------|------------------------|
    | ``NextStep`` | the next step ignores the action and starts the next episode: its first |
    | | observation, reward 0, neither terminated nor truncated |
    | ``SameStep`` | the next episode starts within the same step: the observation returned is |
    | | its first, the last one is in ``infos["final_obs"]`` (an array of objects, None |
    | | elsewhere), the last infos in ``infos["final_info"]``; ``infos["_final_obs"]`` marks |
    | | the environments. All other entries describe the present episodes |
    | ``Disabled`` | the caller calls ``reset(options={"reset_mask": mask})`` before the next |
    | | step |

    Args:
        render_mode: ``rgb_array``, or None.
        autoreset_mode: One of Gymnasium's modes, or its value.
        max_episode_steps: Steps after which an episode is truncated, as
            ``gymnasium.wrappers.TimeLimit`` does it; None or -1 for no such limit.

    Raises:
        InvalidInput: The mode is unknown, or the limit is below 1.
    """

    metadata: dict[str, Any] = {
        "autoreset_mode": AutoresetMode.NEXT_STEP,
        "render_modes": ["rgb_array"],
    }

    def __init__(
        self,
        task: BatchTask,
        render_mode: str | None,
        autoreset_mode: str | AutoresetMode,
        max_episode_steps: int | None,
    ) -> None:
        self._task, self.num_envs = task, task.batch.n_envs
        self.single_action_space = task.action_space
        self.single_observation_space = task.observation_space
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.render_mode = check_render_mode(render_mode)
        self._mode = _autoreset_of(autoreset_mode)
        self.metadata = {
            **self.metadata,
            "autoreset_mode": self._mode,
            "render_fps": task.render_fps,
        }
        self._limit = _limit_of(max_episode_steps)
        self._steps = np.zeros(self.num_envs, dtype=np.int64)
        self._over = np.zeros(self.num_envs, dtype=np.bool_)
        self._seeded = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Start episode 0 of a seed in every environment, or the next one without a seed.

        Args:
            seed: Seed of all: environment ``k`` equals a single environment with this seed and
                ``first_env=k``.
            options: ``{"episode": n}`` starts episode ``n`` instead; ``{"reset_mask": mask}``
                starts the next episodes only where the mask, bool of shape (num_envs,), is
                true. ``infos["_outcome"]`` etc. then mark these environments.

        Raises:
            InvalidInput: The mask has another shape or type, is false everywhere, or is
                combined with a seed although it is not true everywhere; the seed or the number
                of an episode is out of range; there is no such option. Nothing is changed.
            ResetNeeded: The first reset is partial.
        """
        stated = options_of(options, ("episode", "reset_mask"))
        seed, chosen = seed_of(seed), self._chosen(stated.get("reset_mask"), seed)
        episodes = episodes_of(stated.get("episode"), int(chosen.sum()))
        super().reset(seed=seed)
        if seed is None and not self._seeded:
            seed = int(self.np_random.integers(2**31))
        self._begin(chosen, seed, episodes)
        self._seeded = True
        return self._task.batch.obs.copy(), _marked(self._task.infos(), chosen)

    def _chosen(self, mask: Any, seed: int | None) -> Mask:
        """Return the environments that a reset starts."""
        if mask is None:
            return np.ones(self.num_envs, dtype=np.bool_)
        field, found = "options.reset_mask", np.asarray(mask)
        if found.dtype != np.bool_ or found.shape != (self.num_envs,):
            given = f"{found.dtype} of shape {found.shape}"
            raise InvalidInput(field, given, f"must be bool of shape ({self.num_envs},)")
        if not found.any():
            raise InvalidInput(field, found.tolist(), "must mark at least one environment")
        if not found.all():
            if seed is not None:
                rule = "must be None with a reset_mask: all environments share one seed"
                raise InvalidInput("seed", seed, rule)
            if not self._seeded:
                raise ResetNeeded("call reset() without reset_mask first")
        return found.copy()

    def _begin(
        self, chosen: Mask, seed: int | None = None, episodes: Rows | None = None
    ) -> None:
        """Start episodes in the marked environments."""
        next_episode(self._task.batch, np.flatnonzero(chosen), seed, episodes)
        self._steps[chosen], self._over[chosen] = 0, False

    def step(self, actions: NDArray[Any]) -> Steps:
        """Execute one control period, or one attempt of the sorting task, in every environment.

        Raises:
            ResetNeeded: ``reset`` was never called, or, with ``Disabled``, not after an end.
            SimulationError: An action is NaN or infinite.
            InvalidInput: There is no such action, or the actions have another shape.
        """
        waiting = self._over.copy()
        self._require_running(waiting)
        task = self._task
        given = _without(actions, waiting) if waiting.any() else actions
        result = task.batch.step(task.actions(given), auto_reset=False)
        rew = np.where(waiting, 0.0, result.rew.astype(np.float64))
        ended = np.where(waiting, 0, result.ended)
        late = task.truncates(ended)
        terminated = (ended > 0) & ~late
        self._steps += 1
        if waiting.any():
            self._begin(waiting)
        truncated = late | (self._steps >= self._limit)
        self._over = terminated | truncated
        infos: dict[str, Any] = {}
        if self._mode is AutoresetMode.SAME_STEP and self._over.any():
            infos = self._final(self._over.copy())
            self._begin(self._over.copy())
        every = np.ones(self.num_envs, dtype=np.bool_)
        infos = _marked(task.infos(), every) | infos
        return task.batch.obs.copy(), rew, terminated, truncated, infos

    def _require_running(self, waiting: Mask) -> None:
        if not self._seeded:
            raise ResetNeeded("call reset() before the first step()")
        if self._mode is AutoresetMode.DISABLED and waiting.any():
            rows = ", ".join(map(str, np.flatnonzero(waiting)[:8]))
            raise ResetNeeded(
                f"episodes have ended in environments {rows}: call "
                'reset(options={"reset_mask": terminated | truncated}) before the next step()'
            )

    def _final(self, done: Mask) -> dict[str, Any]:
        """Return observations and infos of the episodes that ended now."""
        last = np.full(self.num_envs, None, dtype=object)
        for row in np.flatnonzero(done):
            last[row] = self._task.batch.obs[row].copy()
        info = _marked(_only(self._task.infos(), done), done)
        return _marked({"final_obs": last}, done) | {"final_info": info, "_final_info": done}

    def render(self) -> tuple[Image, ...] | None:
        """Return an image of every environment, as :meth:`SingleEnv.render` does."""
        if self.render_mode is None:
            gymnasium.logger.warn("render() needs an environment made with a render_mode")
            return None
        if not self._seeded:
            raise ResetNeeded("call reset() before the first render()")
        return tuple(self._task.picture(row) for row in range(self.num_envs))


def _without(actions: ArrayLike, ignored: Mask) -> NDArray[Any]:
    """Return actions with zeros for some environments, whatever is given for these."""
    act = np.array(action_array(actions))
    if ignored.all():
        act[...] = 0
    elif act.ndim and len(act) == len(ignored):  # another shape is refused later
        act[ignored] = 0
    return act


def _marked(infos: dict[str, NDArray[Any]], rows: Mask) -> dict[str, Any]:
    """Return infos with Gymnasium's masks of the environments that they describe."""
    return infos | {f"_{name}": rows.copy() for name in infos}


def _only(infos: dict[str, NDArray[Any]], rows: Mask) -> dict[str, NDArray[Any]]:
    """Return infos with None or 0 in all other environments."""
    found = {name: values.copy() for name, values in infos.items()}
    for values in found.values():
        values[~rows] = None if values.dtype == object else 0
    return found


def _autoreset_of(mode: str | AutoresetMode) -> AutoresetMode:
    try:
        return AutoresetMode(mode)
    except ValueError:
        rule = "must be a mode of gymnasium.vector.AutoresetMode"
        raise InvalidInput("autoreset_mode", mode, rule, MODES) from None


def _limit_of(steps: int | None) -> int:
    """Return the largest number of steps of an episode."""
    if steps is None or steps == -1:
        return int(np.iinfo(np.int64).max)
    if isinstance(steps, bool) or not isinstance(steps, int | np.integer) or steps < 1:
        rule = "must be an integer of at least 1, or None or -1 for no limit"
        raise InvalidInput("max_episode_steps", steps, rule)
    return int(steps)
