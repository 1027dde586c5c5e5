"""Make the shipped task primitives anew; run ``python -m tools.make_primitives``.

For each leg of each shipped cell with a worker and pick stations, N_DEMONSTRATIONS motions are
demonstrated (``demonstrations.py``): the styles in turn, and people whose stature, arms and
shoulders are drawn between the 5th and the 95th percentile, stature in even strata. Each leg
has a random stream of its own, so that one can be made again alone. All take three quarters of
a minute on one core.

The result is committed as ``primitives_data/task_primitives.npz``;
``tests/tools/test_make_primitives.py`` makes one leg again and compares.
"""

import logging

import numpy as np

from app.sim.cells.cell import Cell, cell_names, load_cell
from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import percentile_body
from app.sim.primitives import promp
from app.sim.primitives.demonstrations import PHASES, STYLES, demonstrate
from app.sim.primitives.library_file import (
    FILE,
    HANDS,
    Leg,
    TaskPrimitive,
    place_of,
    segments_of,
    write_primitives,
)

logger = logging.getLogger(__name__)

VERSION = 1
"""Of this script; to be raised whenever it makes other numbers."""
SEED = 4
"""Of all streams."""
N_DEMONSTRATIONS = 60
"""Demonstrations of each leg, the styles in turn."""
PERCENTILES = (5.0, 95.0)
"""Range of people's percentiles."""


def make_primitive(cell: Cell, leg: Leg, n: int = N_DEMONSTRATIONS) -> TaskPrimitive:
    """Demonstrate one leg of a cell and return its weights.

    Args:
        cell: Work cell with a worker.
        leg: One of its legs.
        n: Number of demonstrations.
    """
    name = f"{cell.name}/{leg.start}/{leg.end}".encode()
    rng = np.random.default_rng([SEED, HANDS.index(leg.hand), *name])
    ends = place_of(cell, leg.start), place_of(cell, leg.end)
    motions = [
        demonstrate(cell, size, ends, leg.hand, STYLES[i % len(STYLES)], rng)
        for i, size in enumerate(draw_people(cell, n, rng))
    ]
    durations = np.array([one.duration_s for one in motions])
    phi = promp.basis(PHASES, promp.N_BASIS, promp.usual_width(promp.N_BASIS))
    weights = np.array([promp.weights_of(one.q, phi) for one in motions])
    left = np.array([one.q for one in motions]) - phi @ np.swapaxes(weights, 1, 2)
    return TaskPrimitive(
        cell=cell.name,
        leg=leg,
        weights=weights,
        durations=durations,
        residual=np.sqrt(np.mean(left**2, axis=(0, 1))),
    )


def draw_people(cell: Cell, n: int, rng: np.random.Generator) -> list[Vec]:
    """Draw people of many sizes, each as kernels take it [m], shape (12,)."""
    low, high = PERCENTILES
    strata = (rng.permutation(n) + rng.uniform(0.0, 1.0, n)) / n
    height = cell.human.pelvis_height
    people = []
    for stratum in strata:
        stature, (arms, shoulders) = low + (high - low) * stratum, rng.uniform(low, high, 2)
        size = percentile_body(float(stature), float(arms), float(shoulders), height)
        people.append(size.vector(cell.floor_z))
    return people


def main() -> None:
    """Demonstrate every leg of the shipped cells and write the data file."""
    made = []
    for cell in map(load_cell, cell_names()):
        for leg in segments_of(cell):
            made.append(make_primitive(cell, leg))
            logger.info("%s: %s to %s, %s", cell.name, leg.start, leg.end, leg.hand)
    about = {
        "made_by": "python -m tools.make_primitives",
        "version": VERSION,
        "seed": SEED,
        "demonstrations": N_DEMONSTRATIONS,
        "styles": [style.name for style in STYLES],
        "percentiles": {name: list(PERCENTILES) for name in ("stature", "arms", "shoulders")},
        "basis": {"n": promp.N_BASIS, "ridge": promp.RIDGE},
    }
    write_primitives(FILE, made, about)
    logger.info("%d primitives, %.1f MB", len(made), FILE.stat().st_size / 1e6)


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    main()
