"""Motions a task library is made for: random legs between random nodes, and what they are like.

Used by the library's tests and by ``tools/docs/people_plots.py``.
"""

from dataclasses import dataclass

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.primitives import promp
from app.sim.primitives.demonstrations import height_over_table
from app.sim.primitives.primitive_library import MotionLibrary, segment_weights

PHASES = np.linspace(0.0, 1.0, 41)
LOW = ("elbow_r", "wrist_r", "elbow_l", "wrist_l")


@dataclass(frozen=True, slots=True, kw_only=True)
class LegMotion:
    """One leg as a worker does it."""

    leg: tuple[int, int, int]
    """From, to and hand."""
    person: int
    """Whose size it has."""
    q: Vec
    """Joint positions at PHASES, before they are clipped to the limits [m, rad], (41, 18)."""
    palms: Vec
    """Palms at PHASES, of the clipped joints [m], shape (41, 2, 3)."""
    nodes: Vec
    """Palms of the nodes at both ends [m], shape (2, 2, 3)."""
    lowest: float
    """Least height of palms, wrists and elbows over the table [m]."""

    @property
    def end_miss(self) -> float:
        """How far a palm is from its node at an end at most [m]."""
        return float(np.linalg.norm(self.palms[[0, -1]] - self.nodes, axis=-1).max())

    @property
    def beyond(self) -> float:
        """How far a joint leaves its limits at most [m, rad]."""
        over = np.maximum(human.Q_MIN - self.q, self.q - human.Q_MAX)
        return float(max(over.max(), 0.0))

    @property
    def path(self) -> float:
        """Length of the working palm's path [m]."""
        steps = np.diff(self.palms[:, self.leg[2]], axis=0)
        return float(np.linalg.norm(steps, axis=1).sum())

    @property
    def straight(self) -> float:
        """Distance of its ends [m]."""
        return float(np.linalg.norm(np.subtract(*self.nodes[:, self.leg[2]])))

    @property
    def swing(self) -> float:
        """How far an angle goes beyond its values at both ends at most [rad]."""
        angles = self.q[:, 2:]
        low, high = np.sort(angles[[0, -1]], axis=0)
        return float(np.maximum(low - angles, angles - high).max())


def random_segments(cell: Cell, library: MotionLibrary, n: int, seed: int) -> list[LegMotion]:
    """Return n legs, each of a random person, primitive, sample and pair of nodes."""
    rng = np.random.default_rng(seed)
    ways = np.argwhere(library.legs[..., 0] >= 0)
    return [
        random_segment(cell, library, tuple(ways[rng.integers(len(ways))]), rng)
        for _ in range(n)
    ]


def random_segment(
    cell: Cell, library: MotionLibrary, leg: tuple[int, int, int], rng: np.random.Generator
) -> LegMotion:
    """Return a leg of a random person between random nodes."""
    start, end, hand = leg
    primitive, first, count = library.legs[leg]
    person = int(rng.integers(len(library.bodies)))
    ranges = library.of_station[person, [start, end], hand]
    nodes = [int(one + rng.integers(some)) for one, some in ranges]
    sample = int(first + rng.integers(count))
    weights = segment_weights(library, primitive, sample, library.postures[nodes])
    phi = promp.basis(PHASES, promp.N_BASIS, promp.usual_width(promp.N_BASIS))
    q = phi @ weights.T
    size = library.bodies[person]
    rows = [human.joint_points(row, size) for row in np.clip(q, human.Q_MIN, human.Q_MAX)]
    palms = np.array([[row["hand_r"], row["hand_l"]] for row in rows])
    low = np.array([[row[name] for name in LOW] for row in rows])
    heights = height_over_table(cell, np.concatenate([palms, low], axis=1))
    return LegMotion(
        leg=leg,
        person=person,
        q=q,
        palms=palms,
        nodes=library.hands[nodes],
        lowest=float(heights.min()),
    )
