"""Rules of the recipes of the thesis: blocked arms, and joint limits (docs/method.md 2.5)."""

import math
from dataclasses import dataclass

from app.sim.cells.cell import Cell

_TURN, _HALF = 2.0 * math.pi, math.pi
AUTHORS_LIMITS = {
    "q_min": (-_TURN, -_TURN, -_TURN, -_HALF, -_HALF, -_HALF),
    "q_max": (_TURN, _TURN, _TURN, _HALF, _HALF, _HALF),
    "qdd_max": (100.0,) * 6,
}
"""Joint ranges of the authors' code [rad], with an elbow that folds further than the tested
pairs of capsules cover (``robot/capsules.py``); no limit of acceleration: at 1 rad/s and 50 Hz
any speed is reached within a period [rad/s^2]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockedRules:
    """Reward where a contact blocks the arm (``blocked_batch.py``)."""

    command_cost: float = 0.0
    """Cost of the norm of the action."""
    bonus_alone: bool = False
    """Whether the success bonus replaces the other terms."""


def with_authors_limits(cell: Cell) -> Cell:
    """Return a cell whose robot has the joint limits of the authors' code."""
    robot = cell.robot.model_copy(update=AUTHORS_LIMITS)
    return cell.model_copy(update={"robot": robot})
