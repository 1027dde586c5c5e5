"""People who do anything but the task: they stand about, look elsewhere, reach over the table.

Task primitives are what a person at work does; a recorded person does more: holds a hand over
the table for seconds, uses both, turns away, walks off and comes back. A policy that met only
the task is lost beside them. A *roamer* goes from posture to posture by minimum jerk, each for
a random time: one hand or both somewhere over the table, or standing anywhere in the area with
the arms anywhere comfortable.

Source: ours. METHOD 3.4 knows tasks only; what recorded people do besides (METHOD 3.4's motion
capture) is the reason, their data is not used.
"""

import math

import numpy as np

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import BodySize
from app.sim.mocap.importer import Motion
from app.sim.primitives.phase import min_jerk

TRACK_S = 60.0
"""Length of one roamer's motion [s]."""
DT = 0.04
"""Step between samples [s]."""
P_OVER_TABLE = 0.6
"""Share of the postures with a hand over the table."""
P_BOTH = 0.35
"""Share of these in which the other hand is over the table too."""
DEEPEST = 0.75
"""How far over the table from its edge a hand goes [m]."""
HIGHEST = 0.45
"""How high over the table [m]."""
BACK = 0.6
"""How far behind the working area a roamer may stand [m]."""
TURN = 0.7
"""Standard deviation of where a standing roamer looks [rad]."""
WALK, SPIN = 0.8, 1.6
"""Paces of walking [m/s] and turning [rad/s]."""
PACE = (0.3, 1.2)
"""Least and greatest mean pace of a hand [m/s]."""
HOLDS = (0.0, 4.0)
"""Least and greatest time for which a posture is held [s]."""
ARM_LOW = np.array([-0.2, 0.05, -0.5, 0.1])
ARM_HIGH = np.array([1.3, 0.8, 0.6, 1.8])
"""Range of the angles of an arm that does nothing certain [rad]."""


def roaming(cell: Cell, size: BodySize, seed: int, n: int) -> tuple[Motion, ...]:
    """Return motions of people who roam about a cell's worker's place.

    Args:
        cell: Work cell with a worker.
        size: Size of the people.
        seed: Seed of all of them.
        n: How many.
    """
    return tuple(
        _motion(cell, size, np.random.default_rng([seed, number]), number)
        for number in range(n)
    )


def _motion(cell: Cell, size: BodySize, rng: np.random.Generator, number: int) -> Motion:
    vector = size.vector(cell.floor_z)
    q = _posture(cell, vector, rng)
    rows: list[Vec] = [np.repeat(q[None], _steps(rng.uniform(*HOLDS)), axis=0)]
    while sum(len(part) for part in rows) * DT < TRACK_S:
        then = _posture(cell, vector, rng)
        x = np.arange(1, _steps(_seconds(q, then, vector, rng)) + 1)
        rows.append(q + min_jerk(x / len(x))[:, None] * (then - q))
        rows.append(np.repeat(then[None], _steps(rng.uniform(*HOLDS)), axis=0))
        q = then
    stacked = np.concatenate(rows)[: int(TRACK_S / DT) + 1]
    return Motion(
        name=f"roamer-{number}",
        source="drawn",
        times=DT * np.arange(len(stacked), dtype=np.float64),
        q=stacked,
        pelvis_z=np.zeros(len(stacked)),
        size=size,
        first_frame=0,
    )


def _steps(seconds: float) -> int:
    return max(1, round(seconds / DT))


def _seconds(q: Vec, then: Vec, size: Vec, rng: np.random.Generator) -> float:
    """Draw how long the way between two postures takes [s]."""
    before, after = (human.joint_points(one, size) for one in (q, then))
    way = max(float(np.linalg.norm(after[p] - before[p])) for p in ("hand_r", "hand_l"))
    walk, turn = float(np.linalg.norm(then[:2] - q[:2])), abs(float(then[2] - q[2]))
    return max(way / rng.uniform(*PACE), walk / WALK, turn / SPIN, 0.4)


def _posture(cell: Cell, size: Vec, rng: np.random.Generator) -> Vec:
    """Draw a posture: reaching over the table, or standing somewhere."""
    area, yaw = cell.human, cell.human.home[2]
    x = float(rng.uniform(area.x_min, area.x_max))
    if rng.random() >= P_OVER_TABLE:
        y = float(rng.uniform(area.y_min, area.y_max + BACK))
        q = human.rest_posture(x, y, yaw + rng.normal(0.0, TURN))
        q[10:14] = rng.uniform(ARM_LOW, ARM_HIGH)
        q[14:18] = rng.uniform(ARM_LOW, ARM_HIGH)
        q[3:6] += rng.normal(0.0, (0.12, 0.06, 0.15))
        return np.clip(q, human.Q_MIN, human.Q_MAX)
    y = float(rng.uniform(area.y_min, area.y_min + 0.2))
    q = human.rest_posture(x, y, yaw + rng.normal(0.0, 0.25))
    q[10:14] = rng.uniform(ARM_LOW, ARM_HIGH)
    q[14:18] = rng.uniform(ARM_LOW, ARM_HIGH)
    right: Vec | None = _over_table(cell, x, -1.0, rng)
    left: Vec | None = _over_table(cell, x, 1.0, rng)
    if rng.random() >= P_BOTH:
        right, left = (right, None) if rng.random() < 0.6 else (None, left)
    swivel = float(rng.uniform(0.0, 0.9))
    return human.solve_hands(q, size, right=right, left=left, swivel=swivel).q


def _over_table(cell: Cell, x: float, side: float, rng: np.random.Generator) -> Vec:
    """Draw a point over the table within reach of somebody who stands at ``x`` [m], (3,)."""
    table = cell.table
    aside = x + side * 0.15 + rng.normal(0.0, 0.2)
    return np.array(
        [
            np.clip(aside, table.x_min, table.x_max),
            table.y_max - DEEPEST * math.sqrt(rng.random()),
            rng.uniform(0.03, HIGHEST),
        ]
    )
