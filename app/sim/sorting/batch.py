"""Batch of sorting tasks (docs/method.md 1).

A step returns observations of integers (slots, towers, goal, failure probabilities), masks of
the moves that change the state, rewards and outcomes. ``human_rate`` includes people that add,
remove and move objects or change the goal (docs/method.md 1.2).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.cells.parts import MAX_FAILURE
from app.sim.core.arrays import Vec
from app.sim.core.jit import direct
from app.sim.scenario.step_result import StepResult
from app.sim.scene.scene import env_numbers, require_shape
from app.sim.sorting.kernels import episode as sorting_episode
from app.sim.sorting.kernels import task as kernel
from app.sim.sorting.kernels.reward import SortingWeights
from app.sim.sorting.state import (
    NULL,
    Move,
    SortingShape,
    SortingState,
    check_state,
)
from app.state_dict import Stateful

OUTCOMES = ("running", "success", "timeout")
"""Names of the outcomes in ``envs.outcome``."""

Obs = NDArray[np.uint8]
_SHARES = (
    "disturbed_share",
    "solved_episodes",
    "solved_share",
    "even_share",
    "human_rate",
    "localisation_rate",
    "random_map_share",
)
"""Settings that are shares or probabilities."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingSettings:
    """Starts, disturbances, rewards and ends of episodes.

    Raises:
        InvalidInput: A number is out of range.
    """

    horizon_factor: float = 4.0
    """Attempts per clutter slot after which an episode is truncated."""
    disturbed_share: float = 0.0
    """Share of episodes that start with any objects on the towers and partly built goals."""
    solved_episodes: float = 0.0
    """Share of episodes that start partly solved (e_s of docs/method.md 1.4)."""
    solved_share: float = 0.0
    """Share of their goal that is done (g_s)."""
    even_share: float = 0.0
    """Share of episodes with uniform instead of triangular distributions of K_E and K_G."""
    human_rate: float = 0.0
    """Probability per attempt that a person interferes."""
    localisation_rate: float = 0.0
    """Probability per pick from the clutter that another than the selected object is moved."""
    random_map_share: float = 0.0
    """Share of episodes with a failure map drawn at random."""
    failure_max: float = 0.4
    """Greatest failure probability of such a map."""
    n_objects: int = 0
    """Objects per episode, K_E; 0: drawn (docs/method.md 1.4)."""
    n_goal: int = 0
    """Objects in the goal, K_G; 0: drawn."""
    weights: SortingWeights = field(default_factory=SortingWeights)
    """Reward coefficients."""

    def __post_init__(self) -> None:
        if not 0.0 < self.horizon_factor < math.inf:
            rule = "must be positive and finite"
            raise InvalidInput("horizon_factor", self.horizon_factor, rule)
        for name in _SHARES:
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InvalidInput(name, getattr(self, name), "must lie in [0, 1]")
        if not 0.0 <= self.failure_max <= MAX_FAILURE:
            rule = f"must lie in [0, {MAX_FAILURE}]: a pick that always fails has no plan"
            raise InvalidInput("failure_max", self.failure_max, rule)


def shape_of(cell: Cell) -> SortingShape:
    """Return the shape of a cell's sorting task: clutter slots and towers.

    Raises:
        InvalidInput: The cell has no clutter slots or no clusters.
    """
    n_slots, n_colours = len(cell.stations_of("clutter")), len(cell.stations_of("cluster"))
    if not n_slots or not n_colours:
        rule = "needs stations of kind clutter and of kind cluster to sort"
        raise InvalidInput("cell", cell.name, rule)
    return SortingShape(n_slots=n_slots, n_colours=n_colours)


def fail_of(cell: Cell) -> Vec:
    """Return the failure probabilities of a cell's clutter slots, shape (K,)."""
    return np.array([one.failure_probability or 0.0 for one in cell.stations_of("clutter")])


def new_envs(shape: SortingShape, n_envs: int, fail: Vec) -> kernel.SortingEnvs:
    """Return the state of ``n_envs`` environments whose episodes have not started."""
    k, c = shape.n_slots, shape.n_colours

    def ints(*more: int) -> NDArray[np.int64]:
        return np.zeros((n_envs, *more), dtype=np.int64)

    return kernel.SortingEnvs(
        clutter=np.zeros((n_envs, k), dtype=np.int8),
        towers=np.zeros((n_envs, c, k), dtype=np.int8),
        heights=ints(c),
        goal=np.zeros((n_envs, c, k), dtype=np.int8),
        goal_heights=ints(c),
        fail=np.tile(fail, (n_envs, 1)),
        own_fail=np.tile(fail, (n_envs, 1)),
        fixed_objects=ints(),
        fixed_goal=ints(),
        steps=ints(),
        moves=ints(),
        failures=ints(),
        interferences=ints(),
        episode=ints(),
        outcome=ints(),
        rng=np.zeros((n_envs, 1), dtype=np.uint64),
        counts=ints(2, shape.n_types + 1),
    )


def _check_sizes(settings: SortingSettings, shape: SortingShape) -> None:
    """Raise InvalidInput if settings have more objects than exist, or fit."""
    most = settings.n_objects or shape.n_slots
    for name, value, limit in (
        ("n_objects", settings.n_objects, shape.n_slots),
        ("n_goal", settings.n_goal, most),
    ):
        if not 0 <= value <= limit:
            raise InvalidInput(name, value, f"must lie in [0, {limit}]")


class SortingBatch(Stateful):
    """Many sorting tasks, stepped together by one thread.

    Copies (``copy.deepcopy``, ``pickle``) continue with the same bits as the original.

    Args:
        shape: Size of the tasks.
        fail: Failure probabilities of the clutter slots, shape (K,).
        seed: Seed; episode ``k`` of environment ``e`` is fixed by (seed, e, k).
        settings: Starts, disturbances, rewards and ends.
        first_env: Number of the first environment in the random streams.

    Raises:
        InvalidInput: The failure map or the fixed sizes do not fit the shape.
    """

    STATE = ("seed", "envs", "_obs", "_last", "_masks", "_rew", "_ended")

    def __init__(
        self,
        shape: SortingShape,
        fail: Vec,
        n_envs: int,
        seed: int,
        settings: SortingSettings | None = None,
        first_env: int = 0,
    ) -> None:
        if fail.shape != (shape.n_slots,) or not ((fail >= 0.0) & (fail <= MAX_FAILURE)).all():
            rule = f"must be {shape.n_slots} probabilities in [0, {MAX_FAILURE}]"
            raise InvalidInput("fail", fail.tolist(), rule)
        self.shape, self.n_envs, self.seed = shape, n_envs, seed
        self._first = first_env
        self.envs = new_envs(shape, n_envs, fail)
        """State of all environments."""
        self.settings = settings or SortingSettings()
        self._obs = np.zeros((n_envs, shape.obs_size), dtype=np.uint8)
        self._last = np.zeros_like(self._obs)
        self._masks = np.zeros((n_envs, shape.n_actions), dtype=np.bool_)
        self._rew = np.zeros(n_envs, dtype=np.float32)
        self._ended = np.zeros(n_envs, dtype=np.int64)
        self._step: Callable[..., None] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to pickle, without the compiled kernel."""
        return {**self.__dict__, "_step": None}

    @property
    def settings(self) -> SortingSettings:
        """Starts, disturbances, rewards and ends; may be replaced between two steps."""
        return self._settings

    @settings.setter
    def settings(self, settings: SortingSettings) -> None:
        _check_sizes(settings, self.shape)
        self._settings = settings
        self.envs.fixed_objects[:] = settings.n_objects
        self.envs.fixed_goal[:] = settings.n_goal

    @property
    def obs(self) -> Obs:
        """Last observations, (n_envs, obs_size)."""
        return self._obs

    @property
    def episode(self) -> NDArray[np.int64]:
        """Numbers of the present episodes, (n_envs,); set them to choose the next ones."""
        return self.envs.episode

    @property
    def horizon(self) -> int:
        """Attempts after which an episode is truncated."""
        return round(self.settings.horizon_factor * self.shape.n_slots)

    def _rules(self) -> kernel.SortingRules:
        of = self.settings
        return kernel.SortingRules(
            n_sizes=self.shape.n_sizes,
            horizon=self.horizon,
            disturbed_share=of.disturbed_share,
            solved_episodes=of.solved_episodes,
            solved_share=of.solved_share,
            even_share=of.even_share,
            human_rate=of.human_rate,
            localisation_rate=of.localisation_rate,
            random_map_share=of.random_map_share,
            failure_max=of.failure_max,
        )

    def reset(self, seed: int | None = None) -> Obs:
        """Start episode 0 in every environment; return observations, (n_envs, obs_size)."""
        self.seed = self.seed if seed is None else seed
        self.envs.episode[:] = 0
        return self.restart()

    def restart(self) -> Obs:
        """Start the episodes numbered by ``envs.episode``; return the observations."""
        sorting_episode.start_envs(self.envs, self._rules(), self.seed, self._first, self._obs)
        return self._obs

    def start(self, envs: NDArray[np.int64]) -> Obs:
        """Start the episodes numbered by ``episode`` in some environments.

        Args:
            envs: Numbers of the environments, shape (k,).

        Returns:
            Observations of all environments, (n_envs, obs_size).

        Raises:
            InvalidInput: An environment does not exist.
        """
        checked = env_numbers(envs, self.n_envs)
        if np.array_equal(checked, np.arange(self.n_envs)):
            return self.restart()
        for e in checked.tolist():
            one = kernel.SortingEnvs._make(part[e : e + 1] for part in self.envs)
            first, obs = self._first + e, self._obs[e : e + 1]
            sorting_episode.start_envs(one, self._rules(), self.seed, first, obs)
        return self._obs

    def step(self, act: NDArray[np.int64], *, auto_reset: bool = True) -> StepResult:
        """Make one attempt in every environment.

        Args:
            act: Actions as ``SortingShape`` numbers them, shape (n_envs,).
            auto_reset: Start the next episode where one ended; else the environment stays.

        Raises:
            InvalidInput: The actions have another shape, or one is no action.
        """
        require_shape("act", act, (self.n_envs,))
        wanted = np.array(act, dtype=np.int64, order="C")
        if (wanted < 0).any() or (wanted >= self.shape.n_actions).any():
            raise InvalidInput("act", act, f"must lie in [0, {self.shape.n_actions})")
        arguments: tuple[Any, ...] = (
            self.envs,
            self._rules(),
            self.settings.weights,
            self.seed,
            self._first,
            wanted,
            auto_reset,
            sorting_episode.StepBuffers(self._obs, self._last, self._rew, self._ended),
        )
        if self._step is None:
            self._step = direct(sorting_episode.step_envs, arguments)
        self._step(*arguments)
        return StepResult(obs=self._obs, last_obs=self._last, rew=self._rew, ended=self._ended)

    def masks(self) -> NDArray[np.bool_]:
        """Return whether each move changes the state, shape (n_envs, n_actions); reused."""
        kernel.masks_of(self.envs, self._masks)
        return self._masks

    def observations(self) -> Obs:
        """Return the observations of the present states, (n_envs, obs_size); overwritten."""
        kernel.observe_envs(self.envs, self._obs)
        return self._obs

    def put(self, e: int, state: SortingState) -> None:
        """Start an episode of environment ``e`` in a given state."""
        self.change(e, state)
        envs = self.envs
        for counter in (envs.steps, envs.moves, envs.failures, envs.interferences):
            counter[e] = 0

    def change(self, e: int, state: SortingState) -> None:
        """Set the state of environment ``e``, as by a person; counters continue.

        Raises:
            InvalidInput: The state does not fit.
        """
        check_state(state, self.shape)
        envs = self.envs
        envs.clutter[e], envs.towers[e], envs.goal[e] = state.clutter, state.towers, state.goal
        envs.heights[e] = state.heights
        envs.goal_heights[e] = (state.goal != NULL).sum(axis=1)
        envs.fail[e] = state.fail
        envs.outcome[e] = kernel.RUNNING

    def state_of(self, e: int) -> SortingState:
        """Return a copy of environment ``e``."""
        envs = self.envs
        return SortingState(
            clutter=envs.clutter[e].copy(),
            towers=envs.towers[e].copy(),
            goal=envs.goal[e].copy(),
            fail=envs.fail[e].copy(),
        )


def batch_in(
    cell: Cell,
    n_envs: int,
    seed: int,
    settings: SortingSettings | None = None,
    first_env: int = 0,
) -> SortingBatch:
    """Return a batch with the size and the failure map of a work cell."""
    return SortingBatch(shape_of(cell), fail_of(cell), n_envs, seed, settings, first_env)


def observe(state: SortingState) -> Obs:
    """Return the observation of one state, shape (obs_size,): integers.

    Clutter (K), towers (C K), goal (C K), failure probabilities times 250 (K).
    """
    scaled = np.floor(state.fail * kernel.FAILURE_SCALE + 0.5)
    parts = (state.clutter, state.towers.ravel(), state.goal.ravel(), scaled)
    return np.concatenate(parts).astype(np.uint8)


def valid_moves(state: SortingState, shape: SortingShape) -> NDArray[np.bool_]:
    """Return whether each move changes the state, shape (n_actions,)."""
    there, towers = state.clutter != NULL, state.heights > 0
    across = towers[:, None] & ~np.eye(shape.n_colours, dtype=np.bool_)
    return np.concatenate(
        [np.repeat(there, shape.n_colours), (towers[:, None] & ~there).ravel(), across.ravel()]
    )


def apply(state: SortingState, shape: SortingShape, move: Move) -> SortingState:
    """Return the state after a move that succeeds.

    Raises:
        InvalidInput: The move changes nothing.
    """
    if not valid_moves(state, shape)[shape.action_of(move)]:
        rule = "must pick where an object is and place where there is room"
        raise InvalidInput("move", [move.pick, move.place], rule)
    k, heights = shape.n_slots, state.heights
    clutter, towers = state.clutter.copy(), state.towers.copy()
    if move.pick < k:
        code, clutter[move.pick] = clutter[move.pick], NULL
    else:
        c = move.pick - k
        code, towers[c, heights[c] - 1] = towers[c, heights[c] - 1], NULL
    if move.place < k:
        clutter[move.place] = code
    else:
        c = move.place - k
        towers[c, heights[c]] = code
    return SortingState(clutter=clutter, towers=towers, goal=state.goal, fail=state.fail)
