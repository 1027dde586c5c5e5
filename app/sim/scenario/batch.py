"""Batch of environments of one scenario, stepped by one thread.

Buffers, resets and steps common to the pick and reach scenarios, around the kernels of
``pick/kernels/episode.py`` and ``reach/kernels/episode.py``. A step calls up to three kernels,
for motion, observation and resets; a single kernel would be compiled once per call site.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from types import ModuleType
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.core.jit import direct
from app.sim.people.kernels.people import PeopleState
from app.sim.robot.kernels.arm import Arm
from app.sim.scenario.kernels.episode import (
    RUNNING,
    EpisodeState,
    Indices,
    new_episode_state,
    new_step_workspace,
)
from app.sim.scenario.step_result import StepResult
from app.sim.scene.scene import env_numbers, require_finite, require_shape
from app.state_dict import Stateful


class EnvBatch(Stateful, ABC):
    """Resets and steps the environments of a scenario.

    Copies (``copy.deepcopy``, ``pickle``) continue bit by bit as the original would.

    Args:
        world: Data that all environments share.
        task: Rules, action type and reward coefficients.
        n_act: Length of an action.
        seed: Seed; episode ``k`` of environment ``e`` is determined by (seed, e, k).
        first_env: Number of the first environment in the random streams.
        view: Contents and length of an observation.
    """

    STATE: ClassVar[tuple[str, ...]] = (
        "seed",
        "state",
        "_work",
        "_obs",
        "_last",
        "_rew",
        "_ended",
    )
    _kernel: ModuleType
    """Kernels of the scenario: ``reset_envs`` and ``step_batch``."""
    cell: Cell
    """Work cell."""

    def __init__(
        self,
        world: Any,
        task: Any,
        people: PeopleState,
        *,
        n_envs: int,
        n_act: int,
        seed: int,
        first_env: int,
        view: tuple[int, int],
    ) -> None:
        self.n_envs, self.n_act, self.seed = n_envs, n_act, seed
        self.world, self._task, self._first = world, task, first_env
        self.arm: Arm = world.arm
        self.state: EpisodeState = new_episode_state(self.arm, people, n_envs)
        self._work = new_step_workspace(self.arm, world.people, people)
        self._view, self.obs_size = view
        self._obs = np.zeros((n_envs, self.obs_size), dtype=np.float32)
        self._last = np.zeros_like(self._obs)
        self._rew = np.zeros(n_envs, dtype=np.float32)
        self._ended = np.zeros(n_envs, dtype=np.int64)
        self._all = np.arange(n_envs)
        self._compiled: dict[Callable[..., None], Callable[..., None]] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Return the state of a copy; a copy looks up its compiled kernels again."""
        return {**self.__dict__, "_compiled": {}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Restore the state of another batch.

        Copied arrays are writable. Kernels would be compiled again for a writable primitive
        library, so it is made read-only.
        """
        self.__dict__.update(state)
        self.world.people.primitive_library.samples.setflags(write=False)

    @property
    def episode(self) -> Indices:
        """Numbers of the present episodes, (n_envs,); set them to choose the next ones."""
        return self.state.episode

    @property
    def obs(self) -> NDArray[np.float32]:
        """Last observations, (n_envs, obs_size)."""
        return self._obs

    def reset(self, seed: int | None = None) -> NDArray[np.float32]:
        """Start episode 0 in every environment; return observations, (n_envs, obs_size)."""
        self.seed = self.seed if seed is None else seed
        self.state.episode[:] = 0
        return self.restart()

    def restart(self) -> NDArray[np.float32]:
        """Start the episodes numbered by ``episode``; return the observations."""
        return self.start(self._all)

    def start(self, envs: Indices) -> NDArray[np.float32]:
        """Start the episodes numbered by ``episode`` in some environments.

        Args:
            envs: Numbers of the environments, shape (k,).

        Returns:
            Observations of all environments, (n_envs, obs_size).

        Raises:
            InvalidInput: An environment does not exist.
        """
        checked = self._checked(envs)
        self._start(checked)
        return self._look(checked)

    def step(
        self, act: NDArray[np.float32], *, auto_reset: bool = True, features: bool = True
    ) -> StepResult:
        """Move every environment through one control period.

        Args:
            act: Actions in [-1, 1], shape (n_envs, n_act); the settings choose their type.
            auto_reset: Start the next episode where one ended; else the environment stays.
            features: Whether observations are wanted.

        Raises:
            InvalidInput: The actions have another shape.
            SimulationError: An action is NaN or infinite.
        """
        require_shape("act", act, (self.n_envs, self.n_act))
        require_finite("act", act)
        live = np.flatnonzero(self.state.outcome == RUNNING)
        self._move(np.array(act, dtype=np.float32, order="C"))
        if features:
            self._look(live)
        done = np.flatnonzero(self._ended)
        if auto_reset and len(done):
            self._last[done] = self._obs[done]
            self.state.episode[done] += 1
            self._start(done)
            if features:
                self._look(done)
        return StepResult(obs=self._obs, last_obs=self._last, rew=self._rew, ended=self._ended)

    def _checked(self, envs: Indices) -> Indices:
        """Return the numbers of environments that exist, for kernels."""
        return env_numbers(envs, self.n_envs)

    def _checked_goals(self, envs: Indices, goals: Vec) -> Vec:
        """Return a finite goal for each environment [m], shape (len(envs), 3)."""
        points = np.asarray(goals)
        require_shape("goals", points, (len(envs), 3))
        require_finite("goals", points)
        return as_kernel_array(points)

    def _start(self, envs: Indices) -> None:
        """Start episodes in some environments."""
        first = self.seed, self._first
        reset = self._kernel.reset_envs
        self._call(reset, self.world, self._task, *first, self.state, envs, self._work)

    def _move(self, act: NDArray[np.float32]) -> None:
        """Step every running environment; fill rewards and outcomes."""
        shared = self.world, self._task, self.state, self._work
        self._call(self._kernel.step_batch, *shared, act, self._rew, self._ended)

    def _look(self, envs: Indices) -> NDArray[np.float32]:
        """Write the observations of some environments; return all, (n_envs, obs_size)."""
        if np.array_equal(envs, self._all):
            self._observe(envs, self._obs)
        elif len(envs):
            out = np.empty((len(envs), self.obs_size), dtype=np.float32)
            self._observe(envs, out)
            self._obs[envs] = out
        return self._obs

    @abstractmethod
    def _observe(self, envs: Indices, out: NDArray[np.float32]) -> None:
        """Write the observations of some environments, shape (len(envs), obs_size)."""

    def _call(self, kernel: Callable[..., None], *arguments: Any) -> None:
        """Call a kernel whose arguments always have the same types."""
        if kernel not in self._compiled:
            self._compiled[kernel] = direct(kernel, arguments)
        self._compiled[kernel](*arguments)
