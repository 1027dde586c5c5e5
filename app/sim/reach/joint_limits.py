"""Joint limits of the thesis' authors (docs/method.md 2.5)."""

import math

from app.sim.cells.cell import Cell

_TURN, _HALF = 2.0 * math.pi, math.pi
AUTHORS_LIMITS = {
    "q_min": (-_TURN, -_TURN, -_TURN, -_HALF, -_HALF, -_HALF),
    "q_max": (_TURN, _TURN, _TURN, _HALF, _HALF, _HALF),
    "qdd_max": (100.0,) * 6,
}
"""Joint ranges of the authors' code [rad]; no limit of acceleration: at 1 rad/s and 50 Hz any
speed is reached within a period [rad/s^2]."""


def with_authors_limits(cell: Cell) -> Cell:
    """Return a cell whose robot has the joint limits of the authors' code."""
    robot = cell.robot.model_copy(update=AUTHORS_LIMITS)
    return cell.model_copy(update={"robot": robot})
