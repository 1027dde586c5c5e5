"""Keyframes: postures of a person with one palm at a place of a cell.

Stance, palms and elbow swivel are random; a *style* is a range of these parameters. The
demonstrations of the shipped primitives connect two keyframes (``tools/demonstrations.py``) and
may change their style in between, like segments between the keyframes of
``primitive_library.py``: queries of a primitive lie in the distribution to which it was fitted.

Source: docs/method.md 3.2 and 3.4. Deviates: the source records people; these postures are
synthetic. Elbows hang lower, because of the cubes.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.kernels import kinematics as body
from app.sim.human.model import Hand

OVER_TABLE = 0.015
"""Least height of palms, wrists and elbows over the table [m]."""
KEYFRAME_TRIES = 20
"""Largest number of draws of a keyframe."""

_LOW_POINTS = (body.ELBOW_R, body.WRIST_R, body.HAND_R, body.ELBOW_L, body.WRIST_L, body.HAND_L)
Range = tuple[float, float]
Index = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """Parameters of a style of reaching; ranges are sampled uniformly."""

    name: str
    """Name of the style."""
    pace: float = 1.0
    """Speed relative to the median."""
    away: Range = (0.0, 0.08)
    """Distance of the pelvis from the table side of the walking area [m]."""
    swivel: Range = (0.25, 0.8)
    """Swivel of the elbows out of the vertical plane [rad]."""
    lift: Range = (0.02, 0.07)
    """Height of the palm over the straight line, half-way [m]."""
    lead: Range = (-0.2, 0.6)
    """Lead of the stance over the hand; 1 is a quarter of the distance at half-way."""
    support: float = 0.6
    """Probability that the other hand rests on the table's edge rather than free."""


STYLES = (
    Style(name="upright", away=(0.0, 0.05), lead=(0.2, 0.8), support=0.4),
    Style(name="leaning", away=(0.10, 0.20), swivel=(0.2, 0.7), support=0.8),
    Style(name="elbow-out", away=(0.02, 0.12), swivel=(0.8, 1.25)),
    Style(name="brisk", pace=1.45, lift=(0.01, 0.05), lead=(-0.3, 0.3)),
    Style(name="careful", pace=0.68, lift=(0.05, 0.12), lead=(0.0, 0.8)),
)
"""Styles of keyframes and demonstrations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Keyframe:
    """Posture at a place and its parameters."""

    pelvis: Vec
    """Pelvis x [m], y [m], yaw [rad], shape (3,)."""
    palms: Vec
    """Right and left palm [m], shape (2, 3)."""
    swivel: float
    """Swivel of the elbows [rad]."""
    q: Vec
    """Joint positions [m, rad], shape (18,)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PostureLibrary:
    """Postures of the work in one cell; arrays are read-only."""

    postures: Vec
    """Joint positions [m, rad], shape (n, 18)."""
    hands: Vec
    """Right and left palms [m], shape (n, 2, 3)."""
    of_station: Index
    """First posture and count of each body, place (home last) and hand, shape (n_bodies,
    n_places + 1, 2, 2)."""
    n_cubes: int
    """Number of cubes."""

    def __post_init__(self) -> None:
        for array in (self.postures, self.hands, self.of_station):
            array.setflags(write=False)


def draw_postures(
    cell: Cell, sizes: Vec, variants: int, draw: Callable[[Vec, Vec | None, Hand], Vec]
) -> PostureLibrary:
    """Draw ``variants`` postures for each body, place and hand of a cell.

    Args:
        cell: Work cell with a worker.
        sizes: Sizes of the bodies [m], shape (n_bodies, 12).
        variants: Postures per body, place and hand.
        draw: Function of a size, the point of a station [m], or None at home, and a hand, that
            returns joint positions [m, rad], shape (18,).
    """
    points = [np.array(station.position) for station in cell.pick_stations]
    of_station = np.zeros((len(sizes), len(points) + 1, 2, 2), dtype=np.int64)
    postures: list[Vec] = []
    palms: list[Vec] = []

    def add(size: Vec, point: Vec | None, hand: Hand) -> tuple[int, int]:
        drawn = [draw(size, point, hand) for _ in range(variants)]
        postures.extend(drawn)
        palms.extend(human.palms(q, size) for q in drawn)
        return len(postures) - variants, variants

    for size, of_body in zip(sizes, of_station, strict=True):
        for place, point in enumerate(points):
            for column, hand in enumerate(human.HANDS):
                of_body[place, column] = add(size, point, hand)
        of_body[-1, :] = add(size, None, human.HANDS[0])  # home has no working hand
    return PostureLibrary(
        postures=np.array(postures),
        hands=np.array(palms),
        of_station=of_station,
        n_cubes=len(cell.stations_of("cube")),
    )


def draw_style(rng: np.random.Generator) -> Style:
    """Draw a style uniformly."""
    return STYLES[rng.integers(len(STYLES))]


def draw_keyframe(
    cell: Cell,
    size: Vec,
    target: Vec | None,
    hand: Hand,
    rng: np.random.Generator,
    style: Style | None = None,
) -> Keyframe:
    """Draw a posture with one palm at a place.

    Args:
        cell: Work cell with a worker.
        size: The person's size [m], shape (12,).
        target: Point of the station [m], shape (3,); None: at home.
        hand: The hand that works.
        style: Style; None draws one.

    Returns:
        A posture within joint limits and clear of the table; if none is found, the last draw,
        whose palm may not reach the place.
    """
    style = draw_style(rng) if style is None else style
    for _ in range(KEYFRAME_TRIES):
        if target is None:
            keyframe, reached = _home(cell, size, style, rng)
        else:
            keyframe, reached = _at_station(cell, size, style, target, hand, rng)
        if reached and is_inside(keyframe.q) and is_over_table(cell, keyframe.q, size):
            break
    return keyframe


def _keyframe(size: Vec, pelvis: Vec, palms: Vec, swivel: float) -> tuple[Keyframe, bool]:
    found = posture(size, pelvis, palms, swivel)
    return Keyframe(pelvis=pelvis, palms=palms, swivel=swivel, q=found.q), found.reached


def posture(size: Vec, pelvis: Vec, palms: Vec, swivel: float) -> human.Posture:
    """Return the posture of a stance with given palms.

    Args:
        size: The person's size [m], shape (12,).
        pelvis: Pelvis x [m], y [m], yaw [rad], shape (3,).
        palms: Right and left palm [m], shape (2, 3).
        swivel: Swivel of the elbows [rad].
    """
    x, y, yaw = (float(value) for value in pelvis)
    start = human.rest_posture(x, y, yaw)
    return human.solve_hands(start, size, right=palms[0], left=palms[1], swivel=swivel)


def draw_home_stance(cell: Cell, rng: np.random.Generator) -> Vec:
    """Draw the pelvis x [m], y [m], yaw [rad] of a person at home, shape (3,)."""
    area, (x, y, yaw) = cell.human, cell.human.home
    return np.array(
        [
            np.clip(x + rng.normal(0.0, 0.2), area.x_min, area.x_max),
            np.clip(y + rng.uniform(-0.08, 0.15), area.y_min, area.y_max),
            yaw + rng.normal(0.0, 0.15),
        ]
    )


def draw_grip_and_stance(
    cell: Cell, target: Vec, side: int, away: Range, rng: np.random.Generator
) -> tuple[Vec, Vec]:
    """Draw a palm [m] near a station, and the pelvis x [m], y [m], yaw [rad] that goes with it.

    Args:
        cell: Work cell with a worker.
        target: Point of the station [m], shape (3,).
        side: -1 for the right hand, 1 for the left.
        away: Range of the distance from the table side of the walking area [m].
    """
    area = cell.human
    grip = target + rng.uniform([-0.03, -0.03, -0.06], [0.03, 0.03, 0.05])
    x = 0.8 * target[0] - side * 0.12 + rng.normal(0.0, 0.07)
    x = float(np.clip(x, area.x_min, area.x_max))
    y = min(area.y_min + rng.uniform(*away), area.y_max)
    yaw = area.home[2] + rng.normal(0.0, 0.12) + 0.3 * math.atan2(target[0] - x, 0.5)
    return grip, np.array([x, y, yaw])


def table_support(cell: Cell, x: float, side: int) -> Vec:
    """Return the place of a supporting palm at the table's edge [m], shape (3,).

    Args:
        x: Pelvis x [m].
        side: -1 where the right hand works, 1 where the left does.
    """
    return np.array([x - side * 0.25, cell.table.y_max - 0.03, 0.06])


def _home(
    cell: Cell, size: Vec, style: Style, rng: np.random.Generator
) -> tuple[Keyframe, bool]:
    """Draw a posture at home with slightly lifted forearms."""
    pelvis = draw_home_stance(cell, rng)
    palms = np.stack([_held_palm(size, pelvis, side, rng, (0.14, 0.30)) for side in (-1, 1)])
    return _keyframe(size, pelvis, palms, float(rng.uniform(*style.swivel)))


def _held_palm(
    size: Vec, pelvis: Vec, side: int, rng: np.random.Generator, ahead: Range
) -> Vec:
    """Draw the position of a free palm [m], in front of the hip.

    Args:
        size: The person's size [m], shape (12,).
        pelvis: Pelvis x [m], y [m], yaw [rad].
        side: -1 for the right hand, 1 for the left.
        ahead: Range of the distance in front of the pelvis [m], for the median person.
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
        [pelvis[0] + c * forward - s * sideways, pelvis[1] + s * forward + c * sideways, height]
    )


def _at_station(
    cell: Cell, size: Vec, style: Style, target: Vec, hand: Hand, rng: np.random.Generator
) -> tuple[Keyframe, bool]:
    """Draw a posture with one palm at a station and the other supporting or free."""
    side = -1 if hand == "r" else 1
    grip, pelvis = draw_grip_and_stance(cell, target, side, style.away, rng)
    if rng.uniform() < style.support:
        other = table_support(cell, pelvis[0], side) + rng.uniform(-0.04, 0.04, 3)
    else:
        other = _held_palm(size, pelvis, -side, rng, (0.24, 0.38))
    palms = np.stack([grip, other] if hand == "r" else [other, grip])
    return _keyframe(size, pelvis, palms, float(rng.uniform(*style.swivel)))


def is_inside(q: Vec) -> bool:
    """Return whether no joint of ``q`` [m, rad], (..., 18), is clipped at a limit."""
    return bool(((q > human.Q_MIN) & (q < human.Q_MAX)).all(axis=-1).all())


def is_over_table(cell: Cell, q: Vec, size: Vec) -> bool:
    """Return whether palms, wrists and elbows are clear of the table.

    Args:
        cell: Work cell.
        q: Joint positions [m, rad], shape (..., 18).
        size: Body lengths [m], shape (N_SIZE,).
    """
    named = human.joint_points(q, size)
    points = np.stack([named[human.POINT_NAMES[i]] for i in _LOW_POINTS])
    return bool((height_over_table(cell, points) >= OVER_TABLE).all())


def height_over_table(cell: Cell, points: Vec) -> Vec:
    """Return the height of points over the table [m], infinite beside the table, shape (...).

    Args:
        points: Points [m], shape (..., 3).
    """
    table = cell.table
    x, y, z = points[..., 0], points[..., 1], points[..., 2]
    over = (x >= table.x_min) & (x <= table.x_max) & (y >= table.y_min) & (y <= table.y_max)
    return np.where(over, z, np.inf)
