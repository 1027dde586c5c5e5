"""Episodes of every pair (K_E, K_G): numbers of objects, and of objects in the goal.

Source: docs/method.md 1.5.
"""

from collections.abc import Iterator

import numpy as np

from app.policies.evaluation.sorting.episodes import ENDLESS, Index
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import SortingBatch, SortingSettings
from app.sim.sorting.state import SortingShape

CHUNK = 4000
"""Maximum number of environments of a batch."""
SMALL = 10
"""Maximum number of clutter slots of the smaller task."""


def pairs_of(shape: SortingShape) -> Index:
    """Return every (K_E, K_G), shape (K (K + 1) / 2, 2)."""
    k = shape.n_cells
    return np.array([(n, g) for n in range(1, k + 1) for g in range(1, n + 1)])


def grid_batches(
    shape: SortingShape, fail: Vec, per_pair: int, seed: int, disturbed: float
) -> Iterator[SortingBatch]:
    """Yield batches with ``per_pair`` episodes of every pair, in the order of the pairs."""
    pairs = np.repeat(pairs_of(shape), per_pair, axis=0)
    settings = SortingSettings(horizon_factor=ENDLESS, disturbed_share=disturbed)
    for first in range(0, len(pairs), CHUNK):
        part = pairs[first : first + CHUNK]
        batch = SortingBatch(shape, fail, len(part), seed, settings, first_env=first)
        batch.rows.fixed_objects[:], batch.rows.fixed_goal[:] = part.T
        batch.reset()
        yield batch
