"""Goal of a live reach cell: position and choice of the next one."""

import numpy as np

from app.live.reach.commands import goal_box
from app.live.reach.snapshot import GoalMode
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.reach.batch import goal_region_of

APART_M = 0.25
"""Minimum distance between successive goals [m]."""
TRIES = 40
ON_TARGET_M = 1e-3


class LiveGoal:
    """Target of the tcp."""

    def __init__(self, cell: Cell, seed: int) -> None:
        self.targets = goal_region_of(cell).targets()
        """The cell's targets [m], shape (n, 3)."""
        self.among: Vec | None = None
        """Goals to draw from [m], shape (n, 3); None: any point of the goal region."""
        self.mode: GoalMode = "jump"
        """Rule for the next goal."""
        self._low, self._high = goal_box(cell)
        self._seed = seed
        self.restart()

    def restart(self) -> None:
        """Restart the sequence of goals."""
        self._rng = np.random.default_rng(self._seed)
        self.position = self.targets[len(self.targets) // 2].copy()
        self.jump()

    def jump(self) -> None:
        """Draw another goal at a distance of APART_M or more."""
        for _ in range(TRIES):
            new = self._drawn()
            if float(np.linalg.norm(new - self.position)) >= APART_M:
                break
        self.position = new

    def _drawn(self) -> Vec:
        if self.among is None:
            return np.asarray(self._rng.uniform(self._low, self._high))
        return np.array(self.among[self._rng.integers(len(self.among))])

    def put(self, position: tuple[float, float, float]) -> None:
        """Set the position [m], clipped to the goal region."""
        self.position = np.clip(np.array(position), self._low, self._high)

    @property
    def on_target(self) -> bool:
        """Whether the goal is one of the targets."""
        gaps = np.linalg.norm(self.targets - self.position, axis=1)
        return bool(gaps.min() < ON_TARGET_M)
