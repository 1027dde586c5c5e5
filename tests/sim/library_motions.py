"""Random segments of a motion library between random keyframes, and their properties.

Used by the library's tests and by ``tools/docs/people_plots.py``.
"""

from dataclasses import dataclass

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.primitives import promp
from app.sim.primitives.kernels.primitives import N_BASIS
from app.sim.primitives.keyframes import height_over_table
from app.sim.primitives.primitive_library import MotionLibrary

PHASES = np.linspace(0.0, 1.0, 41)
LOW = ("elbow_r", "wrist_r", "elbow_l", "wrist_l")


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentMotion:
    """One segment as a worker does it."""

    segment: tuple[int, int, int]
    """From, to and hand."""
    person: int
    """Whose size it has."""
    q: Vec
    """Joint positions at PHASES, before they are clipped to the limits [m, rad], (41, 18)."""
    palms: Vec
    """Palms at PHASES, of the clipped joints [m], shape (41, 2, 3)."""
    keyframes: Vec
    """Palms of the keyframes at both ends [m], shape (2, 2, 3)."""
    lowest: float
    """Least height of palms, wrists and elbows over the table [m]."""

    @property
    def end_miss(self) -> float:
        """How far a palm is from its keyframe at an end at most [m]."""
        return float(np.linalg.norm(self.palms[[0, -1]] - self.keyframes, axis=-1).max())

    @property
    def beyond(self) -> float:
        """How far a joint leaves its limits at most [m, rad]."""
        over = np.maximum(human.Q_MIN - self.q, self.q - human.Q_MAX)
        return float(max(over.max(), 0.0))

    @property
    def path(self) -> float:
        """Length of the working palm's path [m]."""
        steps = np.diff(self.palms[:, self.segment[2]], axis=0)
        return float(np.linalg.norm(steps, axis=1).sum())

    @property
    def straight(self) -> float:
        """Distance of its ends [m]."""
        return float(np.linalg.norm(np.subtract(*self.keyframes[:, self.segment[2]])))

    @property
    def swing(self) -> float:
        """How far an angle goes beyond its values at both ends at most [rad]."""
        angles = self.q[:, 2:]
        low, high = np.sort(angles[[0, -1]], axis=0)
        return float(np.maximum(low - angles, angles - high).max())


def random_segments(
    cell: Cell, library: MotionLibrary, n: int, seed: int
) -> list[SegmentMotion]:
    """Return n segments, each of a random person, primitive, sample and pair of keyframes."""
    rng = np.random.default_rng(seed)
    known = np.argwhere(library.segments[..., 0] >= 0)
    return [
        random_segment(cell, library, tuple(known[rng.integers(len(known))]), rng)
        for _ in range(n)
    ]


def random_segment(
    cell: Cell, library: MotionLibrary, segment: tuple[int, int, int], rng: np.random.Generator
) -> SegmentMotion:
    """Return a segment of a random person between random keyframes."""
    start, end, hand = segment
    primitive, first, count = library.segments[segment]
    person = int(rng.integers(len(library.bodies)))
    ranges = library.keyframes.of_station[person, [start, end], hand]
    keyframes = [int(one + rng.integers(some)) for one, some in ranges]
    sample = int(first + rng.integers(count))
    weights = segment_weights(library, primitive, sample, library.keyframes.postures[keyframes])
    phi = promp.basis(PHASES, N_BASIS, promp.usual_width(N_BASIS))
    q = phi @ weights.T
    size = library.bodies[person]
    rows = [human.joint_points(row, size) for row in np.clip(q, human.Q_MIN, human.Q_MAX)]
    palms = np.array([[row["hand_r"], row["hand_l"]] for row in rows])
    low = np.array([[row[name] for name in LOW] for row in rows])
    heights = height_over_table(cell, np.concatenate([palms, low], axis=1))
    return SegmentMotion(
        segment=segment,
        person=person,
        q=q,
        palms=palms,
        keyframes=library.keyframes.hands[keyframes],
        lowest=float(heights.min()),
    )


def segment_weights(library: MotionLibrary, primitive: int, sample: int, ends: Vec) -> Vec:
    """Return the conditioned weights of a segment between two keyframes, shape (18, 12).

    Args:
        library: Library.
        primitive: Index of the primitive.
        sample: Index of the sample.
        ends: Joint positions at both ends [m, rad], shape (2, 18).
    """
    drawn = library.samples[sample]
    phi = promp.basis(np.array([0.0, 1.0]), N_BASIS, promp.usual_width(N_BASIS))
    missing = (ends - phi @ drawn.T).ravel()
    return np.asarray(drawn + (library.gain[primitive] @ missing).reshape(drawn.shape))
