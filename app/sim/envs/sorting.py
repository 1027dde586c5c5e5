"""The sorting task as Gymnasium environments: one task, or a batch."""

from typing import Any, cast

import numpy as np
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.envs.arguments import action_array, cell_of, env_number, settings_of
from app.sim.envs.raycast import Image
from app.sim.envs.rendering import block_solids, picture, standing_workers
from app.sim.envs.single_env import SingleEnv
from app.sim.envs.tasks import Infos, Mask, Rows
from app.sim.envs.vector_env import BatchVectorEnv
from app.sim.sorting.batch import OUTCOMES, Obs, SortingBatch, SortingSettings, batch_in
from app.sim.sorting.kernels.task import FAILURE_SCALE, TIMEOUT
from app.sim.sorting.state import SortingShape

NAMES = np.array(OUTCOMES, dtype=object)


class SortingTask:
    """Sorting tasks of a cell.

    Args:
        timeouts_end: Whether a timeout ends a task, and does not truncate its episode.
    """

    render_fps = 4
    """Attempts per second of a video."""

    def __init__(self, cell: Cell, batch: SortingBatch, *, timeouts_end: bool = False) -> None:
        self._cell, self.batch, self._timeouts_end = cell, batch, timeouts_end
        n_actions = batch.shape.n_actions
        self.action_space = cast("spaces.Space[Any]", spaces.Discrete(n_actions))
        self.observation_space = _obs_space(batch.shape)

    def actions(self, given: Any) -> NDArray[np.int64]:
        """Return actions as the batch takes them, shape (n_envs,).

        Raises:
            InvalidInput: An action is no whole number.
        """
        act = action_array(given).reshape(-1)
        if act.dtype.kind not in "iu" and not (
            act.dtype.kind == "f" and (act == np.trunc(act)).all()
        ):
            raise InvalidInput("act", act.tolist(), "must be whole numbers, the moves")
        return act

    def truncates(self, ended: Rows) -> Mask:
        """Return whether outcomes truncate an episode, shape (n_envs,)."""
        late: Mask = (ended == TIMEOUT) & (not self._timeouts_end)
        return late

    def infos(self) -> Infos:
        """Return ``info``, an entry per task."""
        envs = self.batch.envs
        return {
            "outcome": NAMES[envs.outcome],
            "episode_number": envs.episode.copy(),
            "attempts": envs.steps.copy(),
            "moves": envs.moves.copy(),
            "failures": envs.failures.copy(),
            "action_mask": self.batch.masks().astype(np.int8),
        }

    def picture(self, row: int) -> Image:
        """Return an image of one task: the robot and the person stand still."""
        cell, blocks = self._cell, self.batch.state_of(row)
        home = np.array(cell.robot.home_q)
        task = block_solids(cell, self.batch.shape, blocks)
        return picture(cell, home, standing_workers(cell), task)


def _obs_space(shape: SortingShape) -> spaces.Space[Obs]:
    """Return the space of one task's observations."""
    high = np.full(shape.obs_size, shape.n_types, dtype=np.uint8)
    high[-shape.n_slots :] = FAILURE_SCALE
    box = spaces.Box(np.zeros_like(high), high, dtype=np.uint8)
    return cast("spaces.Space[Obs]", box)


class SortingEnv(SingleEnv):
    """A robot sorts objects out of a clutter onto towers, one per colour.

    | id | cell | K | colours | sizes | actions |
    |----|------|---|---------|-------|---------|
    | ``tandem/SortingE0-v0`` | ``sorting-e0`` | 10 | 2 | 3 | 44 |
    | ``tandem/SortingE1-v0`` | ``sorting-e1`` | 20 | 3 | 3 | 129 |

    ``cell`` may be any work cell with clutter slots and clusters. ``gymnasium.make_vec`` gives
    the batched :class:`SortingVectorEnv`.

    ## Task
    Build the towers of the goal. A goal consists of colours and sizes, such as a large blue
    object, not of certain objects: objects of one colour and size are duplicates.

    ## Action space
    ``Discrete(C (2 K + C))``, with ``K`` clutter slots and ``C`` towers:

    | action | move |
    |--------|------|
    | ``k C + c`` | clutter slot ``k`` to tower ``c`` |
    | ``K C + c K + k`` | top of tower ``c`` to clutter slot ``k`` |
    | ``2 K C + c C + d`` | top of tower ``c`` to ``d``; ``c == d`` changes nothing |

    ``info["action_mask"]`` (int8, as ``Discrete.sample`` takes it) and :meth:`action_masks`
    (bool, as sb3-contrib requires it) mark the moves that change the state. Others are
    allowed and have a cost.

    ## Observation space
    ``Box(0, high, (2 K (1 + C),), uint8)``: codes, to be made one-hot inside a network.

    | index | content | maximum |
    |-------|---------|---------|
    | ``0..K-1`` | clutter slots | ``C S`` |
    | ``K..K+CK-1`` | towers, each from its lowest level | ``C S`` |
    | ``K+CK..K+2CK-1`` | the goal's towers, likewise | ``C S`` |
    | ``K+2CK..2K+2CK-1`` | failure probability of a pick from each slot, times 250 | 250 |

    Code 0 is no object, others are ``1 + colour S + size``, sizes from the smallest.

    ## Dynamics
    A pick from the clutter fails with the probability of its slot and then changes nothing;
    picks from towers do not fail. With ``settings.localisation_rate`` another object than the
    selected one is picked, with ``settings.human_rate`` people add, remove and move objects and
    change goals.

    ## Reward
    ``-0.05`` for an attempt, ``-0.3`` for an empty pick, ``-0.3`` for putting an object back
    where it was or where no place is free, ``-0.01`` for a failure, ``-0.01`` for sending an
    object from a tower to the clutter, ``-0.01 d / K`` for the ``d`` levels that differ from
    the goal afterwards (a wrong colour or a wrong size counts half), ``+1`` for an attempt
    that meets the goal. People act after the reward: a goal that they meet is a success
    without this bonus.
    ``settings.weights`` holds the coefficients.

    ## Start
    ``K_E`` objects of random types lie in random clutter slots, ``K_G`` of them are the goal,
    the largest at the bottom of each tower. Both numbers have triangular distributions with the
    mode at their maximum, K and ``K_E``, unless ``settings`` fix them. A share
    ``settings.disturbed_share`` of the episodes starts with objects on towers, at positions of
    the goal or not.

    ## End
    The goal *terminates*; ``4 K`` attempts *truncate*. ``info["outcome"]`` names the end.

    ## Randomness
    Episode ``k`` after ``reset(seed=s)``, with its failures and people, is fixed by
    (s, first_env, k) and equals episode ``k`` of row ``first_env`` of a ``SortingVectorEnv``
    with that seed, bit for bit.

    Args:
        cell: Name of a shipped work cell, or a work cell.
        settings: Starts, disturbances, rewards and ends.
        first_env: Number of the equal row of a vector environment.
        render_mode: ``rgb_array`` or None: blocks in clutter and towers, those that the goal
            contains translucent; darker clutter slots have higher failure probabilities.

    Source: thesis sections 3.3 and 3.4, docs/method.md 1. Deviates: coefficients and failure
    map are not printed and chosen here; the failure map is observed.
    """

    def __init__(
        self,
        cell: str | Cell = "sorting-e0",
        settings: SortingSettings | None = None,
        first_env: int = 0,
        render_mode: str | None = None,
    ) -> None:
        chosen, first = cell_of(cell), env_number("first_env", first_env)
        self.batch = batch_in(chosen, 1, 0, settings_of(settings, SortingSettings()), first)
        super().__init__(SortingTask(chosen, self.batch), render_mode)

    def action_masks(self) -> NDArray[np.bool_]:
        """Return whether each move changes the state, shape (n_actions,)."""
        mask: NDArray[np.bool_] = self.batch.masks()[0].copy()
        return mask


class SortingVectorEnv(BatchVectorEnv):
    """Many tasks of :class:`SortingEnv`, stepped together.

    ``infos["action_mask"]`` has the shape (num_envs, n_actions).

    Arguments are those of :class:`SortingEnv` and :class:`BatchVectorEnv`; ``first_env`` is the
    number of the first of ``num_envs`` environments.
    """

    def __init__(
        self,
        num_envs: int = 1,
        cell: str | Cell = "sorting-e0",
        settings: SortingSettings | None = None,
        first_env: int = 0,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
    ) -> None:
        chosen, stated = cell_of(cell), settings_of(settings, SortingSettings())
        first, n = env_number("first_env", first_env), env_number("num_envs", num_envs, 1)
        self.batch = batch_in(chosen, n, 0, stated, first)
        task = SortingTask(chosen, self.batch)
        super().__init__(task, render_mode, autoreset_mode, max_episode_steps)

    def action_masks(self) -> NDArray[np.bool_]:
        """Return whether each move changes the state, shape (num_envs, n_actions)."""
        return self.batch.masks().copy()
