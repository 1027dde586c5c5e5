"""Postures of a person at the positions of a grid, for maps of choice and risk."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.person import Person

NOT_REACHED = "unreachable"
"""Reason for a position that the hand does not reach."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonGrid:
    """Positions of a person's pelvis, or of one palm."""

    x: Vec
    """Positions along x [m], shape (nx,)."""
    y: Vec
    """Positions along y [m], shape (ny,)."""
    hand: human.Hand | None = None
    """The moved hand; None: the whole person is moved, with the same yaw. A person given by a
    cylinder faces the robot base at each position."""
    z: float = 0.0
    """Height of the palm [m]."""

    @property
    def shape(self) -> tuple[int, int]:
        """Number of positions along y and x."""
        return len(self.y), len(self.x)

    def postures(
        self, person: Person, size: Vec | None = None
    ) -> tuple[Vec, NDArray[np.bool_]]:
        """Return the posture at each position, and whether it is reached.

        Args:
            size: The person's body dimensions [m], shape (12,); needed where a hand is moved.

        Returns:
            Joint positions [m, rad], shape (ny nx, 18), and flags, shape (ny nx,).
        """
        y, x = (values.ravel() for values in np.meshgrid(self.y, self.x, indexing="ij"))
        q, reached = np.tile(person.q, (len(x), 1)), np.ones(len(x), dtype=bool)
        if self.hand is None:
            q[:, 0], q[:, 1] = x, y
            if person.cylinder is not None:
                q[:, 2] = np.arctan2(-y, -x)
            return q, reached
        if size is None:
            raise ValueError("size must be given where a hand is moved")
        for i, point in enumerate(np.column_stack([x, y, np.full(len(x), self.z)])):
            found = human.reach(self.hand, point, person.q, size)
            q[i], reached[i] = found.q, found.reached
        return q, reached
