"""Demonstrations of one task, from home to a cube with the right hand, on different paths."""

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.core.arrays import Vec
from app.sim.people.reach_script import build_reach_library
from app.sim.primitives.phase import min_jerk


def reaches(n: int = 20, seed: int = 5, hz: float = 60.0) -> tuple[list[Vec], Vec]:
    """Return n motions of unlike length, shape (T_i, 18), and their durations [s]."""
    rng = np.random.default_rng(seed)
    library = build_reach_library(load_cell(), seed, variants=n)
    home, cube = library.of_station[0, [-1, 1], 0, 0]
    motions, durations = [], rng.uniform(0.8, 1.8, n)
    for i, duration in enumerate(durations):
        x = np.linspace(0.0, 1.0, int(duration * hz) + 1)
        first, last = library.postures[home + i], library.postures[cube + i]
        motion = first + min_jerk(x)[:, None] * (last - first)
        # The elbow leads: it bends more on the way than at either end.
        motion[:, 13] += rng.uniform(0.1, 0.4) * np.sin(np.pi * x) ** 2
        motions.append(motion)
    return motions, durations
