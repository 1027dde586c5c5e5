"""Primitive library of a worker: keyframe postures and samples of task primitives.

A worker moves between places (stations, cubes first, home last) in segments, each with one
hand. Both ends of a segment are *keyframe postures*, drawn beforehand for several body sizes.
Between them the joint positions are ``q(z) = W phi(z)``: a sample ``W_s`` of the segment's
primitive, conditioned exactly on both keyframes by Matheron's rule,

    W = W_s + K (ends - A W_s),   K = Sigma A^T (A Sigma A^T)^-1,

with A the rows of all joints at z = 0 and z = 1. Kernels apply the rule; this module computes
samples, gains, keyframes and durations. A segment of a cell that is not shipped uses the
primitive of the same kind with the nearest places, between its own keyframes.

Sigma in K has a floor of GAIN_FLOOR, above the primitive's own: 60 demonstrations determine the
correlations with the 36 end values poorly, and spurious correlations would swing the joints of
other bodies. With floors of 0.01, 0.05 and 0.06 the largest |K| of the shipped primitives is
4.02, 1.24 and 1.19.

Source: docs/method.md 3.4; ``promp.py``.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from app.errors import InvalidInput
from app.sim.cells.cell import Cell, lacks_stations
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import BodySize, percentile_body
from app.sim.primitives import promp
from app.sim.primitives.kernels.primitives import N_BASIS
from app.sim.primitives.keyframes import Index, PostureLibrary, draw_keyframe, draw_postures
from app.sim.primitives.library_file import (
    HOME,
    TaskPrimitive,
    primitive_for,
    segments_of,
)

BODIES = (
    (50.0, 50.0, 50.0),
    (5.0, 40.0, 60.0),
    (25.0, 80.0, 20.0),
    (40.0, 15.0, 85.0),
    (70.0, 90.0, 65.0),
    (95.0, 60.0, 35.0),
)
"""Default bodies: percentiles of stature, arm length and shoulder width."""
VARIANTS = 10
"""Keyframe postures per body, place and hand."""
GAIN_FLOOR = 0.05
"""Standard deviation of the floor of Sigma in K [m, rad]."""
GRID = np.linspace(0.0, 1.0, 121)
"""Phases at which joint limits are checked."""
ROUNDS = 10
"""Largest number of rounds of rejection sampling."""
N_SAMPLES = 24
"""Samples per primitive and direction."""
LIBRARIES = 32
"""Libraries kept: up to four people in a live cell have 20 places and seeds, and any sizes. One
has up to 8 MB."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionLibrary:
    """Keyframes and primitive samples of one cell; arrays are read-only."""

    keyframes: PostureLibrary
    """Keyframe postures."""
    bodies: Vec
    """Sizes of the bodies [m], shape (n_bodies, 12)."""
    samples: Vec
    """Weights drawn from the primitives [m, rad], shape (n_samples, 18, 12)."""
    gain: Vec
    """K of each primitive, shape (n_primitives, 216, 36): rows are weights, joint by joint;
    columns are the 18 joints at z = 0, then at z = 1."""
    segments: Index
    """Primitive, first sample and number of samples of each segment (from, to, hand), shape
    (n_places + 1, n_places + 1, 2, 3); primitive -1: there is no such segment."""
    duration: Vec
    """Mean and standard deviation of the log of a segment's duration [s], (n_primitives, 2)."""


def people_sizes(cell: Cell) -> tuple[BodySize, ...]:
    """Return body sizes of the percentiles BODIES with the pelvis height of a cell's worker."""
    return tuple(percentile_body(*row, cell.human.pelvis_height) for row in BODIES)


@lru_cache(LIBRARIES)
def motion_library(
    cell: Cell,
    seed: int,
    bodies: tuple[BodySize, ...] | None = None,
    n_samples: int = N_SAMPLES,
    augmentation: bool = True,
    variants: int = VARIANTS,
) -> MotionLibrary:
    """Build the motion library of a cell.

    Args:
        cell: Work cell with a worker.
        seed: Seed of keyframes and samples.
        bodies: Body sizes; None for BODIES.
        n_samples: Samples per primitive and direction.
        augmentation: Draw samples from the primitives and vary durations; otherwise the samples
            are the demonstrations, with their mean duration.
        variants: Keyframes per body, place and hand.

    Raises:
        InvalidInput: The cell has no cube or no dock.
        NotFound: The cell has no worker.
    """
    if (lack := lacks_stations(cell)) is not None:
        raise InvalidInput("cell", cell.name, f"has no tasks for a worker: it {lack}")
    sizes = people_sizes(cell) if bodies is None else bodies
    vectors = np.array([size.vector(cell.floor_z) for size in sizes])
    rng = np.random.default_rng(seed)

    def draw(size: Vec, point: Vec | None, hand: human.Hand) -> Vec:
        return draw_keyframe(cell, size, point, hand, rng).q

    keyframes = draw_postures(cell, vectors, variants, draw)
    samples, gains, segments, duration = _segments(cell, n_samples, augmentation, rng)
    for array in (vectors, samples, gains, segments, duration):
        array.setflags(write=False)
    return MotionLibrary(
        keyframes=keyframes,
        bodies=vectors,
        samples=samples,
        gain=gains,
        segments=segments,
        duration=duration,
    )


def _segments(
    cell: Cell, n_samples: int, augmentation: bool, rng: np.random.Generator
) -> tuple[Vec, Vec, Index, Vec]:
    """Return samples, gains, the table of segments, and moments of the log durations."""
    order = {station.id: i for i, station in enumerate(cell.pick_stations)}
    order[HOME] = n_places = len(order)
    segments = np.full((n_places + 1, n_places + 1, 2, 3), -1, dtype=np.int64)
    samples: list[Vec] = []
    gains: list[Vec] = []
    durations: list[tuple[float, float]] = []
    first = 0
    for segment in segments_of(cell):
        found = primitive_for(cell, segment)
        logs = np.log(found.durations)
        some = draw_samples(found, 2 * n_samples, rng) if augmentation else found.weights
        n = n_samples if augmentation else len(some)
        spread = float(logs.std(ddof=1)) if augmentation else 0.0
        start, end = order[segment.start], order[segment.end]
        column = human.HANDS.index(segment.hand)
        for ends, known, drawn in (
            ((start, end), found.weights, some[:n]),
            ((end, start), found.weights[..., ::-1], some[-n:, :, ::-1]),
        ):
            segments[(*ends, column)] = len(gains), first, n
            samples.append(drawn)
            gains.append(promp.gain_of_ends(known, GAIN_FLOOR))
            durations.append((float(logs.mean()), spread))
            first += n
    return np.concatenate(samples), np.array(gains), segments, np.array(durations)


def draw_samples(found: TaskPrimitive, n: int, rng: np.random.Generator) -> Vec:
    """Draw weights within the joint limits, shape (n, 18, n_basis).

    Draws beyond the limits are rejected. Those missing after ROUNDS, of no shipped primitive,
    are demonstrations.
    """
    phi = promp.basis(GRID, N_BASIS, promp.usual_width(N_BASIS))
    kept: list[Vec] = []
    for _ in range(ROUNDS):
        drawn = promp.draw_like(found.weights, n, rng)
        q = phi @ np.swapaxes(drawn, 1, 2)
        inside = ((q >= human.Q_MIN) & (q <= human.Q_MAX)).all(axis=(1, 2))
        kept.extend(drawn[inside])
        if len(kept) >= n:
            break
    kept.extend(found.weights[k % len(found.weights)] for k in range(len(kept), n))
    return np.array(kept[:n])
