"""Off-task motion: people that stand, turn away, or hold hands above the table.

Task primitives cover people at work. Recorded people also hold a hand over the table for
seconds, use both hands, turn away, walk off and return; policies trained on the task alone
generalise poorly to them. Off-task motion connects random postures by minimum jerk and holds
each for a random time: one or both hands over the table, or standing anywhere in the area.

Source: ours; motivated by recordings (docs/method.md 3.4), whose data is not used.
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
"""Length of one motion [s]."""
DT = 0.04
"""Sampling step [s]."""
P_OVER_TABLE = 0.6
"""Share of the postures with a hand over the table."""
P_BOTH = 0.35
"""Share of these with both hands over the table."""
DEEPEST = 0.75
"""Largest distance of a hand from the table's edge [m]."""
HIGHEST = 0.45
"""Largest height of a hand over the table [m]."""
BACK = 0.6
"""Extension of the standing area behind the working area [m]."""
TURN = 0.7
"""Standard deviation of the yaw of a standing person [rad]."""
WALK, SPIN = 0.8, 1.6
"""Speeds of walking [m/s] and turning [rad/s]."""
PACE = (0.3, 1.2)
"""Range of the mean hand speed [m/s]."""
HOLDS = (0.0, 4.0)
"""Range of the holding time of a posture [s]."""
ARM_LOW = np.array([-0.2, 0.05, -0.5, 0.1])
ARM_HIGH = np.array([1.3, 0.8, 0.6, 1.8])
"""Range of the joint angles of an idle arm [rad]."""


def off_task_motions(cell: Cell, size: BodySize, seed: int, n: int) -> tuple[Motion, ...]:
    """Return random off-task motions near the place of a cell's worker."""
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
        name=f"off-task-{number}",
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
    """Draw the duration of the move between two postures [s]."""
    before, after = (human.joint_points(one, size) for one in (q, then))
    distance = max(float(np.linalg.norm(after[p] - before[p])) for p in ("hand_r", "hand_l"))
    walk, turn = float(np.linalg.norm(then[:2] - q[:2])), abs(float(then[2] - q[2]))
    return max(distance / rng.uniform(*PACE), walk / WALK, turn / SPIN, 0.4)


def _posture(cell: Cell, size: Vec, rng: np.random.Generator) -> Vec:
    """Draw a posture: reaching over the table, or standing somewhere."""
    area, yaw = cell.human, cell.human.home[2]
    x = float(rng.uniform(area.x_min, area.x_max))
    stands = rng.random() >= P_OVER_TABLE
    y = float(rng.uniform(area.y_min, area.y_max + BACK if stands else area.y_min + 0.2))
    q = human.rest_posture(x, y, yaw + rng.normal(0.0, TURN if stands else 0.25))
    q[10:14] = rng.uniform(ARM_LOW, ARM_HIGH)
    q[14:18] = rng.uniform(ARM_LOW, ARM_HIGH)
    if stands:
        q[3:6] += rng.normal(0.0, (0.12, 0.06, 0.15))
        return np.clip(q, human.Q_MIN, human.Q_MAX)
    right: Vec | None = _over_table(cell, x, -1.0, rng)
    left: Vec | None = _over_table(cell, x, 1.0, rng)
    if rng.random() >= P_BOTH:
        right, left = (right, None) if rng.random() < 0.6 else (None, left)
    swivel = float(rng.uniform(0.0, 0.9))
    return human.solve_hands(q, size, right=right, left=left, swivel=swivel).q


def _over_table(cell: Cell, x: float, side: float, rng: np.random.Generator) -> Vec:
    """Draw a point over the table within reach of a person at ``x`` [m], shape (3,)."""
    table = cell.table
    aside = x + side * 0.15 + rng.normal(0.0, 0.2)
    return np.array(
        [
            np.clip(aside, table.x_min, table.x_max),
            table.y_max - DEEPEST * math.sqrt(rng.random()),
            rng.uniform(0.03, HIGHEST),
        ]
    )
