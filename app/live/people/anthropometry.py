"""Body dimensions of a live person, which change continuously.

Dimensions follow from the percentiles requested last, or are those of a recorded person during
playback. The contact test of a period uses the present lengths.
"""

import numpy as np

from app.live.snapshot import AnthropometrySnapshot
from app.sim.cells.people import Worker
from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import BodySize, percentile_body
from app.sim.human.kernels.kinematics import PELVIS_Z

RESIZE_S = 0.5
"""Duration of a change of size [s]."""
RISE_RATE = 0.6
"""Maximum vertical speed of the pelvis between motions [m/s]."""


class LiveAnthropometry:
    """Body lengths and pelvis height of one live person, those of ``worker`` at first."""

    def __init__(self, worker: Worker, floor_z: float) -> None:
        self._floor_z, self._pelvis = floor_z, worker.pelvis_height
        self.percentiles = (worker.stature, worker.arms, worker.shoulders)
        """Percentiles of stature, arms and shoulders, as requested last."""
        self._recorded: BodySize | None = None
        self._lengths = self._goal = worker.size.vector(floor_z)
        self._left_s = 0.0
        self.rise = 0.0
        """Height of the pelvis relative to standing [m]."""

    @property
    def size(self) -> Vec:
        """Present body lengths [m], shape (N_SIZE,)."""
        size = self._lengths.copy()
        size[PELVIS_Z] += self.rise
        return size

    @property
    def settled(self) -> bool:
        """Whether the change of size is complete."""
        return self._left_s == 0.0

    def resize(self, stature: float, arms: float, shoulders: float) -> None:
        """Change to a person of these percentiles."""
        self.percentiles, self._recorded = (stature, arms, shoulders), None
        self._start_change(self._requested())

    def use_recorded(self, recorded: BodySize | None) -> None:
        """Change to the lengths of a recorded person, or with None back to the percentiles."""
        self._recorded = recorded
        self._start_change(self._requested())

    def _requested(self) -> BodySize:
        return self._recorded or percentile_body(*self.percentiles, pelvis=self._pelvis)

    def _start_change(self, size: BodySize) -> None:
        goal = size.vector(self._floor_z)
        if not np.array_equal(goal, self._goal):
            self._goal, self._left_s = goal, RESIZE_S

    def advance_size(self, dt: float) -> bool:
        """Continue the change of size for ``dt`` [s]; return whether a length changed."""
        if self.settled:
            return False
        share = min(dt / self._left_s, 1.0)
        self._left_s = 0.0 if share == 1.0 else self._left_s - dt
        step = share * (self._goal - self._lengths)
        self._lengths = self._goal if self.settled else self._lengths + step
        return True

    def rise_to(self, rise: float, dt: float) -> bool:
        """Move the pelvis toward a height relative to standing [m]; return whether it moved."""
        step = float(np.clip(rise - self.rise, -RISE_RATE * dt, RISE_RATE * dt))
        self.rise += step
        return step != 0.0

    def snapshot(self) -> AnthropometrySnapshot:
        """Return the read model of the requested dimensions."""
        recorded = self._recorded is not None
        return anthropometry_snapshot(self._requested(), self.percentiles, recorded=recorded)


def anthropometry_snapshot(
    size: BodySize, percentiles: tuple[float, float, float], *, recorded: bool
) -> AnthropometrySnapshot:
    """Return the read model of a size and its percentiles of stature, arms and shoulders."""
    stature, arms, shoulders = percentiles
    return AnthropometrySnapshot(
        stature=stature,
        arms=arms,
        shoulders=shoulders,
        recorded=recorded,
        stature_m=size.stature,
        trunk_m=size.trunk,
        arm_m=0.5 * (size.arm("r") + size.arm("l")),
        shoulders_m=size.clavicle_r + size.clavicle_l,
    )
