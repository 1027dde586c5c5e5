"""Configuration of the workers' motion, body sizes and yielding, and its data for the kernels.

Sources of motion: ``library``, movement primitives (``primitive_library.py``), the default;
``reaches``, synthetic reaches (``reach_script.py``); ``recorded``, imported recordings
(``mocap/importer.py``), placed in the cell. A share of the workers may show off-task motion
instead (``off_task_motion.py``).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import BodySize
from app.sim.mocap.importer import Motion, placed
from app.sim.people.kernels import people
from app.sim.people.kernels.people import People, Tracks
from app.sim.people.off_task_motion import roaming
from app.sim.people.reach_script import build_reach_library
from app.sim.primitives.kernels.primitives import PrimitiveLibrary
from app.sim.primitives.primitive_library import VARIANTS, motion_library

MotionSource = Literal["library", "reaches", "recorded"]
MOTIONS: tuple[MotionSource, ...] = ("library", "reaches", "recorded")
TRACK_DT = 0.02
"""Step to which recorded motion is brought [s]; 50 Hz, above what people's hands hold."""
NEEDED_S = 10.0
"""How long a track should go on after an episode's start: an evaluation's episode [s]."""
N_OFF_TASK = 24
"""Motions that off_task_recordings draw from, a minute each."""
NO_TRACKS = Tracks(np.zeros((1, 19)), np.array([[0, 1, -1]]), TRACK_DT, 0.0)
"""The tracks of workers who follow none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HumanMotionConfig:
    """What the workers of a cell do."""

    motion: MotionSource = "library"
    """Where their motion comes from."""
    seed: int = 0
    """Seed of their postures and of the samples of their primitives."""
    pace: float = 1.0
    """Speed relative to their scripts."""
    yielding: float = 0.0
    """How far they give way to the arm, from 0 (they do not see it) to 1."""
    roaming: float = 0.0
    """Share of the workers who roam instead of working, drawn each episode anew."""
    absent: float = 0.0
    """Share of the workers who are not there, drawn each episode anew."""
    bodies: tuple[BodySize, ...] | None = None
    """Sizes drawn from, each episode anew; None for those of the library
    (``motion_library.BODIES``), and in synthetic reaches for the cell's own person."""
    augmentation: bool = True
    """Whether primitives are sampled and varied (METHOD 3.4); if not, the library's
    demonstrations are replayed as they are."""
    variants: int = VARIANTS
    """Postures for each body, place and hand of the library."""
    recorded: tuple[Motion, ...] = ()
    """The runs drawn from, for ``recorded``, placed in the cell."""

    def __post_init__(self) -> None:
        if self.motion not in MOTIONS:
            raise InvalidInput("motion", self.motion, "must be a source of motion", MOTIONS)
        for name in ("yielding", "roaming", "absent"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InvalidInput(name, getattr(self, name), "must lie in [0, 1]")
        if not (np.isfinite(self.pace) and self.pace > 0.0):
            raise InvalidInput("pace", self.pace, "must be above 0")
        if self.bodies is not None and not self.bodies:
            raise InvalidInput("bodies", 0, "must hold at least one size, or be None")
        if self.motion == "recorded" and not self.recorded:
            raise InvalidInput("recorded", 0, "must hold at least one run of recorded motion")


USUAL = HumanMotionConfig()
"""The library's people."""
REACHING = HumanMotionConfig(motion="reaches")
"""The first people: synthetic reaches of the cell's own person."""


def with_human_motion(shared: People, cell: Cell, settings: HumanMotionConfig) -> People:
    """Return shared data of people whose workers do what the settings say.

    Args:
        shared: People who do nothing yet.
        cell: Work cell with at least one worker.
        settings: What they do.
    """
    shared = shared._replace(
        pace=settings.pace, yielding=settings.yielding, absent_share=settings.absent
    )
    if settings.motion == "recorded":
        tracks, lengths = tracks_of(settings.recorded, cell.floor_z)
        return shared._replace(tracks=tracks, track_share=1.0, bodies=lengths)
    if settings.roaming > 0.0:
        tracks, _ = tracks_of(off_task_recordings(cell, settings.seed), cell.floor_z)
        tracks.spans[:, 2] = -1  # Anybody may roam.
        shared = shared._replace(tracks=tracks, track_share=settings.roaming)
    if settings.motion == "library":
        return _with_library(shared, cell, settings)
    sizes = settings.bodies or (cell.human.size,)
    library = build_reach_library(cell, settings.seed, sizes)
    return shared._replace(
        source=people.REACHES,
        bodies=np.stack([size.vector(cell.floor_z) for size in sizes]),
        postures=np.array(library.postures),
        hands=np.array(library.hands),
        of_station=np.array(library.of_station),
        n_cubes=library.n_cubes,
    )


def _with_library(shared: People, cell: Cell, settings: HumanMotionConfig) -> People:
    library = motion_library(
        cell,
        settings.seed,
        settings.bodies,
        augmentation=settings.augmentation,
        variants=settings.variants,
    )
    # Copies: for read-only arrays the kernels would be compiled anew. Samples are read-only
    # everywhere, since they are large.
    return shared._replace(
        source=people.LIBRARY,
        bodies=np.array(library.bodies),
        postures=np.array(library.postures),
        hands=np.array(library.hands),
        of_station=np.array(library.of_station),
        n_cubes=library.n_cubes,
        primitive_library=PrimitiveLibrary(
            samples=np.ascontiguousarray(library.samples),
            gain=np.array(library.gain),
            segments=np.array(library.segments),
            duration=np.array(library.duration),
            varied=settings.augmentation,
        ),
    )


@lru_cache(maxsize=4)
def off_task_recordings(cell: Cell, seed: int) -> tuple[Motion, ...]:
    """Return the motions of a cell's off_task_recordings."""
    return roaming(cell, cell.human.size, seed, N_OFF_TASK)


def tracks_of(motions: Sequence[Motion], floor_z: float) -> tuple[Tracks, Vec]:
    """Return recorded runs as the kernels play them, and the sizes of who was recorded.

    Joints may leave the model's limits: the body is where it was recorded.

    Args:
        motions: Runs, placed in the cell (``motions.placed``).
        floor_z: Height of the cell's floor [m].

    Returns:
        Tracks, and sizes [m], shape (n_tracks, 12).
    """
    rows: list[Vec] = []
    spans: list[tuple[int, int, int]] = []
    first = 0
    for number, motion in enumerate(motions):
        # The last frame is kept; a hair more than a whole number of steps is that number.
        n = max(2, math.ceil(motion.times[-1] / TRACK_DT - 1e-6) + 1)
        at = np.minimum(np.arange(n) * TRACK_DT, motion.times[-1])
        values = np.column_stack([motion.q, motion.pelvis_z])
        rows.append(
            np.stack([np.interp(at, motion.times, column) for column in values.T], axis=1)
        )
        spans.append((first, n, number))
        first += n
    tracks = Tracks(
        np.ascontiguousarray(np.concatenate(rows)),
        np.array(spans, dtype=np.int64),
        TRACK_DT,
        NEEDED_S,
    )
    return tracks, np.stack([motion.size.vector(floor_z) for motion in motions])


def at_the_table(motion: Motion, cell: Cell) -> Motion:
    """Return a recorded run placed as if it had been made at the cell's table.

    The median of where the person looked is where the cell's worker looks; seen along the
    table, the median place is the worker's home; where the pelvis came nearest to the table is
    where a worker stands nearest to it.
    """
    home_x, _, yaw = cell.human.home
    start = float(motion.q[0, 2])
    turned = placed(motion, 0.0, 0.0, yaw + start - float(np.median(motion.q[:, 2])))
    x, y = turned.q[:, 0], turned.q[:, 1]
    return placed(
        turned,
        home_x + float(x[0] - np.median(x)),
        cell.human.y_min + float(y[0] - y.min()),
        float(turned.q[0, 2]),
    )
