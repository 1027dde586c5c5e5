"""A person of the first, synthetic reaches at any time: what tests of trackers look at."""

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.core.kernels import rng as random
from app.sim.people.reach_script import ReachScript, build_reach_library
from app.sim.primitives.kernels import script


class ReachingPerson:
    """A person who works on and on; scripts follow one another without a jump.

    Args:
        cell: Work cell.
        seed: Seed of library and scripts.
    """

    def __init__(self, cell: Cell, seed: int) -> None:
        self._library = build_reach_library(cell, seed)
        self._seed = seed
        self._block = 0
        self._begin = 0.0
        self._script, self._last = self._draw(-1)

    def _draw(self, first: int) -> tuple[ReachScript, int]:
        state = np.zeros(1, dtype=np.uint64)
        random.start_stream(self._seed, 0, self._block, state)
        moves = script.Moves(
            np.zeros(script.MAX_MOVES),
            np.ones(script.MAX_MOVES),
            np.zeros(script.MAX_MOVES + 1, dtype=np.int64),
        )
        start, duration, chosen = moves
        library = self._library
        n = script.draw_script(
            state, library.of_station[0], library.n_cubes, library.hands, first, moves
        )
        postures = library.postures[chosen[: n + 1]]
        self._end = float(start[n - 1] + duration[n - 1])
        return ReachScript(start[:n], duration[:n], postures), int(chosen[n])

    def at(self, t: float) -> tuple[Vec, Vec]:
        """Return joint positions [m, rad] and speeds [m/s, rad/s], (18,) each.

        Args:
            t: Time [s]; must not go back beyond the script it is in.
        """
        while t - self._begin > self._end:
            self._begin += self._end
            self._block += 1
            self._script, self._last = self._draw(self._last)
        return self._script.at(t - self._begin)
