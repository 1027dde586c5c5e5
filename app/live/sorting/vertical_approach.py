"""Vertical approach to a block or place, and retreat, by inverse kinematics.

The approach is a funnel: the height of the target above the point is FUNNEL times the
horizontal error, so that the tool descends vertically from any start position.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.sorting.layout import APPROACH_M, above

AT_M = 0.004
"""Distance to the point at which the tool is down [m]."""
UP_M = 0.02
"""Distance below the end of the retreat at which the tool is up [m]."""
FUNNEL = 2.0
"""Ratio of height to horizontal error."""
DOWN_S, HOLD_S, UP_S = 4.0, 0.3, 2.0
"""Time limit of the approach, duration of the grasp, time limit of the retreat [s]."""


@dataclass(slots=True)
class VerticalApproach:
    """Approach, gripper action and retreat."""

    point: Vec
    """Position of the tcp at contact with the block [m], shape (3,)."""
    phase: Literal["grasp", "place"]
    """Action of the gripper."""
    step: Literal["down", "hold", "up"] = "down"
    """Present step."""
    since: float = 0.0
    """Start of the step, as time in the present status [s]."""

    def begin(self, step: Literal["hold", "up"], now: float) -> None:
        """Start the next step at ``now`` [s]."""
        self.step, self.since = step, now

    def aim(self, tcp: Vec) -> Vec:
        """Return the target of the tcp for its present position [m], shape (3,)."""
        if self.step == "up":
            return above(self.point)
        error = float(np.linalg.norm((tcp - self.point)[:2]))
        return above(self.point, min(APPROACH_M, FUNNEL * max(error - AT_M, 0.0)))

    def is_over(self, tcp: Vec, now: float) -> bool:
        """Return whether the step is complete or has timed out.

        Args:
            tcp: Position of the tcp [m], shape (3,).
            now: Time in the present status [s].
        """
        age = now - self.since
        if self.step == "down":
            return self.is_down(tcp) or age > DOWN_S
        if self.step == "hold":
            return age >= HOLD_S
        return age > UP_S or bool(tcp[2] > self.point[2] + APPROACH_M - UP_M)

    def is_down(self, tcp: Vec) -> bool:
        """Return whether the tcp is at the point."""
        return bool(np.linalg.norm(tcp - self.point) < AT_M)
