"""Synthetic reaches by inverse kinematics: home, cube, dock and back.

A library holds postures per place and hand with random stance, elbow and grip. A
script visits them at random pace with pauses (``primitives/kernels/script.py``). The other hand
rests at the table's edge while the trunk leans.

``HumanMotionConfig(motion="reaches")`` selects this motion; :func:`reach_script` makes the
single reaches of the case studies.

Source: docs/method.md 3.2 and 3.4. Deviates: the thesis replays motion capture through movement
primitives (``primitive_library.py``); these reaches are synthetic.
"""

from functools import lru_cache

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import BodySize
from app.sim.human.model import Hand
from app.sim.primitives.kernels import script
from app.sim.primitives.keyframes import (
    PostureLibrary,
    draw_grip_and_stance,
    draw_home_stance,
    draw_postures,
    posture,
    table_support,
)

REACH_PACE = 0.5
"""Mean palm speed of a single reach [m/s]."""
SHORTEST_REACH_S = 0.8
"""Shortest duration of a single reach [s]."""
VARIANTS = 24
"""Postures per body, place and hand."""


@lru_cache(maxsize=8)
def build_reach_library(
    cell: Cell, seed: int, bodies: tuple[BodySize, ...] | None = None, variants: int = VARIANTS
) -> PostureLibrary:
    """Draw ``variants`` postures for each body, place and hand of a cell.

    Args:
        seed: Seed of stances, elbows and grips.
        bodies: Body sizes; None for the cell's own.
        variants: Postures per body, place and hand.
    """
    rng = np.random.default_rng(seed)
    sizes = np.array([size.vector(cell.floor_z) for size in bodies or (cell.human.size,)])

    def draw(size: Vec, target: Vec | None, hand: Hand) -> Vec:
        if target is None:
            return _at_home(cell, rng)
        return _at_station(cell, size, rng, target, hand)

    return draw_postures(cell, sizes, variants, draw)


def _at_home(cell: Cell, rng: np.random.Generator) -> Vec:
    q = human.rest_posture(*draw_home_stance(cell, rng))
    for first in (10, 14):
        q[first : first + 4] += rng.uniform([-0.1, -0.06, -0.2, -0.25], [0.2, 0.09, 0.2, 0.65])
    return q


def _at_station(
    cell: Cell, size: Vec, rng: np.random.Generator, target: Vec, hand: Hand
) -> Vec:
    """Return a posture with one palm at a station and the other at the table's edge."""
    side = -1 if hand == "r" else 1
    grip, pelvis = draw_grip_and_stance(cell, target, side, (0.0, 0.12), rng)
    support = table_support(cell, pelvis[0], side) + rng.uniform(-0.04, 0.04, 3)
    palms = np.stack([grip, support] if hand == "r" else [support, grip])
    return posture(size, pelvis, palms, float(rng.uniform(0.0, 0.9))).q


class ReachScript:
    """A fixed sequence of moves as a function of time.

    Args:
        start: Start of each move [s], shape (n,).
        duration: Duration of each move [s], shape (n,).
        postures: Postures before, between and after the moves [m, rad], shape (n + 1, 18).
    """

    def __init__(self, start: Vec, duration: Vec, postures: Vec) -> None:
        self._start, self._duration, self._postures = start, duration, postures

    @property
    def end_s(self) -> float:
        """End of the last move [s]."""
        return float(self._start[-1] + self._duration[-1])

    def at(self, t: float) -> tuple[Vec, Vec]:
        """Return joint positions [m, rad] and speeds [m/s, rad/s] at ``t`` [s], (18,) each."""
        q, qd = np.empty(18), np.empty(18)
        n_moves = len(self._start)
        script.script_at(t, n_moves, self._start, self._duration, self._postures, q, qd)
        return q, qd


def reach_script(
    cell: Cell,
    hand: Hand,
    palms: tuple[Vec, Vec],
    delay_s: float,
) -> ReachScript:
    """Return a single reach between two points with deterministic postures.

    Args:
        hand: Working hand.
        palms: Initial and final palm position [m], shape (3,) each; equal for no motion.
        delay_s: Rest before the move [s].
    """
    postures = [standing_reach(cell, palm, hand) for palm in palms]
    distance = float(np.linalg.norm(np.subtract(*palms)))
    duration = max(SHORTEST_REACH_S, distance / REACH_PACE)
    return ReachScript(np.array([delay_s]), np.array([duration]), np.array(postures))


def standing_reach(cell: Cell, palm: Vec, hand: Hand) -> Vec:
    """Return a posture with one palm at a point and the other at the table's edge.

    Args:
        palm: Position of the palm [m], shape (3,).
        hand: The hand.

    Returns:
        Joint positions [m, rad], shape (18,).
    """
    side = -1 if hand == "r" else 1
    x = float(np.clip(0.8 * palm[0] - side * 0.12, cell.human.x_min, cell.human.x_max))
    start = human.rest_posture(x, cell.human.y_min + 0.03, cell.human.home[2])
    support = table_support(cell, x, side)
    right, left = (palm, support) if hand == "r" else (support, palm)
    return human.solve_hands(start, cell.body, right=right, left=left).q
