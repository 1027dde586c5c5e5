"""The library a worker's motion is put together from: node postures and task primitives.

A person goes from place to place (stations, cubes first; the last place is home), each leg with
one hand. At its ends stand *node postures*, drawn beforehand for people of several sizes. In
between, joint positions follow weights, ``q(z) = W phi(z)``: a sample ``W_s`` of the leg's
primitive, conditioned exactly on both nodes by Matheron's rule,

    W = W_s + K (ends - A W_s),   K = Sigma A^T (A Sigma A^T)^-1,

with A the rows of all joints at z = 0 and z = 1. The kernels do that; here are samples, gains,
nodes and durations, as arrays. A leg of a cell that is not shipped takes the primitive of the
same kind whose places are nearest; its own nodes do the rest.

Sigma in K is that of the demonstrations with a floor of GAIN_FLOOR, more than the primitive's
own: 60 demonstrations say little about how 36 numbers at the ends go with the rest, and what
they seem to say by chance would swing the joints of a person who is unlike them. Measured on
4000 random legs between nodes, 80 demonstrations, floors of 0.01 and 0.06: largest |K| 3.4 and
1.25; palm's path over straight distance, 99 %, 1.36 and 1.36, greatest 1.96 and 1.66; legs that
leave joint limits by more than 1 mrad 0.05 % and none.

Source: METHOD 3.4; ``promp.py``, ``sampling.py``.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell, lacks_stations
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import MEDIAN, BodySize, percentile_body
from app.sim.primitives import promp
from app.sim.primitives.demonstrations import draw_keyframe
from app.sim.primitives.library_file import (
    HANDS,
    HOME,
    TaskPrimitive,
    place_of,
    primitive_for,
    segments_of,
)
from app.sim.primitives.sampling import GRID, sample
from app.sim.primitives.via_points import points_of

Index = NDArray[np.int64]

BODIES = (
    (50.0, 50.0, 50.0),
    (5.0, 40.0, 60.0),
    (25.0, 80.0, 20.0),
    (40.0, 15.0, 85.0),
    (70.0, 90.0, 65.0),
    (95.0, 60.0, 35.0),
)
"""People of the library by default: percentiles of stature, arms and shoulders."""
VARIANTS = 10
"""Node postures for each person, place and hand."""
GAIN_FLOOR = 0.05
"""Standard deviation of the floor of the Sigma of which K is made [m, rad]."""
ROUNDS = 10
"""Rounds of draws in which samples inside the limits are looked for."""
N_SAMPLES = 24
"""Samples of each primitive and direction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionLibrary:
    """What a worker's motion in one cell is put together from; arrays are read-only."""

    postures: Vec
    """Node postures [m, rad], shape (n, 18)."""
    hands: Vec
    """Their palms, right then left [m], shape (n, 2, 3)."""
    of_station: Index
    """First node and count of each person, place and hand, (n_bodies, n_places + 1, 2, 2)."""
    n_stations: int
    """Number of stations, cubes first; the place after them is home."""
    n_cubes: int
    """Number of cubes."""
    bodies: Vec
    """The people's sizes as kernels take them [m], shape (n_bodies, 12)."""
    samples: Vec
    """Weights drawn from the primitives [m, rad], shape (n_samples, 18, 12)."""
    gain: Vec
    """K of each primitive, shape (n_primitives, 216, 36): rows weights joint by joint, columns
    18 joints at z = 0, then at z = 1."""
    legs: Index
    """Primitive, first sample and number of samples of each leg (from, to, hand), shape
    (n_places + 1, n_places + 1, 2, 3); primitive -1: there is no such leg."""
    duration: Vec
    """Mean and standard deviation of the log of a leg's duration [s], (n_primitives, 2)."""


def people_sizes(
    cell: Cell, percentiles: tuple[tuple[float, float, float], ...] = BODIES
) -> tuple[BodySize, ...]:
    """Return people of given percentiles, standing as a cell's worker does.

    Args:
        cell: Work cell with a worker.
        percentiles: Of stature, arms and shoulders, one row for each person.
    """
    return tuple(percentile_body(*row, cell.human.pelvis_height) for row in percentiles)


@lru_cache(maxsize=8)
def motion_library(
    cell: Cell,
    seed: int,
    bodies: tuple[BodySize, ...] | None = None,
    n_samples: int = N_SAMPLES,
    augmentation: bool = True,
    variants: int = VARIANTS,
) -> MotionLibrary:
    """Put a cell's library together.

    Args:
        cell: Work cell with a worker.
        seed: Seed of nodes and samples.
        bodies: The people's sizes; None for those of BODIES.
        n_samples: Samples of each primitive and direction.
        augmentation: Whether samples are drawn from the primitives, and durations spread; if
            not, the samples are the demonstrations as they are, and durations their mean.
        variants: Nodes for each person, place and hand.

    Raises:
        InvalidInput: The cell has no cube or no dock, so there is no task.
        NotFound: Nobody works in the cell.
    """
    if (lack := lacks_stations(cell)) is not None:
        raise InvalidInput("cell", cell.name, f"has no tasks for a worker: it {lack}")
    sizes = people_sizes(cell) if bodies is None else bodies
    vectors = np.array([size.vector(cell.floor_z) for size in sizes])
    rng = np.random.default_rng(seed)
    postures, hands, of_station = _nodes(cell, vectors, variants, rng)
    samples, gains, legs, duration = _legs(cell, n_samples, augmentation, rng)
    for array in (postures, hands, of_station, vectors, samples, gains, legs, duration):
        array.setflags(write=False)
    return MotionLibrary(
        postures=postures,
        hands=hands,
        of_station=of_station,
        n_stations=len(cell.pick_stations),
        n_cubes=len(cell.stations_of("cube")),
        bodies=vectors,
        samples=samples,
        gain=gains,
        legs=legs,
        duration=duration,
    )


def _nodes(
    cell: Cell, bodies: Vec, variants: int, rng: np.random.Generator
) -> tuple[Vec, Vec, Index]:
    """Draw the node postures: their joints, their palms, and where each place's begin."""
    points = [place_of(cell, station.id) for station in cell.pick_stations]
    of_station = np.zeros((len(bodies), len(points) + 1, 2, 2), dtype=np.int64)
    postures: list[Vec] = []
    hands: list[Vec] = []
    for person, size in enumerate(bodies):
        for place, point in enumerate([*points, None]):
            for column, hand in enumerate(HANDS):
                of_station[person, place, column] = len(postures), variants
                if point is None and column == 1:  # at home no hand works
                    of_station[person, place, column] = of_station[person, place, 0]
                    continue
                for _ in range(variants):
                    node = draw_keyframe(cell, size, point, hand, rng)
                    postures.append(node.q)
                    hands.append(_palms(node.q, size))
    return np.array(postures), np.array(hands), of_station


def _palms(q: Vec, size: Vec) -> Vec:
    points = human.joint_points(q, size)
    return np.stack([points["hand_r"], points["hand_l"]])


def _legs(
    cell: Cell, n_samples: int, augmentation: bool, rng: np.random.Generator
) -> tuple[Vec, Vec, Index, Vec]:
    """Return samples, gains, the table of legs, and the logs of the durations."""
    order = {station.id: i for i, station in enumerate(cell.pick_stations)}
    order[HOME] = n_places = len(order)
    legs = np.full((n_places + 1, n_places + 1, 2, 3), -1, dtype=np.int64)
    samples: list[Vec] = []
    gains: list[Vec] = []
    durations: list[tuple[float, float]] = []
    first = 0
    for leg in segments_of(cell):
        found = primitive_for(cell, leg)
        logs = np.log(found.durations)
        some = draw_samples(found, 2 * n_samples, rng) if augmentation else found.weights
        n = n_samples if augmentation else len(some)
        spread = float(logs.std(ddof=1)) if augmentation else 0.0
        start, end, column = order[leg.start], order[leg.end], HANDS.index(leg.hand)
        for way, known, drawn in (
            ((start, end), found.weights, some[:n]),
            ((end, start), found.weights[..., ::-1], some[-n:, :, ::-1]),
        ):
            legs[(*way, column)] = len(gains), first, n
            samples.append(drawn)
            gains.append(promp.gain_of_ends(known, GAIN_FLOOR))
            durations.append((float(logs.mean()), spread))
            first += n
    return np.concatenate(samples), np.array(gains), legs, np.array(durations)


def draw_samples(found: TaskPrimitive, n: int, rng: np.random.Generator) -> Vec:
    """Draw weights that keep the joint limits, shape (n, 18, n_basis).

    Draws beyond the limits are rejected, as by ``sampling.sample``; what is missing after some
    rounds is left to that.

    Args:
        found: Primitive.
        n: Number of draws.
        rng: Source of chance.
    """
    phi = promp.basis(GRID, promp.N_BASIS, promp.usual_width(promp.N_BASIS))
    kept: list[Vec] = []
    for _ in range(ROUNDS):
        drawn = promp.draw_like(found.weights, n, rng)
        q = phi @ np.swapaxes(drawn, 1, 2)
        inside = ((q >= human.Q_MIN) & (q <= human.Q_MAX)).all(axis=(1, 2))
        kept.extend(drawn[inside])
        if len(kept) >= n:
            return np.array(kept[:n])
    points = points_of(MEDIAN.vector(0.0))  # no via points, so nobody's size matters
    rest = sample(found.primitive(), n - len(kept), rng, points)
    return np.array([*kept, *rest])


def segment_weights(library: MotionLibrary, primitive: int, sample: int, ends: Vec) -> Vec:
    """Return the weights of one leg between two nodes, as the kernels make them, (18, 12).

    Args:
        library: Library.
        primitive: Number of the primitive.
        sample: Number of the sample.
        ends: Joint positions at both ends [m, rad], shape (2, 18).
    """
    drawn = library.samples[sample]
    phi = promp.basis(np.array([0.0, 1.0]), promp.N_BASIS, promp.usual_width(promp.N_BASIS))
    missing = (ends - phi @ drawn.T).ravel()
    return np.asarray(drawn + (library.gain[primitive] @ missing).reshape(drawn.shape))
