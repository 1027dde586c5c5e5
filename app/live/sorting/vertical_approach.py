"""The last centimetres to a block or a place, and back up, by inverse kinematics.

Down in a funnel: the tool stays FUNNEL times its sideways error above the point, so that it
comes down upright from wherever the policy left it.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.sorting.layout import APPROACH_M, above

AT_M = 0.004
"""Distance at which the tool counts as down [m]."""
UP_M = 0.02
"""Distance below the point of approach at which it counts as up again [m]."""
FUNNEL = 2.0
"""Height over sideways error on the way down."""
DOWN_S, HOLD_S, UP_S = 4.0, 0.3, 2.0
"""Longest way down, rest of the magnet at a block, longest way up [s]."""


@dataclass(slots=True)
class VerticalApproach:
    """A way down and up again."""

    point: Vec
    """Where the tcp is when the magnet touches [m], shape (3,)."""
    phase: Literal["grasp", "place"]
    """What is done there."""
    step: Literal["down", "hold", "up"] = "down"
    """How far it is."""
    since: float = 0.0
    """When the step began, in the world's time in its status [s]."""

    def begin(self, step: Literal["hold", "up"], now: float) -> None:
        """Begin the next step at ``now`` [s]."""
        self.step, self.since = step, now

    def aim(self, tcp: Vec) -> Vec:
        """Return where the tcp shall go from where it is [m], shape (3,)."""
        if self.step == "up":
            return above(self.point)
        aside = float(np.linalg.norm((tcp - self.point)[:2]))
        return above(self.point, min(APPROACH_M, FUNNEL * max(aside - AT_M, 0.0)))

    def is_over(self, tcp: Vec, now: float) -> bool:
        """Whether the step is done, or has taken too long.

        Args:
            tcp: Where the tcp is [m], shape (3,).
            now: The world's time in its status [s].
        """
        age = now - self.since
        if self.step == "down":
            return self.is_down(tcp) or age > DOWN_S
        if self.step == "hold":
            return age >= HOLD_S
        return age > UP_S or bool(tcp[2] > self.point[2] + APPROACH_M - UP_M)

    def is_down(self, tcp: Vec) -> bool:
        """Whether the tcp is at the point."""
        return bool(np.linalg.norm(tcp - self.point) < AT_M)
