"""How large a live person is, changed while the cell runs: lengths glide, they never jump.

A person has the percentiles that were asked for, or the lengths of a recorded person whose
motion is played. The contact test of each period uses the lengths of that moment.
"""

import numpy as np

from app.live.snapshot import AnthropometrySnapshot
from app.sim.cells.people import Worker
from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import BodySize, percentile_body
from app.sim.human.kernels.kinematics import PELVIS_Z

GLIDE_S = 0.5
"""Time in which one size becomes another [s]."""
RISE_RATE = 0.6
"""Greatest speed of the pelvis up and down between motions [m/s]."""


class LiveBody:
    """Lengths of one live person, and how high the pelvis is above standing.

    Args:
        worker: Whose size the person has at first.
        floor_z: Height of the floor [m].
    """

    def __init__(self, worker: Worker, floor_z: float) -> None:
        self._floor_z, self._pelvis = floor_z, worker.pelvis_height
        self._percentiles = (worker.stature, worker.arms, worker.shoulders)
        self._recorded: BodySize | None = None
        self._lengths = self._goal = worker.size.vector(floor_z)
        self._left_s = 0.0
        self.rise = 0.0
        """Height of the pelvis above standing [m]."""

    @property
    def percentiles(self) -> tuple[float, float, float]:
        """Percentiles of stature, arms and shoulders that were asked for last."""
        return self._percentiles

    @property
    def size(self) -> Vec:
        """The person's size at this moment, as kernels take it, shape (N_SIZE,)."""
        size = self._lengths.copy()
        size[PELVIS_Z] += self.rise
        return size

    @property
    def settled(self) -> bool:
        """Whether the lengths are those that were asked for."""
        return self._left_s == 0.0

    def resize(self, stature: float, arms: float, shoulders: float) -> None:
        """Glide to the person of these percentiles."""
        self._percentiles, self._recorded = (stature, arms, shoulders), None
        self._glide_to(self._wanted())

    def become(self, recorded: BodySize | None) -> None:
        """Glide to a recorded person's lengths; None goes back to the percentiles."""
        self._recorded = recorded
        self._glide_to(self._wanted())

    def _wanted(self) -> BodySize:
        return self._recorded or percentile_body(*self._percentiles, pelvis=self._pelvis)

    def _glide_to(self, size: BodySize) -> None:
        goal = size.vector(self._floor_z)
        if not np.array_equal(goal, self._goal):
            self._goal, self._left_s = goal, GLIDE_S

    def glide(self, dt: float) -> bool:
        """Go on gliding for ``dt`` [s]; return whether a length changed."""
        if self.settled:
            return False
        share = min(dt / self._left_s, 1.0)
        self._left_s = 0.0 if share == 1.0 else self._left_s - dt
        step = share * (self._goal - self._lengths)
        self._lengths = self._goal if self.settled else self._lengths + step
        return True

    def rise_to(self, rise: float, dt: float) -> bool:
        """Bring the pelvis nearer to a height above standing [m]; return whether it moved."""
        step = float(np.clip(rise - self.rise, -RISE_RATE * dt, RISE_RATE * dt))
        self.rise += step
        return step != 0.0

    def view(self) -> AnthropometrySnapshot:
        """Return what is known of the size that was asked for."""
        size = self._wanted()
        stature, arms, shoulders = self._percentiles
        return AnthropometrySnapshot(
            stature=stature,
            arms=arms,
            shoulders=shoulders,
            recorded=self._recorded is not None,
            stature_m=size.stature,
            trunk_m=size.trunk,
            arm_m=0.5 * (size.arm("r") + size.arm("l")),
            shoulders_m=size.clavicle_r + size.clavicle_l,
        )
