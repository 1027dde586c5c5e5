"""A person at work, seen by a camera: what the tests of key-points and tracker share."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from app.sim.cells.cell import Cell, load_cell
from app.sim.perception.keypoints import keypoints_of
from tests.sim.reaching_person import ReachingPerson

CELL = load_cell()
RATE_HZ = 30.0


@lru_cache(maxsize=8)
def cell_of(percentile: float) -> Cell:
    """The cell with a worker of a percentile of stature, arms and shoulders."""
    sizes = dict.fromkeys(("stature", "arms", "shoulders"), percentile)
    worker = CELL.workers[0].model_copy(update=sizes)
    return CELL.model_copy(update={"people": (worker,)})


@lru_cache(maxsize=16)
def work(
    seed: int, seconds: float, percentile: float = 50.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], joint positions and speeds of the work cycle at 30 Hz."""
    cell = CELL if percentile == 50.0 else cell_of(percentile)
    cycle, times = ReachingPerson(cell, seed), np.arange(round(seconds * RATE_HZ) + 1) / RATE_HZ
    q, qd = zip(*(cycle.at(t) for t in times), strict=True)
    return times, np.array(q), np.array(qd)


def motion(
    seed: int, seconds: float, percentile: float = 50.0
) -> Callable[[float], np.ndarray]:
    """The same as a function of time, linear between the samples."""
    times, q, _ = work(seed, seconds, percentile)

    def at(t: float) -> np.ndarray:
        k = min(int(t * RATE_HZ + 1e-9), len(times) - 2)
        part = t * RATE_HZ - k
        return (1.0 - part) * q[k] + part * q[k + 1]

    return at


def seen(q: np.ndarray) -> np.ndarray:
    """Exact key-points of a posture [m], shape (25, 3)."""
    return keypoints_of(q, CELL.body, CELL.floor_z)
