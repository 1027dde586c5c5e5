"""Playback of a recorded motion in a cell, in real time.

The run is placed at a person's home at the table (``human_motion_config.at_the_table``); its
path stays metric and may leave the walking area. The body follows the recording, also beyond
the joint limits of the model; policies observe angles clipped to the limits. The share of
clipped frames and the resulting error at the wrists are part of the snapshot.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.live.snapshot import PlaybackSnapshot
from app.sim.cells.cell import Cell
from app.sim.cells.people import Worker
from app.sim.core.arrays import Vec
from app.sim.human.model import Q_MAX, Q_MIN
from app.sim.mocap.importer import Motion
from app.sim.mocap.joint_centres import WRIST_L, WRIST_R, model_points
from app.sim.people.human_motion_config import at_the_table

YAW = 2
"""Index of the yaw of the pelvis, which is not clipped."""
FASTEST = 50.0
"""Limit of the joint speeds in snapshots and observations [m/s, rad/s]."""
HALF_SPAN_S = 0.025
"""Half of the interval of the finite differences of speeds [s]."""


class Recording(NamedTuple):
    """One run of a stored recording."""

    motion: Motion
    """The run."""
    name: str
    """Name of the recording."""
    run: int = 0
    """Index of the run."""
    n_runs: int = 1
    """Number of its clean runs."""


class PlayedMotion:
    """Playback of one run of a recording.

    Args:
        place: Cell with the home position of the person.
        worker: Person with the walking area.
    """

    def __init__(self, recording: Recording, place: Cell, worker: Worker) -> None:
        motion = recording.motion
        self.size = motion.size
        """Body lengths of the recorded person."""
        self.duration = float(motion.times[-1])
        """Duration of the run [s]."""
        self._recording = recording
        path = at_the_table(motion, place).q
        self._times, self._rise = motion.times, motion.pelvis_z
        self._q = path.copy()
        observed = np.clip(path, Q_MIN, Q_MAX)
        observed[:, YAW] = path[:, YAW]
        clipped = np.abs(observed - path)[:, YAW + 1 :].max(axis=1) > 1e-6
        self._clipped_share = float(clipped.mean())
        differs = (observed != path).any(axis=1)
        heights = motion.pelvis_z[differs]
        wrists = [
            model_points(q[differs], heights, motion.size)[:, [WRIST_R, WRIST_L]]
            for q in (path, observed)
        ]
        errors = np.linalg.norm(wrists[1] - wrists[0], axis=2)
        self._clipped_m = float(errors.max(initial=0.0))
        self._outside_share = float(is_outside(path, worker).mean())

    def at(self, t: float) -> tuple[Vec, Vec]:
        """Return joint positions [m, rad] and speeds [m/s, rad/s] at ``t`` [s], (18,) each.

        Speeds are clipped to ``FASTEST``: near the singularity of a shoulder its angles change
        faster than the arm moves.
        """
        start = max(t - HALF_SPAN_S, 0.0)
        end = min(max(t, 0.0) + HALF_SPAN_S, self.duration)
        span = max(end - start, 1e-9)
        speed = (self._between(end) - self._between(start)) / span
        return self._between(t), np.clip(speed, -FASTEST, FASTEST)

    def rise_at(self, t: float) -> float:
        """Return the height of the pelvis relative to standing at ``t`` [s], in m."""
        return float(np.interp(t, self._times, self._rise))

    def _between(self, t: float) -> Vec:
        # np.interp of a column copies all frames.
        k = int(np.searchsorted(self._times, t, side="right")) - 1
        k = min(max(k, 0), len(self._times) - 2)
        share = (t - self._times[k]) / (self._times[k + 1] - self._times[k])
        share = min(max(float(share), 0.0), 1.0)
        return np.asarray(self._q[k] + share * (self._q[k + 1] - self._q[k]))

    def turn_near(self, yaw: float) -> None:
        """Shift the yaw by full turns so that the run starts near ``yaw`` [rad]."""
        full = 2.0 * math.pi
        self._q[:, YAW] += full * round((yaw - self._q[0, YAW]) / full)

    def snapshot(self, t: float) -> PlaybackSnapshot:
        """Return the read model at ``t`` [s]."""
        return PlaybackSnapshot(
            name=self._recording.name,
            run=self._recording.run,
            n_runs=self._recording.n_runs,
            t_s=min(t, self.duration),
            duration_s=self.duration,
            outside_share=self._outside_share,
            clipped_share=self._clipped_share,
            clipped_m=self._clipped_m,
        )


def is_outside(q: Vec, worker: Worker) -> NDArray[np.bool_]:
    """Return whether a pelvis is outside a walking area by more than 0.02 m, shape (...).

    Args:
        q: Joint positions [m, rad], shape (..., 18).
        worker: Person with the walking area.
    """
    least = np.array([worker.x_min, worker.y_min]) - 0.02
    most = np.array([worker.x_max, worker.y_max]) + 0.02
    return np.asarray(np.any((q[..., :2] < least) | (q[..., :2] > most), axis=-1))
