"""Configuration of the workers' motion, body sizes and yielding, and its data for the kernels.

Sources of motion: ``library``, movement primitives (``primitive_library.py``), the default;
``reaches``, synthetic reaches (``reach_script.py``); ``recorded``, imported recordings
(``mocap/importer.py``), placed in the cell. A share of the workers may show off-task motion
instead (``off_task_motion.py``).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
from app.sim.people.off_task_motion import off_task_motions
from app.sim.people.reach_script import VARIANTS as REACH_VARIANTS
from app.sim.people.reach_script import build_reach_library
from app.sim.primitives.kernels.primitives import PrimitiveLibrary
from app.sim.primitives.primitive_library import VARIANTS, motion_library

MotionSource = Literal["library", "reaches", "recorded"]
MOTIONS: tuple[MotionSource, ...] = ("library", "reaches", "recorded")
TRACK_DT = 0.02
"""Sampling step of tracks [s]; 50 Hz, above the bandwidth of hand motion."""
NEEDED_S = 10.0
"""Desired length of a track after the start of an episode [s]."""
LOOPED_S = 22.0
"""Length to which shorter recorded runs are played back and forth [s]: the longest episode of
an evaluation from any place of the first run."""
N_OFF_TASK = 24
"""Number of off-task motions, one minute each."""
NO_TRACKS = Tracks(np.zeros((1, 19)), np.array([[0, 1, -1]]), TRACK_DT, 0.0)
"""Tracks of workers without tracks."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HumanMotionConfig:
    """Motion, sizes and yielding of the workers of a cell."""

    motion: MotionSource = "library"
    """Source of the motion."""
    seed: int = 0
    """Seed of postures and primitive samples."""
    pace: float = 1.0
    """Speed relative to the scripts."""
    pace_max: float | None = None
    """Greatest pace; each worker's is drawn per episode from ``pace`` on, lower ones more often
    (quadratically). None: ``pace``."""
    yielding: float = 0.0
    """Degree of yielding to the arm, from 0 (none) to 1."""
    off_task: float = 0.0
    """Share of workers with off-task motion, drawn per episode."""
    absent: float = 0.0
    """Share of absent workers, drawn per episode."""
    at_rest: float = 0.0
    """Share of workers that stand still for 5 to 20 s of an episode, in any posture."""
    bodies: tuple[BodySize, ...] | None = None
    """Body sizes, drawn per episode; None: ``primitive_library.BODIES``, or the cell's own
    person for synthetic reaches."""
    augmentation: bool = True
    """Whether primitives are sampled and varied (docs/method.md 3.4); otherwise demonstrations
    are replayed."""
    variants: int | None = None
    """Keyframes of ``library``, or postures of ``reaches``, per body, place and hand; None: as
    many as the source has, ``primitive_library.VARIANTS`` or ``reach_script.VARIANTS``."""
    recorded: tuple[Motion, ...] = ()
    """Runs placed in the cell, for ``recorded``; one that is given twice is drawn twice as
    often."""
    loop: bool = True
    """Whether recorded runs shorter than an episode are played back and forth; otherwise the
    person rests at the end."""

    def __post_init__(self) -> None:
        if self.motion not in MOTIONS:
            raise InvalidInput("motion", self.motion, "must be a motion source", MOTIONS)
        for name in ("yielding", "off_task", "absent", "at_rest"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise InvalidInput(name, getattr(self, name), "must lie in [0, 1]")
        if not (np.isfinite(self.pace) and self.pace > 0.0):
            raise InvalidInput("pace", self.pace, "must be above 0")
        if self.pace_max is not None and not self.pace <= self.pace_max < math.inf:
            raise InvalidInput(
                "pace_max", self.pace_max, f"must be at least pace = {self.pace}"
            )
        if self.variants is not None:
            whole = isinstance(self.variants, int) and not isinstance(self.variants, bool)
            if not whole or self.variants < 1:
                rule = "must be a whole number of at least 1, or None"
                raise InvalidInput("variants", self.variants, rule)
        if self.bodies is not None and not self.bodies:
            raise InvalidInput("bodies", 0, "must hold at least one size, or be None")
        if self.motion == "recorded" and not self.recorded:
            raise InvalidInput("recorded", 0, "must hold at least one run of recorded motion")


USUAL = HumanMotionConfig()
"""Workers with the motion library."""
REACHING = HumanMotionConfig(motion="reaches")
"""Synthetic reaches of the cell's own person."""


def with_human_motion(shared: People, cell: Cell, settings: HumanMotionConfig) -> People:
    """Return shared data of people with the configured motion of the workers.

    Args:
        shared: Data of people without motion.
        cell: Work cell with at least one worker.
        settings: Configuration.
    """
    shared = shared._replace(
        pace=settings.pace,
        pace_max=settings.pace if settings.pace_max is None else settings.pace_max,
        yielding=settings.yielding,
        absent_share=settings.absent,
        rest_share=settings.at_rest,
    )
    if settings.motion == "recorded":
        runs = settings.recorded
        if settings.loop:
            longer = {id(run): back_and_forth(run, LOOPED_S) for run in runs}
            runs = tuple(longer[id(run)] for run in runs)
        tracks, lengths = tracks_of(runs, cell.floor_z)
        return shared._replace(tracks=tracks, track_share=1.0, bodies=lengths)
    if settings.off_task > 0.0:
        tracks, _ = tracks_of(off_task_recordings(cell, settings.seed), cell.floor_z)
        tracks.spans[:, 2] = -1
        shared = shared._replace(tracks=tracks, track_share=settings.off_task)
    if settings.motion == "library":
        variants = VARIANTS if settings.variants is None else settings.variants
        augmentation = settings.augmentation
        library = motion_library(
            cell, settings.seed, settings.bodies, augmentation=augmentation, variants=variants
        )
        drawn = library.keyframes
        # Samples are large, and read-only everywhere.
        shared = shared._replace(
            source=people.LIBRARY,
            bodies=np.array(library.bodies),
            primitive_library=PrimitiveLibrary(
                samples=np.ascontiguousarray(library.samples),
                gain=np.array(library.gain),
                segments=np.array(library.segments),
                duration=np.array(library.duration),
                varied=augmentation,
            ),
        )
    else:
        sizes = settings.bodies or (cell.human.size,)
        variants = REACH_VARIANTS if settings.variants is None else settings.variants
        drawn = build_reach_library(cell, settings.seed, sizes, variants)
        bodies = np.stack([size.vector(cell.floor_z) for size in sizes])
        shared = shared._replace(source=people.REACHES, bodies=bodies)
    # Copies, because kernels are compiled separately for read-only arrays.
    return shared._replace(
        postures=np.array(drawn.postures),
        hands=np.array(drawn.hands),
        of_station=np.array(drawn.of_station),
        n_cubes=drawn.n_cubes,
    )


@lru_cache(maxsize=4)
def off_task_recordings(cell: Cell, seed: int) -> tuple[Motion, ...]:
    """Return the off-task motions of a cell."""
    return off_task_motions(cell, cell.human.size, seed, N_OFF_TASK)


def tracks_of(motions: Sequence[Motion], floor_z: float) -> tuple[Tracks, Vec]:
    """Return runs as resampled tracks, and the sizes of their people.

    Joints may exceed the model's limits, as recorded. A run that is given several times is
    several tracks with the same samples and body.

    Args:
        motions: Runs, placed in the cell (``importer.placed``).
        floor_z: Height of the cell's floor [m].

    Returns:
        Tracks, and sizes of the different runs [m], shape (n, 12).
    """
    different = {id(motion): motion for motion in motions}
    rows: list[Vec] = []
    spans: dict[int, tuple[int, int, int]] = {}
    first = 0
    for number, (key, motion) in enumerate(different.items()):
        # The last frame is kept; the tolerance absorbs rounding.
        n = max(2, math.ceil(motion.times[-1] / TRACK_DT - 1e-6) + 1)
        at = np.minimum(np.arange(n) * TRACK_DT, motion.times[-1])
        values = np.column_stack([motion.q, motion.pelvis_z])
        rows.append(
            np.stack([np.interp(at, motion.times, column) for column in values.T], axis=1)
        )
        spans[key] = first, n, number
        first += n
    tracks = Tracks(
        np.ascontiguousarray(np.concatenate(rows)),
        np.array([spans[id(motion)] for motion in motions], dtype=np.int64),
        TRACK_DT,
        NEEDED_S,
    )
    return tracks, np.stack([one.size.vector(floor_z) for one in different.values()])


def back_and_forth(run: Motion, seconds: float) -> Motion:
    """Return a run that is played forward and backward until it lasts ``seconds`` [s]."""
    length = float(run.times[-1])
    if length >= seconds or length <= 0.0:
        return run
    n = math.ceil(seconds / length)
    back = slice(-2, None, -1)
    q, pelvis_z, times = [run.q], [run.pelvis_z], [run.times]
    for k in range(1, n):
        part = slice(1, None) if k % 2 == 0 else back
        elapsed = run.times[1:] if k % 2 == 0 else length - run.times[back]
        q.append(run.q[part])
        pelvis_z.append(run.pelvis_z[part])
        times.append(k * length + elapsed)
    return replace(
        run, q=np.concatenate(q), pelvis_z=np.concatenate(pelvis_z), times=np.concatenate(times)
    )


def at_the_table(motion: Motion, cell: Cell) -> Motion:
    """Return a recorded run placed at the cell's table.

    The median yaw becomes that of the cell's worker, the median position along the table the
    worker's home, and the closest pelvis position the near edge of the walking area.
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
