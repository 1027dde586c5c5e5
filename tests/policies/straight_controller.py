"""A controller without learning: straight joint motion to a configuration at the goal."""

import numpy as np
from numpy.typing import NDArray

from app.sim.reach.batch import ReachBatch
from app.sim.robot.kernels.kinematics import ik_vertical_batch


class Straight:
    """Moves every robot straight to its goal and ignores people."""

    def __init__(self, gain: float = 3.0) -> None:
        self._gain = gain
        self.looked: list[np.ndarray] = []

    def acts(self, batch: ReachBatch) -> NDArray[np.float32]:
        posture, _ = ik_vertical_batch(batch.arm.lengths, batch.arm.limits, batch.state.goal)
        if batch.state.people.walkers.rows.shape[1]:
            self.looked.append(batch.state.people.walkers.rows[:, 0, :5].copy())
        return np.clip(self._gain * (posture - batch.state.q), -1, 1).astype(np.float32)
