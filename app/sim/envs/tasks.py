"""Interface of batches for single and vector environments."""

from typing import Any, Protocol, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.core.observation_layout import OBS_BOUND
from app.sim.envs.arguments import action_array
from app.sim.envs.raycast import Image
from app.sim.envs.rendering import people_solids, picture, target_solids
from app.sim.pick.batch import OUTCOMES, PickBatch
from app.sim.reach.batch import ReachBatch
from app.sim.reach.mixed_batch import ReachEnvironments
from app.sim.scenario.step_result import StepResult

Rows = NDArray[np.int64]
Mask = NDArray[np.bool_]
Infos = dict[str, NDArray[Any]]

MAX_SEED, MAX_EPISODE = 2**63 - 1, 2**62 - 1
"""Greatest seed; greatest number of a stated episode, to which later ones are added."""
NAMES = np.array(OUTCOMES, dtype=object)
TIMEOUT = OUTCOMES.index("timeout")


class SteppedBatch(Protocol):
    """Environments that are stepped together."""

    n_envs: int

    def reset(self) -> NDArray[Any]:
        """Start episode 0 in every environment; return the observations."""

    def step(self, act: Any, *, auto_reset: bool = True) -> StepResult:
        """Step every environment whose episode has not ended."""


class Batch(SteppedBatch, Protocol):
    """Environments that draw their episodes from one seed."""

    seed: int

    @property
    def episode(self) -> Rows:
        """Numbers of the present episodes, shape (n_envs,); changed before a start."""

    @property
    def obs(self) -> NDArray[Any]:
        """Observations, shape (n_envs, obs_size); overwritten."""

    def start(self, rows: Rows) -> NDArray[Any]:
        """Start the episodes numbered by ``episode`` in some environments."""


class SteppedTask(Protocol):
    """A batch with its spaces, for training."""

    action_space: spaces.Space[Any]
    """Space of one row's actions."""
    observation_space: spaces.Space[Any]
    """Space of one row's observations."""

    @property
    def batch(self) -> SteppedBatch:
        """The environments."""

    def actions(self, given: Any) -> NDArray[Any]:
        """Return actions as the batch takes them."""

    def truncates(self, ended: Rows) -> Mask:
        """Return whether outcomes truncate an episode, shape (n_envs,)."""


class BatchTask(SteppedTask, Protocol):
    """A batch with its spaces, infos and images."""

    @property
    def batch(self) -> Batch:
        """The environments."""

    def infos(self) -> Infos:
        """Return a new ``info``, an entry per row."""

    @property
    def render_fps(self) -> int:
        """Images per second of a video: one per step."""

    def picture(self, row: int) -> Image:
        """Return an image of one row."""


class ArmTask:
    """A batch of robots with its spaces, for training.

    Args:
        sees_time: Whether the time left is observed. If so, a timeout terminates an episode,
            otherwise it truncates it.
    """

    batch: SteppedBatch
    """The environments."""

    def __init__(self, batch: PickBatch | ReachEnvironments, *, sees_time: bool) -> None:
        self.batch, self._sees_time = batch, sees_time
        self.action_space = _box(1.0, batch.n_act)
        self.observation_space = _box(OBS_BOUND, batch.obs_size)

    def actions(self, given: Any) -> NDArray[np.float32]:
        """Return actions as the batch takes them, shape (n_envs, n_act).

        Those of one environment may lack the first axis. Another shape is kept, and refused by
        the batch: reshaped, it would give joints the actions of others.

        Raises:
            InvalidInput: They are no real numbers.
        """
        with np.errstate(over="ignore"):  # infinite then, which the batch refuses
            act = action_array(given).astype(np.float32, copy=False)
        return act[None] if act.ndim == 1 and self.batch.n_envs == 1 else act

    def truncates(self, ended: Rows) -> Mask:
        """Return whether outcomes truncate an episode, shape (n_envs,)."""
        late: Mask = (ended == TIMEOUT) & (not self._sees_time)
        return late


class RobotTask(ArmTask):
    """A batch of robots, people and targets."""

    batch: PickBatch | ReachBatch

    def __init__(self, batch: PickBatch | ReachBatch) -> None:
        super().__init__(batch, sees_time=batch.settings.observation != "state")

    def infos(self) -> Infos:
        """Return ``info``, an entry per environment."""
        state = self.batch.state
        return {
            "outcome": NAMES[state.outcome],
            "episode_number": state.episode.copy(),
            "clearance_m": state.clear[:, 0].copy(),
            "time_left_s": state.time_left.copy(),
        }

    @property
    def render_fps(self) -> int:
        """Control rate of the cell [Hz]."""
        return round(1.0 / self.batch.cell.robot.dt)

    def picture(self, row: int) -> Image:
        """Return an image of one environment."""
        cell, state = self.batch.cell, self.batch.state
        people = people_solids(cell, state.people, row)
        return picture(cell, state.q[row], people, target_solids(state.goal[row]))


def _box(bound: float, n: int) -> spaces.Space[Any]:
    return cast("spaces.Space[Any]", spaces.Box(-bound, bound, (n,), np.float32))


def next_episode(
    batch: Batch, rows: Rows, seed: int | None, episodes: Rows | None = None
) -> None:
    """Number and start the next episodes of some rows.

    Args:
        seed: Seed of episode 0; None for the next episode of the present seed.
        episodes: Numbers of the episodes instead of these, from :func:`episodes_of`.
    """
    if episodes is None:
        episodes = batch.episode[rows] + 1 if seed is None else np.zeros_like(rows)
    batch.seed = batch.seed if seed is None else seed
    batch.episode[rows] = episodes
    batch.start(rows)


def seed_of(given: object) -> int | None:
    """Return the seed of a reset; None if it is None.

    Raises:
        InvalidInput: It is not a whole number in [0, 2^63).
    """
    if given is None:
        return None
    if isinstance(given, int | np.integer) and not isinstance(given, bool):
        seed = int(given)
        if 0 <= seed <= MAX_SEED:
            return seed
    raise InvalidInput("seed", given, "must be a whole number in [0, 2^63), or None")


def episodes_of(given: object, n_rows: int) -> Rows | None:
    """Return stated numbers of episodes, shape (n_rows,); None if None are stated.

    Raises:
        InvalidInput: One is not a whole number in [0, 2^62), or there are not ``n_rows``.
    """
    if given is None:
        return None
    found = np.asarray(given)
    is_whole = found.dtype.kind in "iu" and found.shape in ((), (n_rows,))
    if not is_whole or not ((found >= 0) & (found <= MAX_EPISODE)).all():
        rule = f"must be a whole number in [0, 2^62), or a list of {n_rows} of them"
        raise InvalidInput("options.episode", given, rule)
    return np.full(n_rows, found, dtype=np.int64)
