"""The sorting task as Gymnasium environments: one task, or a batch."""

from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from app.sim.cells import Cell
from app.sim.envs.rows import add_final, cell_of, next_episode
from app.sim.kernels.sorting import FAILURE_SCALE, SUCCESS, TIMEOUT
from app.sim.sorting import OUTCOMES, Obs, SortingBatch, SortingSettings, fail_of, shape_of
from app.sim.sorting_state import SortingShape

NAMES = np.array(OUTCOMES, dtype=object)
Acts = NDArray[np.int64]
Steps = tuple[Obs, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]


def _obs_space(shape: SortingShape) -> spaces.Space[Obs]:
    """Return the space of one task's observations."""
    high = np.full(shape.obs_size, shape.n_types, dtype=np.uint8)
    high[-shape.n_cells :] = FAILURE_SCALE
    box = spaces.Box(np.zeros_like(high), high, dtype=np.uint8)
    return cast("spaces.Space[Obs]", box)


def _tell(batch: SortingBatch) -> dict[str, Any]:
    """Return what ``info`` says, a row per task."""
    rows = batch.rows
    return {
        "outcome": NAMES[rows.outcome],
        "episode_number": rows.episode.copy(),
        "attempts": rows.steps.copy(),
        "moves": rows.moves.copy(),
        "failures": rows.failures.copy(),
        "action_mask": batch.masks().astype(np.int8),
    }


class SortingEnv(gymnasium.Env[Obs, np.int64]):
    """A robot sorts objects out of a clutter onto towers, one per colour.

    | id | cell | K | colours | sizes | actions |
    |----|------|---|---------|-------|---------|
    | ``tandem/SortingE0-v0`` | ``sorting-e0`` | 10 | 2 | 3 | 44 |
    | ``tandem/SortingE1-v0`` | ``sorting-e1`` | 20 | 3 | 3 | 129 |

    ``cell`` may be any work cell with clutter cells and clusters. ``gymnasium.make_vec`` gives
    the batched :class:`SortingVectorEnv`.

    ## Task
    Make every tower what the goal asks for. A goal asks for *a* large blue object, never for a
    certain one: objects of one colour and size are twins.

    ## Action space
    ``Discrete(C (2 K + C))``, with ``K`` clutter cells and ``C`` towers:

    | action | move |
    |--------|------|
    | ``k C + c`` | clutter cell ``k`` to tower ``c`` |
    | ``K C + c K + k`` | top of tower ``c`` to clutter cell ``k`` |
    | ``2 K C + c C + d`` | top of tower ``c`` to ``d``; ``c == d`` changes nothing |

    ``info["action_mask"]`` (int8, as ``Discrete.sample`` takes it) and :meth:`action_masks`
    (bool, as sb3-contrib asks for it) mark the moves that would change something. Others are
    allowed and cost.

    ## Observation space
    ``Box(0, high, (2 K (1 + C),), uint8)``: codes, to be made one-hot inside a network.

    | index | content | most |
    |-------|---------|------|
    | ``0..K-1`` | clutter cells | ``C S`` |
    | ``K..K+CK-1`` | towers, each from its lowest level | ``C S`` |
    | ``K+CK..K+2CK-1`` | the goal's towers, likewise | ``C S`` |
    | ``K+2CK..2K+2CK-1`` | failure probability of a pick from each cell, times 250 | 250 |

    Code 0 is no object, others are ``1 + colour S + size``, sizes from the smallest.

    ## Dynamics
    A pick from the clutter fails with its cell's probability and leaves all as it is; picks
    from towers do not fail. ``settings.localisation_rate`` adds picks of another object than
    was meant, ``settings.human_rate`` people who add, remove and move objects and change goals.

    ## Reward
    ``-0.05`` for an attempt, ``-0.3`` for an empty pick, ``-0.3`` for putting an object back
    where it was or where there is no room, ``-0.05`` for a failure, ``-0.05`` for sending an
    object from a tower to the clutter, ``-0.1 d / K`` for the ``d`` levels that differ from the
    goal afterwards (a wrong colour or a wrong size counts half), ``+1`` for the goal.
    ``settings.weights`` holds the coefficients.

    ## Start
    ``K_E`` objects of random types lie in random clutter cells, ``K_G`` of them are the goal,
    the largest at the bottom of each tower; both are triangular with their mode at the most,
    K and ``K_E``, unless ``settings`` fix them. ``settings.disturbed_share`` of the episodes
    start with objects already on towers, rightly or wrongly.

    ## End
    The goal *terminates*; ``4 K`` attempts *truncate*. ``info["outcome"]`` names the end.

    ## Randomness
    Episode ``k`` after ``reset(seed=s)``, with its failures and people, is fixed by
    (s, first_env, k) and equals episode ``k`` of row ``first_env`` of a ``SortingVectorEnv``
    with that seed, bit for bit.

    Args:
        cell: Name of a shipped work cell, or a work cell.
        settings: Starts, disturbances, rewards and ends.
        first_env: Which row of a vector environment this one equals.

    Source: thesis sections 3.3 and 3.4, METHOD 1. Deviates: coefficients and failure map are
    not printed and chosen here; the failure map is observed.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self,
        cell: str | Cell = "sorting-e0",
        settings: SortingSettings | None = None,
        first_env: int = 0,
    ) -> None:
        self.batch = _batch(cell, 1, settings, first_env)
        self.action_space = spaces.Discrete(self.batch.shape.n_actions)
        self.observation_space = _obs_space(self.batch.shape)
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
        self._seeded = self._running = True
        episode = (options or {}).get("episode")
        next_episode(self.batch, self.batch.rows.episode, seed, episode)
        return self.batch.restart()[0].copy(), self._info()

    def step(self, action: np.int64) -> tuple[Obs, float, bool, bool, dict[str, Any]]:
        """Make one attempt.

        Args:
            action: Number of a move, see the action space.

        Raises:
            ResetNeeded: The episode has ended.
            InvalidInput: There is no such action.
        """
        if not self._running:
            raise ResetNeeded("the episode has ended: call reset() before the next step()")
        result = self.batch.step(np.asarray(action).reshape(1), auto_reset=False)
        ended = int(result.ended[0])
        self._running = not ended
        obs, rew = result.obs[0].copy(), float(result.rew[0])
        return obs, rew, ended == SUCCESS, ended == TIMEOUT, self._info()

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which moves would change something, shape (n_actions,)."""
        mask: NDArray[np.bool_] = self.batch.masks()[0].copy()
        return mask

    def _info(self) -> dict[str, Any]:
        told = {name: rows[0] for name, rows in _tell(self.batch).items()}
        return {
            name: int(one) if isinstance(one, np.integer) else one for name, one in told.items()
        }


class SortingVectorEnv(VectorEnv[Obs, Acts, NDArray[Any]]):
    """Many tasks of :class:`SortingEnv`, stepped together: ``AutoresetMode.SAME_STEP``.

    Where an episode ends, the next one starts within the same step: the observation returned is
    already the new episode's first, the last one is in ``infos["final_obs"]``, outcome and
    number of the episode in ``infos["final_info"]``. All else in ``infos`` tells of the
    episodes that run now; ``infos["action_mask"]`` has the shape (num_envs, n_actions).

    Args:
        num_envs: Number of tasks.
        cell: Name of a shipped work cell, or a work cell.
        settings: Starts, disturbances, rewards and ends.
        first_env: Number of the first task.
    """

    metadata: dict[str, Any] = {
        "autoreset_mode": AutoresetMode.SAME_STEP,
        "render_modes": [],
    }

    def __init__(
        self,
        num_envs: int = 1,
        cell: str | Cell = "sorting-e0",
        settings: SortingSettings | None = None,
        first_env: int = 0,
    ) -> None:
        self.batch = _batch(cell, num_envs, settings, first_env)
        self.num_envs = num_envs
        self.single_action_space = spaces.Discrete(self.batch.shape.n_actions)
        self.single_observation_space = _obs_space(self.batch.shape)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._seeded = False

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Obs, dict[str, Any]]:
        """Start episode 0 of a seed in every task, or the next one where no seed is given.

        Args:
            seed: Seed of all tasks: task ``k`` equals a single environment with this seed and
                ``first_env=k``.
            options: ``{"episode": n}`` starts episode ``n`` instead.
        """
        super().reset(seed=seed)
        if seed is None and not self._seeded:
            seed = int(self.np_random.integers(2**31))
        self._seeded = True
        episode = (options or {}).get("episode")
        next_episode(self.batch, self.batch.rows.episode, seed, episode)
        return self.batch.restart().copy(), self._info()

    def step(self, actions: Acts) -> Steps:
        """Make one attempt in every task.

        Args:
            actions: Numbers of moves, shape (num_envs,).

        Raises:
            ResetNeeded: ``reset`` was never called.
            InvalidInput: There is no such action.
        """
        if not self._seeded:
            raise ResetNeeded("call reset() before the first step()")
        result = self.batch.step(np.asarray(actions))
        done, infos = result.ended > 0, self._info()
        if done.any():
            outcome, episode = NAMES[result.ended], self.batch.rows.episode
            add_final(infos, result.last_obs, done, outcome, episode)
        rew = result.rew.astype(np.float64)
        over, late = result.ended == SUCCESS, result.ended == TIMEOUT
        return result.obs.copy(), rew, over, late, infos

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which moves would change something, shape (num_envs, n_actions)."""
        return self.batch.masks().copy()

    def _info(self) -> dict[str, Any]:
        infos = _tell(self.batch)
        marks = {f"_{name}": np.ones(self.num_envs, dtype=np.bool_) for name in infos}
        return infos | marks


def _batch(
    cell: str | Cell, n_envs: int, settings: SortingSettings | None, first_env: int
) -> SortingBatch:
    found = cell_of(cell)
    return SortingBatch(shape_of(found), fail_of(found), n_envs, 0, settings, first_env)
