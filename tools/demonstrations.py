"""Synthetic demonstrations: reaches of a person between two places of a cell.

A demonstration connects two keyframes (``app/sim/primitives/keyframes.py``): each palm follows
the straight line, lifted and curved, while the stance moves ahead of the hand or behind it.
Motions with a jump, a joint at its limit, or a hand or elbow in the table are rejected. A
demonstration begins in one style and may end in another.

Reference, measured on recorded clips (six clips, Vicon, 100 Hz; 65 reaches of 0.15 m or more
from rest to rest; 5 %, median, 95 %): mean palm speed 0.25, 0.69, 1.15 m/s, standard deviation
of its logarithm 0.48; path over straight distance 1.02, 1.10, 1.33; height over the straight
line 0, 0.01, 0.06 m; sideways deviation 0.02, 0.12, 0.25 of the distance; elbow swivel 0.8,
1.3, 2.0 rad; pelvis displacement 0, 0.07, 0.31 m and rotation 0.01, 0.14, 0.41 rad.

Source: docs/method.md 3.2 and 3.4. Deviates: the source records people; these demonstrations
are synthetic. Path curvature and spread of the pace are those measured, the median pace is that
of ``primitives/kernels/script.py``. Hands are lifted more, because of the cubes.
"""

import math
from dataclasses import dataclass

import numpy as np

from app.errors import SimulationError
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human.model import Hand
from app.sim.primitives.kernels import script
from app.sim.primitives.keyframes import (
    Keyframe,
    Style,
    draw_keyframe,
    draw_style,
    is_inside,
    is_over_table,
    posture,
)

PHASES = np.linspace(0.0, 1.0, 28)
"""Phases at which a demonstration is sampled."""
PHASES.setflags(write=False)
PACE_SPREAD = 0.33
"""Standard deviation of the logarithm of the pace within a style; 0.4 over all styles."""
PATH_CURVATURE = 0.12
"""Standard deviation of the sideways deviation, relative to the distance."""
MAX_PATH_CURVATURE = 0.25
"""Largest sideways deviation, relative to the distance."""
P_STYLE_CHANGE = 1.0 / 3.0
"""Probability that a demonstration ends in a newly drawn style."""
LARGEST_STEP = 0.25
"""Largest change of a joint from one phase to the next [rad]."""
TRIES = 40
"""Largest number of draws of a motion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Demonstration:
    """One motion between two places."""

    q: Vec
    """Joint positions at PHASES [m, rad], shape (28, 18)."""
    duration_s: float
    """Duration [s]."""
    style: str
    """Initial style."""


def demonstrate(
    cell: Cell,
    size: Vec,
    ends: tuple[Vec | None, Vec | None],
    hand: Hand,
    style: Style,
    rng: np.random.Generator,
) -> Demonstration:
    """Draw a feasible motion between two places.

    Args:
        cell: Work cell with a worker.
        size: The person's size [m], shape (12,).
        ends: Points of the two stations [m], shape (3,) each; None: home.
        hand: The hand that works.
        style: Initial style.
        rng: Source of randomness.

    Raises:
        SimulationError: No feasible motion was found.
    """
    for _ in range(TRIES):
        last = draw_style(rng) if rng.uniform() < P_STYLE_CHANGE else style
        first = draw_keyframe(cell, size, ends[0], hand, rng, style)
        then = draw_keyframe(cell, size, ends[1], hand, rng, last)
        q, reached = between(size, first, then, style, rng)
        steps = np.abs(np.diff(q[:, 3:], axis=0)).max()
        clear = all(is_over_table(cell, row, size) for row in q)
        if reached and steps <= LARGEST_STEP and is_inside(q) and clear:
            distance = float(np.linalg.norm(then.palms - first.palms, axis=1).max())
            duration = _duration(distance, style, rng)
            return Demonstration(q=q, duration_s=duration, style=style.name)
    raise SimulationError(f"no feasible motion of hand {hand!r} from {ends[0]} to {ends[1]}")


def between(
    size: Vec, first: Keyframe, then: Keyframe, style: Style, rng: np.random.Generator
) -> tuple[Vec, bool]:
    """Return the motion between two keyframes and whether the palms follow their paths.

    Args:
        size: The person's size [m], shape (12,).
        first: Initial keyframe.
        then: Final keyframe.
        style: Style of the motion.
        rng: Source of randomness.

    Returns:
        Joint positions at PHASES [m, rad], shape (28, 18), and the flag. With a minimum-jerk
        phase the palm moves as in Flash and Hogan (1985).
    """
    lead = rng.uniform(*style.lead)
    stance = PHASES + lead * PHASES * (1.0 - PHASES)
    pelvis = first.pelvis + stance[:, None] * (then.pelvis - first.pelvis)
    swivel = first.swivel + PHASES * (then.swivel - first.swivel)
    hump = np.sin(math.pi * PHASES) ** 2
    palms = first.palms + PHASES[:, None, None] * (then.palms - first.palms)
    for hand in range(2):
        along = then.palms[hand] - first.palms[hand]
        distance = float(np.linalg.norm(along))
        # A resting hand is not lifted.
        share = min(1.0, distance / 0.3)
        across = np.array([-along[1], along[0], 0.0]) * np.clip(
            rng.normal(0.0, PATH_CURVATURE), -MAX_PATH_CURVATURE, MAX_PATH_CURVATURE
        )
        up = np.array([0.0, 0.0, share * rng.uniform(*style.lift)])
        palms[:, hand] += hump[:, None] * (across + up)
    rows, reached = np.empty((len(PHASES), 18)), True
    for k in range(len(PHASES)):
        found = posture(size, pelvis[k], palms[k], float(swivel[k]))
        rows[k], reached = found.q, reached and found.reached
    return rows, reached


def _duration(distance: float, style: Style, rng: np.random.Generator) -> float:
    """Draw the duration of a motion [s] from the larger palm displacement and the style."""
    pace = style.pace * script.PACE_MEDIAN * math.exp(PACE_SPREAD * rng.standard_normal())
    pace = min(script.PACE_MAX, max(script.PACE_MIN, pace))
    return max(script.SHORTEST_MOVE, distance / pace)
