"""The sorting task as one ordinary Gymnasium environment: a peer to measure with.

What a careful user would write for stock Stable-Baselines3: plain Python and numpy, one episode
at a time, no kernels, no mask. Rules, numbers of the moves, rewards, horizon and clean starts
are those of docs/method.md 1 and of ``app/sim/sorting/state.py``; people and localisation
failures are left out. A test holds it to the compiled batch move by move.
"""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

MOVE = -0.05
EMPTY = -0.3
STUCK = -0.3
FAIL = -0.05
BACK = -0.05
DISTANCE = -0.1
"""Per level of a tower that is not as the goal asks, divided by the number of slots."""
SUCCESS = 1.0
HORIZON = 4
"""An episode is cut off after this many attempts per clutter slot."""


class PlainSorting(gymnasium.Env[NDArray[np.float32], np.int64]):
    """Bring the objects of a goal onto their towers.

    The observation is the code of every place one-hot: clutter slots, levels of the towers,
    levels of the goal's towers. The action is the number of a move.

    Args:
        fail: Failure probability of a pick from each clutter slot, shape (K,).
        n_colours: Colours, and towers.
        n_sizes: Sizes.
        pair: Objects in the cell and in the goal; None draws both from triangles.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self,
        fail: NDArray[np.float64],
        n_colours: int,
        n_sizes: int = 3,
        pair: tuple[int, int] | None = None,
    ) -> None:
        self.fail, self.pair = [float(p) for p in fail], pair
        self.k, self.c, self.s = len(fail), n_colours, n_sizes
        n_codes = n_colours * n_sizes + 1
        n_places = self.k * (1 + 2 * n_colours)
        self.action_space = spaces.Discrete(n_colours * (2 * self.k + n_colours))
        self.observation_space = spaces.Box(0.0, 1.0, (n_places * n_codes,), np.float32)
        self._one_hot = np.eye(n_codes, dtype=np.float32)
        self._apart = _attribute_distances(n_colours, n_sizes) * DISTANCE / self.k
        self._codes = np.zeros(n_places, dtype=np.int64)
        on_towers = self.k + self.k * n_colours
        # Views of the same codes: what is written to one is seen in the other.
        self.clutter = self._codes[: self.k]
        self.towers = self._codes[self.k : on_towers].reshape(n_colours, self.k)
        self.goal = self._codes[on_towers:].reshape(n_colours, self.k)
        self.heights = [0] * n_colours
        self.attempts = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Scatter new objects over the clutter and ask for some of them on the towers."""
        super().reset(seed=seed)
        rng = self.np_random
        n_objects, n_goal = self.pair or (0, 0)
        if not self.pair:
            n_objects = triangular(rng, self.k)
            n_goal = triangular(rng, n_objects)
        objects = rng.integers(1, self.c * self.s + 1, n_objects)
        self._codes[:] = 0
        self.heights = [0] * self.c
        self.clutter[rng.permutation(self.k)[:n_objects]] = objects
        for colour, codes in enumerate(self._by_colour(objects[:n_goal])):
            self.goal[colour, : len(codes)] = codes
        self.attempts = 0
        return self._obs(), {}

    def step(
        self, action: np.int64 | int
    ) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Try one move."""
        self.attempts += 1
        rew = MOVE + self._try(*self.positions(int(action)))
        rew += float(self._apart[self.towers, self.goal].sum())
        solved = np.array_equal(self.towers, self.goal)
        late = not solved and self.attempts >= HORIZON * self.k
        return self._obs(), rew + SUCCESS * solved, solved, late, {"success": solved}

    def positions(self, action: int) -> tuple[int, int]:
        """Return where a move picks and places: a clutter slot, or K + number of a tower."""
        k, c = self.k, self.c
        if action < k * c:
            return action // c, k + action % c
        if action < 2 * k * c:
            return k + (action - k * c) // k, (action - k * c) % k
        return k + (action - 2 * k * c) // c, k + (action - 2 * k * c) % c

    def _try(self, pick: int, place: int) -> float:
        """Carry a move out where it can be; return what it costs beyond a move."""
        if pick < self.k:
            return self._take_from_clutter(pick, place - self.k)
        tower = pick - self.k
        if not self.heights[tower]:
            return EMPTY
        if place == pick or (place < self.k and self.clutter[place]):
            return STUCK
        self.heights[tower] -= 1
        code = self.towers[tower, self.heights[tower]]
        self.towers[tower, self.heights[tower]] = 0
        if place < self.k:
            self.clutter[place] = code
            return BACK
        self._put_on_tower(code, place - self.k)
        return 0.0

    def _take_from_clutter(self, cell: int, tower: int) -> float:
        if not self.clutter[cell]:
            return EMPTY
        if self.np_random.random() < self.fail[cell]:
            return FAIL
        self._put_on_tower(self.clutter[cell], tower)
        self.clutter[cell] = 0
        return 0.0

    def _put_on_tower(self, code: np.int64, tower: int) -> None:
        self.towers[tower, self.heights[tower]] = code
        self.heights[tower] += 1

    def _by_colour(self, objects: NDArray[np.int64]) -> list[NDArray[np.int64]]:
        """Return the objects of each colour, the largest first."""
        colours = (objects - 1) // self.s
        return [np.sort(objects[colours == colour])[::-1] for colour in range(self.c)]

    def _obs(self) -> NDArray[np.float32]:
        return self._one_hot[self._codes].ravel()


def triangular(rng: np.random.Generator, most: int) -> int:
    """Draw 1..most from a triangle whose mode is ``most``: ``k`` has ``(2 k - 1) / most^2``."""
    return max(1, int(np.ceil(rng.triangular(0.0, most, most))))


def _attribute_distances(n_colours: int, n_sizes: int) -> NDArray[np.float64]:
    """Return how far two codes are apart: half for the colour, half for the size, (n, n)."""
    codes = np.arange(n_colours * n_sizes)
    colour, size = codes // n_sizes, codes % n_sizes
    apart = np.ones((codes.size + 1,) * 2)
    apart[0, 0] = 0.0
    apart[1:, 1:] = 0.5 * (colour[:, None] != colour) + 0.5 * (size[:, None] != size)
    return apart
