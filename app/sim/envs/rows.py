"""What single and vector environments ask of a batch of cells."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol, TypeVar, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from app.sim.batch import StepResult
from app.sim.cells import Cell, load_cell
from app.sim.pick import OUTCOMES, PickSettings
from app.sim.ports import Vec
from app.sim.reach import ReachSettings
from app.sim.scene import HumanKind

Obs = NDArray[np.float32]
Settings = TypeVar("Settings", PickSettings, ReachSettings)

OBS_BOUND = 100.0
"""Bound of the observation spaces; nothing observed comes near it."""
TIMEOUT = OUTCOMES.index("timeout")


class State(Protocol):
    """Rows of a batch that are told in ``info``."""

    @property
    def episode(self) -> NDArray[np.int64]:
        """Numbers of the present episodes, shape (n_envs,)."""

    @property
    def outcome(self) -> NDArray[np.int64]:
        """How they stand, index into OUTCOMES, shape (n_envs,)."""

    @property
    def clear(self) -> Vec:
        """Distances to people, cell and the robot itself [m], shape (n_envs, 3)."""

    @property
    def time_left(self) -> Vec:
        """Time left [s], shape (n_envs,)."""


class Seeded(Protocol):
    """Whatever draws its episodes from a seed."""

    seed: int


class Batch(Seeded, Protocol):
    """Cells that are stepped together; ``PickBatch`` and ``ReachBatch`` are such."""

    n_envs: int
    obs_size: int

    @property
    def state(self) -> State:
        """Rows of the cells."""

    def restart(self) -> Obs:
        """Start the episodes numbered by ``state.episode``."""

    def step(self, act: Obs, *, auto_reset: bool = True) -> StepResult:
        """Move every cell through one control period."""


def cell_of(cell: str | Cell) -> Cell:
    """Return a work cell given by name or as it is."""
    return load_cell(cell) if isinstance(cell, str) else cell


def settings_with(settings: Settings, people: Sequence[HumanKind] | None) -> Settings:
    """Return settings with other people, or as they are where ``people`` is None."""
    return settings if people is None else replace(settings, people=tuple(people))


def _box(bound: float, n: int) -> spaces.Space[Obs]:
    return cast("spaces.Space[Obs]", spaces.Box(-bound, bound, (n,), np.float32))


def act_space(n_act: int) -> spaces.Space[Obs]:
    """Return the space of one cell's actions."""
    return _box(1.0, n_act)


def obs_space(batch: Batch) -> spaces.Space[Obs]:
    """Return the space of one cell's observations."""
    return _box(OBS_BOUND, batch.obs_size)


def next_episode(
    batch: Seeded, episodes: NDArray[np.int64], seed: int | None, episode: int | None
) -> None:
    """Number the episodes that start now: 0 of a new seed, the next of the same, or any."""
    if seed is not None:
        batch.seed = seed
        episodes[:] = 0
    else:
        episodes[:] += 1
    if episode is not None:
        episodes[:] = episode


def add_final(
    infos: dict[str, Any],
    last: NDArray[Any],
    done: NDArray[np.bool_],
    outcome: NDArray[Any],
    episode: NDArray[np.int64],
) -> None:
    """Tell in ``infos`` how the episodes ended that ended now, as Gymnasium does.

    Args:
        infos: What is told; changed.
        last: Final observations of the rows that ended, shape (n_envs, obs_size).
        done: Which rows ended, shape (n_envs,).
        outcome: Their names of outcomes, shape (n_envs,).
        episode: Numbers of the episodes that run now, shape (n_envs,).
    """
    final_obs = np.full(done.size, None, dtype=object)
    for row in np.flatnonzero(done):
        final_obs[row] = last[row].copy()
    final: dict[str, Any] = {
        "outcome": np.where(done, outcome.astype(object), np.array(None, dtype=object)),
        "episode_number": np.where(done, episode - 1, 0),
    }
    for name in tuple(final):
        final[f"_{name}"] = done.copy()
    infos["final_obs"], infos["_final_obs"] = final_obs, done.copy()
    infos["final_info"], infos["_final_info"] = final, done.copy()
