"""Demonstrations of a task: a person's reaches from one place of the cell to another.

Two things are drawn. A *node* is a posture with one palm at a place: where the person stands,
where the palms are, how far the elbows are turned out; the trunk leans as ``human.solve_hands``
asks. A *demonstration* goes from node to node: along the straight line of each palm, lifted and
bowed a little, while the stance moves ahead of the hand or behind it. What is not a sound
motion (a jump, a joint limit, a hand or an elbow in the table) is drawn again.

A *style* is a manner of doing this. A demonstration begins in one style and ends, now and then,
in another, as do the people of ``primitive_library.py``. Their postures are drawn here as
well, so that queries of a primitive lie in the distribution to which it was fitted.

Measured on the recorded clips (six clips, Vicon, 100 Hz; 65 reaches of 0.15 m or more from rest
to rest; 5 %, median, 95 %): mean speed of the palm 0.25, 0.69, 1.15 m/s, standard deviation of
its logarithm 0.48; path over straight distance 1.02, 1.10, 1.33; height over the straight line
0, 0.01, 0.06 m; sideways bow 0.02, 0.12, 0.25 of the distance; elbow turned out of the vertical
plane by 0.8, 1.3, 2.0 rad; pelvis moves by 0, 0.07, 0.31 m and turns by 0.01, 0.14, 0.41 rad.

Source: METHOD 3.2 and 3.4. Deviates: the source records people; these demonstrations are
synthetic, with those numbers as a guide. Bow and the spread of the pace are taken over, the
median pace is that of ``primitives/kernels/script.py``. Elbows are turned out less: ours hang
lower
over the table, and hands are lifted more, because there are cubes on it.
"""

import math
from dataclasses import dataclass

import numpy as np

from app.errors import SimulationError
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.kernels import kinematics as body
from app.sim.human.model import Hand
from app.sim.primitives.kernels import script

PHASES = np.linspace(0.0, 1.0, 28)
"""Phases at which a demonstration is sampled."""
PHASES.setflags(write=False)
PACE_SPREAD = 0.33
"""Standard deviation of the logarithm of the pace within a style; 0.4 over all styles."""
BOW = 0.12
"""Standard deviation of the sideways bow, relative to the distance."""
LARGEST_BOW = 0.25
"""Relative to the distance."""
CHANGES_STYLE = 1.0 / 3.0
"""Chance that a demonstration ends in another style than it began in."""
LARGEST_STEP = 0.25
"""Largest change of a joint from one phase to the next [rad]."""
OVER_TABLE = 0.015
"""Least height of palms, wrists and elbows over the table [m]."""
KEYFRAME_TRIES, TRIES = 20, 40
"""Draws after which a posture or a motion is given up."""

_LOW_POINTS = (
    body.ELBOW_R,
    body.WRIST_R,
    body.HAND_R,
    body.ELBOW_L,
    body.WRIST_L,
    body.HAND_L,
)
Range = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """A manner of reaching; ranges are drawn from evenly."""

    name: str
    """For people."""
    pace: float = 1.0
    """Speed relative to the median."""
    away: Range = (0.0, 0.08)
    """How far from the table's side of the walking area the pelvis stands [m]."""
    swivel: Range = (0.25, 0.8)
    """Turn of the elbows out of the vertical plane [rad]."""
    lift: Range = (0.02, 0.07)
    """Height of the palm over the straight line, half-way [m]."""
    lead: Range = (-0.2, 0.6)
    """How far the stance is ahead of the hand: 1 would be a quarter of the way, half-way."""
    support: float = 0.6
    """Chance that the other hand rests at the table's edge; else it is held before the body."""


STYLES = (
    Style(name="upright", away=(0.0, 0.05), lead=(0.2, 0.8), support=0.4),
    Style(name="leaning", away=(0.10, 0.20), swivel=(0.2, 0.7), support=0.8),
    Style(name="elbow-out", away=(0.02, 0.12), swivel=(0.8, 1.25)),
    Style(name="brisk", pace=1.45, lift=(0.01, 0.05), lead=(-0.3, 0.3)),
    Style(name="careful", pace=0.68, lift=(0.05, 0.12), lead=(0.0, 0.8)),
)
"""The styles that are demonstrated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """A posture at a place, and what it was made from."""

    pelvis: Vec
    """Pelvis x [m], y [m], yaw [rad], shape (3,)."""
    palms: Vec
    """Where the right and the left palm are [m], shape (2, 3)."""
    swivel: float
    """Turn of the elbows [rad]."""
    q: Vec
    """Joint positions [m, rad], shape (18,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Demonstration:
    """One motion from a place to another."""

    q: Vec
    """Joint positions at PHASES [m, rad], shape (28, 18)."""
    duration_s: float
    """How long it takes [s]."""
    style: str
    """Style in which it begins."""


def draw_style(rng: np.random.Generator) -> Style:
    """Return a style, all alike likely."""
    return STYLES[rng.integers(len(STYLES))]


def draw_keyframe(
    cell: Cell,
    size: Vec,
    target: Vec | None,
    hand: Hand,
    rng: np.random.Generator,
    style: Style | None = None,
) -> Node:
    """Draw a posture with one palm at a place.

    Args:
        cell: Work cell with a worker.
        size: The person's size [m], shape (12,).
        target: Point of the station [m], shape (3,); None: at home.
        hand: The hand that works.
        rng: Source of chance.
        style: Style; None draws one.

    Returns:
        A posture inside the limits and clear of the table; where a place allows none, the last
        that was tried, whose palm may fall short of the place.
    """
    style = draw_style(rng) if style is None else style
    for _ in range(KEYFRAME_TRIES):
        if target is None:
            node, reached = _home(cell, size, style, rng)
        else:
            node, reached = _at_station(cell, size, style, target, hand, rng)
        if reached and _inside(node.q) and _over_table(cell, node.q, size):
            break
    return node


def _node(size: Vec, pelvis: Vec, palms: Vec, swivel: float) -> tuple[Node, bool]:
    found = _solved(size, pelvis, palms, swivel)
    return Node(pelvis=pelvis, palms=palms, swivel=swivel, q=found.q), found.reached


def _solved(size: Vec, pelvis: Vec, palms: Vec, swivel: float) -> human.Posture:
    x, y, yaw = (float(value) for value in pelvis)
    start = human.rest_posture(x, y, yaw)
    return human.solve_hands(start, size, right=palms[0], left=palms[1], swivel=swivel)


def _home(cell: Cell, size: Vec, style: Style, rng: np.random.Generator) -> tuple[Node, bool]:
    """Return a posture at home, the forearms lifted a little, as if ready to work."""
    x, y, yaw = cell.human.home
    area = cell.human
    pelvis = np.array(
        [
            np.clip(x + rng.normal(0.0, 0.2), area.x_min, area.x_max),
            np.clip(y + rng.uniform(-0.08, 0.15), area.y_min, area.y_max),
            yaw + rng.normal(0.0, 0.15),
        ]
    )
    palms = np.stack([_held_palm(size, pelvis, side, rng, (0.14, 0.30)) for side in (-1, 1)])
    return _node(size, pelvis, palms, float(rng.uniform(*style.swivel)))


def _held_palm(
    size: Vec, pelvis: Vec, side: int, rng: np.random.Generator, ahead: Range
) -> Vec:
    """Return where a free palm is held [m]: before the hip, a good arm's length down.

    Args:
        size: The person's size [m], shape (12,).
        pelvis: Pelvis x [m], y [m], yaw [rad].
        side: -1 for the right hand, 1 for the left.
        rng: Source of chance.
        ahead: How far before the pelvis [m], for the median person.
    """
    arm = 0 if side < 0 else 1
    length = size[body.UPPER_ARM_R + arm] + size[body.FOREARM_R + arm] + size[body.HAND]
    scale = length / 0.64
    forward = scale * rng.uniform(*ahead)
    sideways = side * (size[body.CLAVICLE_R + arm] + scale * rng.uniform(0.02, 0.12))
    drop = math.sqrt(max((rng.uniform(0.78, 0.9) * length) ** 2 - forward**2, 0.0))
    c, s = math.cos(pelvis[2]), math.sin(pelvis[2])
    height = size[body.PELVIS_Z] + size[body.TRUNK] - drop
    return np.array(
        [
            pelvis[0] + c * forward - s * sideways,
            pelvis[1] + s * forward + c * sideways,
            height,
        ]
    )


def _at_station(
    cell: Cell, size: Vec, style: Style, target: Vec, hand: Hand, rng: np.random.Generator
) -> tuple[Node, bool]:
    """Return a posture with one palm at a station; the other supports the body or is free."""
    side = -1 if hand == "r" else 1
    area = cell.human
    grip = target + rng.uniform([-0.03, -0.03, -0.06], [0.03, 0.03, 0.05])
    x = 0.8 * target[0] - side * 0.12 + rng.normal(0.0, 0.07)
    x = float(np.clip(x, area.x_min, area.x_max))
    y = min(area.y_min + rng.uniform(*style.away), area.y_max)
    yaw = area.home[2] + rng.normal(0.0, 0.12) + 0.3 * math.atan2(target[0] - x, 0.5)
    pelvis = np.array([x, y, yaw])
    if rng.uniform() < style.support:
        other = np.array([x - side * 0.25, cell.table.y_max - 0.03, 0.06])
        other += rng.uniform(-0.04, 0.04, 3)
    else:
        other = _held_palm(size, pelvis, -side, rng, (0.24, 0.38))
    palms = np.stack([grip, other] if hand == "r" else [other, grip])
    return _node(size, pelvis, palms, float(rng.uniform(*style.swivel)))


def demonstrate(
    cell: Cell,
    size: Vec,
    ends: tuple[Vec | None, Vec | None],
    hand: Hand,
    style: Style,
    rng: np.random.Generator,
) -> Demonstration:
    """Draw a sound motion from one place to another.

    Args:
        cell: Work cell with a worker.
        size: The person's size [m], shape (12,).
        ends: Points of the two stations [m], shape (3,) each; None: home.
        hand: The hand that works.
        style: Style in which it begins.
        rng: Source of chance.

    Raises:
        SimulationError: None was found; the place is out of this person's reach.
    """
    for _ in range(TRIES):
        last = draw_style(rng) if rng.uniform() < CHANGES_STYLE else style
        first = draw_keyframe(cell, size, ends[0], hand, rng, style)
        then = draw_keyframe(cell, size, ends[1], hand, rng, last)
        q, reached = between(size, first, then, style, rng)
        steps = np.abs(np.diff(q[:, 3:], axis=0)).max()
        clear = all(_over_table(cell, row, size) for row in q)
        if reached and steps <= LARGEST_STEP and _inside(q) and clear:
            way = float(np.linalg.norm(then.palms - first.palms, axis=1).max())
            return Demonstration(q=q, duration_s=_duration(way, style, rng), style=style.name)
    raise SimulationError(f"no sound motion of the {hand} hand from {ends[0]} to {ends[1]}")


def between(
    size: Vec, first: Node, then: Node, style: Style, rng: np.random.Generator
) -> tuple[Vec, bool]:
    """Return a motion from node to node [m, rad], shape (28, 18), and whether palms keep to it.

    Phases are even: with a minimum-jerk law of the phase the palm moves like Flash and Hogan's.
    """
    lead = rng.uniform(*style.lead)
    stance = PHASES + lead * PHASES * (1.0 - PHASES)
    pelvis = first.pelvis + stance[:, None] * (then.pelvis - first.pelvis)
    swivel = first.swivel + PHASES * (then.swivel - first.swivel)
    hump = np.sin(math.pi * PHASES) ** 2
    palms = first.palms + PHASES[:, None, None] * (then.palms - first.palms)
    for hand in range(2):
        way = then.palms[hand] - first.palms[hand]
        distance = float(np.linalg.norm(way))
        # A hand that stays where it is, is not lifted.
        share = min(1.0, distance / 0.3)
        across = np.array([-way[1], way[0], 0.0]) * np.clip(
            rng.normal(0.0, BOW), -LARGEST_BOW, LARGEST_BOW
        )
        up = np.array([0.0, 0.0, share * rng.uniform(*style.lift)])
        palms[:, hand] += hump[:, None] * (across + up)
    rows, reached = np.empty((len(PHASES), 18)), True
    for k in range(len(PHASES)):
        found = _solved(size, pelvis[k], palms[k], float(swivel[k]))
        rows[k], reached = found.q, reached and found.reached
    return rows, reached


def _inside(q: Vec) -> bool:
    """Return whether every joint is off its limits: ``solve_hands`` cuts off at them."""
    return bool(((q > human.Q_MIN) & (q < human.Q_MAX)).all(axis=-1).all())


def _over_table(cell: Cell, q: Vec, size: Vec) -> bool:
    """Return whether palms, wrists and elbows are beside the table or above it."""
    named = human.joint_points(q, size)
    points = np.stack([named[human.POINT_NAMES[i]] for i in _LOW_POINTS])
    return bool((height_over_table(cell, points) >= OVER_TABLE).all())


def height_over_table(cell: Cell, points: Vec) -> Vec:
    """Return the height of points over the table [m], infinite beside it, shape (...).

    Args:
        cell: Work cell.
        points: Points [m], shape (..., 3).
    """
    table = cell.table
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    over = (x >= table.x_min) & (x <= table.x_max) & (y >= table.y_min) & (y <= table.y_max)
    return np.where(over, z, np.inf)


def _duration(way: float, style: Style, rng: np.random.Generator) -> float:
    """Draw how long a motion takes [s] from the farther palm's way [m] and the style's pace."""
    pace = style.pace * script.PACE_MEDIAN * math.exp(PACE_SPREAD * rng.standard_normal())
    pace = min(script.PACE_MAX, max(script.PACE_MIN, pace))
    return max(script.SHORTEST_MOVE, way / pace)
