"""Many cells of one scenario, stepped together by one thread.

What the batches of both scenarios share: buffers, restarts and steps around the compiled
kernels of ``pick/kernels/episode.py`` and ``reach/kernels/episode.py``, which take the same
arguments. A step
is up to three kernels: all rows move, rows are observed, those that ended start again. In one
kernel their code would be compiled, and optimised, once for every place that calls it.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.sim.core.jit import direct
from app.sim.scenario.kernels.episode import RUNNING
from app.sim.scene.scene import require_finite, require_shape

Rows = NDArray[np.int64]
"""Numbers of environments."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepResult:
    """What one batched step gave; the arrays are overwritten by the next step."""

    obs: NDArray[np.float32]
    """Observations after the step, of new episodes where one ended, (n_envs, obs_size)."""
    last_obs: NDArray[np.float32]
    """Final observation of the rows that ended, (n_envs, obs_size)."""
    rew: NDArray[np.float32]
    """Rewards, (n_envs,)."""
    ended: NDArray[np.int64]
    """Index into OUTCOMES of episodes that ended now, 0 elsewhere, (n_envs,)."""


class EnvBatch(ABC):
    """Restarts and steps the rows of a scenario.

    Copies (``copy.deepcopy``, ``pickle``) go on bit by bit as the original would.

    Args:
        shared: World, rules, action rule, reward weights, rows and work space, as they take
            them.
        n_envs: Number of cells.
        n_act: Numbers per action.
        seed: Seed; episode ``k`` of cell ``e`` is fixed by (seed, e, k).
        first_env: Number of the first cell in the random streams.
        view: What observations hold, and how many numbers they are.
    """

    _kernel: ModuleType
    """The scenario's kernels: ``reset_rows`` and ``step_batch``."""

    def __init__(
        self,
        shared: tuple[Any, Any, Any, Any, Any, Any],
        *,
        n_envs: int,
        n_act: int,
        seed: int,
        first_env: int,
        view: tuple[int, int],
    ) -> None:
        self.n_envs, self.seed = n_envs, seed
        self.n_act = n_act
        self._first = first_env
        self._world, self._rules, self._action, self._weights, self._rows, self._work = shared
        self._view, self.obs_size = view
        self._obs = np.zeros((n_envs, self.obs_size), dtype=np.float32)
        self._last = np.zeros_like(self._obs)
        self._rew = np.zeros(n_envs, dtype=np.float32)
        self._ended = np.zeros(n_envs, dtype=np.int64)
        self._all = np.arange(n_envs)
        self._compiled: dict[Callable[..., None], Callable[..., None]] = {}

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy is made of; it finds its compiled kernels itself."""
        return {**self.__dict__, "_compiled": {}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take the state of another batch over.

        Copied arrays are writable. Kernels are compiled once more, for minutes, where one is
        that was not, so the shared primitive_library is made read-only again.
        """
        self.__dict__.update(state)
        self._world.people.primitive_library.samples.setflags(write=False)

    @property
    def episode(self) -> Rows:
        """Numbers of the present episodes, (n_envs,); those that start next are set here."""
        numbers: Rows = self._rows.episode
        return numbers

    @property
    def obs(self) -> NDArray[np.float32]:
        """Observations as they were last written, (n_envs, obs_size)."""
        return self._obs

    def reset(self, seed: int | None = None) -> NDArray[np.float32]:
        """Start episode 0 in every cell; return observations, (n_envs, obs_size)."""
        self.seed = self.seed if seed is None else seed
        self._rows.episode[:] = 0
        return self.restart()

    def restart(self) -> NDArray[np.float32]:
        """Start the episodes numbered by ``episode``; return the observations."""
        return self.start(self._all)

    def start(self, rows: Rows) -> NDArray[np.float32]:
        """Start the episodes numbered by ``episode`` in some cells.

        Args:
            rows: Numbers of the cells, shape (k,).

        Returns:
            Observations of all cells, (n_envs, obs_size).
        """
        self._start(rows)
        return self._look(rows)

    def step(
        self, act: NDArray[np.float32], *, auto_reset: bool = True, features: bool = True
    ) -> StepResult:
        """Move every cell through one control period.

        Args:
            act: Actions in [-1, 1], shape (n_envs, n_act); what they mean is in the settings.
            auto_reset: Start the next episode where one ended; else its row stands still.
            features: Whether observations are wanted.

        Raises:
            InvalidInput: The actions have another shape.
            SimulationError: An action is NaN or infinite.
        """
        require_shape("act", act, (self.n_envs, self.n_act))
        require_finite("act", act)
        live = np.flatnonzero(self._rows.outcome == RUNNING)
        self._move(np.array(act, dtype=np.float32, order="C"))
        if features:
            self._look(live)
        done = np.flatnonzero(self._ended)
        if auto_reset and len(done):
            self._last[done] = self._obs[done]
            self._rows.episode[done] += 1
            self._start(done)
            if features:
                self._look(done)
        return StepResult(obs=self._obs, last_obs=self._last, rew=self._rew, ended=self._ended)

    def _start(self, rows: Rows) -> None:
        """Start episodes in some cells."""
        self._call(
            self._kernel.reset_rows,
            self._world,
            self._rules,
            self.seed,
            self._first,
            self._rows,
            rows,
            self._work,
        )

    def _move(self, act: NDArray[np.float32]) -> None:
        """Move every cell that runs through one period; fill rewards and ends."""
        self._call(
            self._kernel.step_batch,
            self._world,
            self._rules,
            self._action,
            self._weights,
            self._rows,
            self._work,
            act,
            self._rew,
            self._ended,
        )

    def _look(self, rows: Rows) -> NDArray[np.float32]:
        """Write the observations of some cells; return those of all, (n_envs, obs_size)."""
        if len(rows) == self.n_envs:
            self._observe(rows, self._obs)
        elif len(rows):
            out = np.empty((len(rows), self.obs_size), dtype=np.float32)
            self._observe(rows, out)
            self._obs[rows] = out
        return self._obs

    @abstractmethod
    def _observe(self, rows: Rows, out: NDArray[np.float32]) -> None:
        """Write the observations of some cells, shape (len(rows), obs_size)."""

    def _call(self, kernel: Callable[..., None], *arguments: Any) -> None:
        """Call a kernel that is always given arguments of the same types."""
        if kernel not in self._compiled:
            self._compiled[kernel] = direct(kernel, arguments)
        self._compiled[kernel](*arguments)
