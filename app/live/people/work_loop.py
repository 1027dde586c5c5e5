"""Continuous work of one person: random scripts of task primitives.

Segments, keyframes and phase profiles are those of training
(``primitives/kernels/primitives.py``); each script starts from the last posture of the previous
one.

Source: docs/method.md 3.2 and 3.4.
"""

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.core.kernels import rng as random
from app.sim.human.anthropometry import BodySize
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.people.kernels.motion import draw_script_of, worker_at
from app.sim.primitives.kernels.script import draw_pause
from app.sim.primitives.primitive_library import VARIANTS
from app.sim.scene.scene import new_people_state, people_of, with_people


class WorkLoop:
    """Joint positions and speeds of a working person at any time.

    Args:
        cell: Work cell with one worker.
        seed: Seed of postures, samples and scripts.
        size: Body dimensions; None: those of the worker of the cell.
        variants: Keyframes per place and hand; fewer are generated faster.
    """

    def __init__(
        self, cell: Cell, seed: int, size: BodySize | None = None, variants: int = VARIANTS
    ) -> None:
        self.arguments = (cell, seed, size, variants)
        """What it was made of."""
        self._alone, self._seed = with_people(cell, ("worker",)), seed
        work = HumanMotionConfig(
            seed=seed, bodies=(size or cell.human.size,), variants=variants
        )
        self._people = people_of(self._alone, work)
        self._away = np.empty(36)
        self.restart()

    def restart(self) -> None:
        """Begin again with the first script, at time 0."""
        self._state = new_people_state(self._alone, self._people, 1)
        self._block, self._begin = 0, 0.0
        self._end = self._draw(-1)

    def _draw(self, first: int) -> float:
        """Draw the next script from keyframe ``first``; return its end [s]."""
        people, state, rng = self._people, self._state, np.zeros(1, dtype=np.uint64)
        random.start_stream(self._seed, 0, self._block, rng)
        draw_script_of(people, state, 0, 0, 0, first, rng)
        start, duration = state.start[0, 0], state.duration[0, 0]
        last = state.n_moves[0, 0] - 1
        whole = float(start[last] + duration[last] + state.segments.stop[0, 0, last, 1])
        return whole + draw_pause(rng, True)

    def at(self, t: float) -> tuple[Vec, Vec]:
        """Return joint positions [m, rad] and speeds [m/s, rad/s], (18,) each.

        Args:
            t: Time [s]; not before the start of the present script.
        """
        state = self._state
        while t - self._begin > self._end:
            self._begin += self._end
            self._block += 1
            self._end = self._draw(int(state.chosen[0, 0, state.n_moves[0, 0]]))
        state.move[0, 0] = 0
        worker_at(self._people, state, 0, 0, t - self._begin, 1.0, self._away)
        return state.q[0, 0].copy(), state.qd[0, 0].copy()
