"""Generate the shipped task primitives: ``python -m tools.make_primitives``.

For each segment of each shipped cell with a worker and pick stations, N_DEMONSTRATIONS motions
are generated (``demonstrations.py``): the styles in turn, and people whose stature, arms and
shoulders are drawn between the 5th and the 95th percentile, stature in even strata. Each
segment has its own random stream, so that it can be generated alone. The whole takes 45 s on
one core.

``--elbow-spread`` varies the elbow of the working arm at the same palm path (thesis 5.3.3,
``augmentation.py``); the shipped primitives use 0, since their styles vary the elbow already.

The result is committed as ``app/sim/primitives/data/task_primitives.npz``;
``tests/tools/test_make_primitives.py`` generates one segment again and compares.
"""

import argparse
import json
import logging
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from app.sim.cells.cell import Cell, cell_names, load_cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.primitives import promp
from app.sim.primitives.kernels.primitives import N_BASIS
from app.sim.primitives.keyframes import STYLES
from app.sim.primitives.library_file import (
    FILE,
    TaskPrimitive,
    TaskSegment,
    place_of,
    segments_of,
)
from tools.augmentation import draw_swivel, vary_elbow
from tools.demonstrations import PHASES, demonstrate

logger = logging.getLogger(__name__)

VERSION = 1
"""Of this script; to be raised whenever it makes other numbers."""
SEED = 4
"""Of all streams."""
N_DEMONSTRATIONS = 60
"""Demonstrations of each segment, the styles in turn."""
PERCENTILES = (5.0, 95.0)
"""Range of people's percentiles."""


def make_primitive(
    cell: Cell, segment: TaskSegment, n: int = N_DEMONSTRATIONS, elbow_spread: float = 0.0
) -> TaskPrimitive:
    """Demonstrate one segment of a cell and return its weights.

    Args:
        cell: Work cell with a worker.
        segment: One of its segments.
        n: Number of demonstrations.
        elbow_spread: Standard deviation of the added swivel of the working arm [rad].
    """
    name = f"{cell.name}/{segment.start}/{segment.end}".encode()
    rng = np.random.default_rng([SEED, human.HANDS.index(segment.hand), *name])
    ends = place_of(cell, segment.start), place_of(cell, segment.end)
    motions, paths = [], []
    for i, size in enumerate(draw_people(cell, n, rng)):
        motion = demonstrate(cell, size, ends, segment.hand, STYLES[i % len(STYLES)], rng)
        q = motion.q
        if elbow_spread > 0.0:
            swivel = draw_swivel(len(q), rng, elbow_spread)
            q = vary_elbow(q, segment.hand, swivel, partial(human.joint_points, size=size))
        motions.append(motion)
        paths.append(q)
    durations = np.array([one.duration_s for one in motions])
    phi = promp.basis(PHASES, N_BASIS, promp.usual_width(N_BASIS))
    weights = np.array([promp.weights_of(q, phi) for q in paths])
    left = np.array(paths) - phi @ np.swapaxes(weights, 1, 2)
    return TaskPrimitive(
        cell=cell.name,
        segment=segment,
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


def write_primitives(path: Path, made: Sequence[TaskPrimitive], about: dict[str, Any]) -> None:
    """Write primitives to a file.

    Args:
        path: File to write.
        made: Primitives with equal numbers of demonstrations.
        about: Additional members of the header, as JSON data.
    """
    tasks = [
        {
            "cell": one.cell,
            "kind": one.segment.kind,
            "start": one.segment.start,
            "end": one.segment.end,
            "hand": one.segment.hand,
        }
        for one in made
    ]
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(
        path,
        header=np.array(json.dumps({**about, "tasks": tasks})),
        weights=np.array([one.weights for one in made], dtype=np.float32),
        durations=np.array([one.durations for one in made], dtype=np.float32),
        residual=np.array([one.residual for one in made], dtype=np.float32),
    )


def main() -> None:
    """Generate the primitives of all segments of the shipped cells and write the data file."""
    parser = argparse.ArgumentParser(description="Generate the shipped task primitives.")
    parser.add_argument(
        "--elbow-spread", type=float, default=0.0, help="swivel of the elbow, std. dev. [rad]"
    )
    elbow_spread = parser.parse_args().elbow_spread
    made = []
    for cell in map(load_cell, cell_names()):
        for segment in segments_of(cell):
            made.append(make_primitive(cell, segment, elbow_spread=elbow_spread))
            logger.info("%s: %s to %s, %s", cell.name, segment.start, segment.end, segment.hand)
    about = {
        "made_by": "python -m tools.make_primitives",
        "version": VERSION,
        "seed": SEED,
        "demonstrations": N_DEMONSTRATIONS,
        **({"elbow_spread": elbow_spread} if elbow_spread else {}),
        "styles": [style.name for style in STYLES],
        "percentiles": {name: list(PERCENTILES) for name in ("stature", "arms", "shoulders")},
        "basis": {"n": N_BASIS, "ridge": promp.RIDGE},
    }
    write_primitives(FILE, made, about)
    logger.info("%d primitives, %.1f MB", len(made), FILE.stat().st_size / 1e6)


if __name__ == "__main__":
    logging.basicConfig(level=logging.INFO, format="%(message)s")
    main()
