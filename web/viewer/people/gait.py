"""Steps of the mannequin's feet; for display only.

A foot rests until the body is farther from it than ``STRIDE``, then swings to its new position
while the other foot rests. The simulator knows vertical leg capsules only.
"""

import math

import numpy as np

from app.sim.core.arrays import Vec
from web.viewer.people.skeleton import SIDES, rest_feet

STRIDE = 0.11
"""Distance of a foot from its rest position beyond which it takes a step [m]."""
TURN = 0.45
"""Angle of a foot from its rest direction beyond which it takes a step [rad]."""
FAR = 0.3
"""Distance beyond which a foot is placed without a step [m]."""
SWING_S, LIFT = 0.26, 0.06


class Gait:
    """Two feet that follow a pelvis."""

    def __init__(self, floor_z: float) -> None:
        self._floor_z = floor_z
        self.feet: dict[str, Vec] = {}
        """T_world_foot by side; the origin is the ankle."""
        self._planted: dict[str, Vec] = {}
        self._swing: dict[str, float] = {}

    def follow(self, pelvis: Vec, dt: float, girth: float = 1.0) -> bool:
        """Move the feet after the pelvis.

        Args:
            pelvis: T_world_pelvis, shape (4, 4).
            dt: Time since the last call [s].
            girth: Size of the legs relative to the median person's.

        Returns:
            Whether a foot moved.
        """
        goal = rest_feet(pelvis, self._floor_z, girth)
        if not self.feet:
            self.feet = goal
            self._planted = {side: foot.copy() for side, foot in goal.items()}
            return True
        moved = False
        for side in set(SIDES) - set(self._swing):
            if self.feet[side][2, 3] != goal[side][2, 3]:  # soles stay on the floor
                self.feet[side][2, 3] = self._planted[side][2, 3] = goal[side][2, 3]
                moved = True
        offsets = {side: self._offset(side, goal[side]) for side in SIDES}
        for side in sorted(SIDES, key=lambda name: -offsets[name]):
            if side in self._swing:
                self._advance(side, goal[side], dt)
                moved = True
            elif offsets[side] > FAR / STRIDE:
                self._plant(side, goal[side])
                moved = True
            elif offsets[side] > 1.0 and not self._swing:
                self._swing[side] = 0.0
        return moved

    def _offset(self, side: str, goal: Vec) -> float:
        """Return the distance of a resting foot from its rest pose; it steps from 1 on."""
        foot = self._planted[side]
        away = float(np.linalg.norm(goal[:3, 3] - foot[:3, 3])) / STRIDE
        cosine = float(np.clip(goal[:3, 0] @ foot[:3, 0], -1.0, 1.0))
        return max(away, math.acos(cosine) / TURN)

    def _advance(self, side: str, goal: Vec, dt: float) -> None:
        share = self._swing[side] = self._swing[side] + dt / SWING_S
        if share >= 1.0:
            self._plant(side, goal)
            return
        smooth = share * share * (3.0 - 2.0 * share)
        start = self._planted[side]
        foot = goal.copy()
        foot[:3, 3] = start[:3, 3] + smooth * (goal[:3, 3] - start[:3, 3])
        foot[2, 3] += LIFT * math.sin(math.pi * share)
        self.feet[side] = foot

    def _plant(self, side: str, goal: Vec) -> None:
        self._swing.pop(side, None)
        self.feet[side], self._planted[side] = goal, goal.copy()
