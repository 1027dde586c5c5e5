"""Motion of a dragged person.

The posture follows its target by a first-order low-pass filter with bounded joint speeds, so
that observed speeds and positions are consistent although targets jump.
"""

import numpy as np

from app.live.commands import MovePerson
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human

LAG_S = 0.1
"""Time constant of the filter [s]."""
Q_RATE = np.array([1.2, 1.2, 2.5, *([1.5] * 3), *([1.5] * 4), *([4.0] * 8)])
"""Maximum joint speeds [m/s, rad/s]: walking, turning, bending, arms; shape (18,)."""
STEP_BACK, STEP_ASIDE = 0.8, 0.6
"""Margins of the walking area for dragging: away from the table, and to the sides [m]."""


class DraggedPerson:
    """Joint positions and speeds of one person that follows targets."""

    def __init__(self, cell: Cell, q: Vec) -> None:
        self._cell = cell
        self.q = np.array(q)
        """Joint positions [m, rad], shape (18,)."""
        self.qd = np.zeros(18)
        """Joint speeds [m/s, rad/s], shape (18,)."""
        self._target = np.array(q)
        self._hands: dict[str, Vec] = {}

    def place(self, q: Vec, qd: Vec) -> None:
        """Set posture [m, rad] and speed [m/s, rad/s]; the posture becomes the target."""
        self.q, self.qd, self._target = np.array(q), np.array(qd), np.array(q)
        self._hands.clear()

    def turn_near(self, yaw: float) -> None:
        """Shift the yaw by full turns so that its target is nearest to ``yaw`` [rad]."""
        full = 2.0 * np.pi
        shift = full * round((yaw - float(self._target[2])) / full)
        for posture in (self.q, self._target):
            posture[2] += shift

    def aim(self, q: Vec) -> None:
        """Set the target posture [m, rad], shape (18,)."""
        self._target = np.array(q)

    def drag(self, command: MovePerson, size: Vec) -> None:
        """Set the target of a person of body lengths ``size`` [m], shape (12,).

        Hands that were dragged before keep their targets.
        """
        pelvis = (
            self._walkable(command.pelvis)
            if command.pelvis is not None
            else (float(self._target[0]), float(self._target[1]), float(self._target[2]))
        )
        self._carry_hands(pelvis)
        for hand, point in (("r", command.right), ("l", command.left)):
            if point is not None:
                self._hands[hand] = np.array(point)
        posture = human.solve_hands(
            self._target,
            size,
            right=self._hands.get("r"),
            left=self._hands.get("l"),
            pelvis=pelvis,
        )
        self._target = posture.q

    def _walkable(self, pelvis: tuple[float, float, float]) -> tuple[float, float, float]:
        area = self._cell.human
        x = float(np.clip(pelvis[0], area.x_min - STEP_ASIDE, area.x_max + STEP_ASIDE))
        y = float(np.clip(pelvis[1], area.y_min, area.y_max + STEP_BACK))
        turn = (pelvis[2] - float(self._target[2]) + np.pi) % (2.0 * np.pi) - np.pi
        self.turn_near(area.home[2] - turn)  # the yaw stays within its joint limits
        return x, y, float(self._target[2]) + turn

    def _carry_hands(self, pelvis: tuple[float, float, float]) -> None:
        """Move the targets of hands rigidly with the pelvis."""
        turn = pelvis[2] - self._target[2]
        c, s = np.cos(turn), np.sin(turn)
        for hand, point in self._hands.items():
            x, y = point[:2] - self._target[:2]
            moved = [pelvis[0] + c * x - s * y, pelvis[1] + s * x + c * y, point[2]]
            self._hands[hand] = np.array(moved)

    @property
    def arrived(self) -> bool:
        """Whether the posture is within 1 cm and 0.01 rad of its target."""
        return bool(np.abs(self._target - self.q).max() < 0.01)

    def follow(self, dt: float) -> bool:
        """Move for ``dt`` [s]; return whether a joint moved."""
        step = (self._target - self.q) * (1.0 - np.exp(-dt / LAG_S))
        step = np.clip(step, -Q_RATE * dt, Q_RATE * dt)
        step[np.abs(self._target - self.q) < 1e-5] = 0.0
        moved = bool(np.any(step) or np.any(self.qd))
        self.q = self.q + step
        self.qd = step / dt
        return moved
