"""Sorting policies without learning, for tests of what a policy drives."""

import numpy as np
from numpy.typing import NDArray

from app.sim.sorting.state import Move, SortingShape


class FixedValues:
    """Values its favourite moves above all others, the first one most, whatever the state."""

    checkpoint = "c0" * 32
    title = "favourite moves"
    cell = "sorting-e0"
    cell_sha256 = "0" * 64

    def __init__(self, shape: SortingShape, favourites: list[Move]) -> None:
        self.shape = shape
        self._q = np.zeros(shape.n_actions, dtype=np.float32)
        for rank, move in enumerate(favourites):
            self._q[shape.action_of(move)] = 10.0 - rank

    def values(self, obs: NDArray[np.uint8]) -> NDArray[np.float32]:
        return np.tile(self._q, (len(obs), 1))
