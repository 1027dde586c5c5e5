"""A recorded motion, played in a cell at the pace it was recorded.

The run is put down at a person's place at the table (``worker_motion.at_the_table``); its path
is kept in metres, wherever it leads, and the body is where it was recorded, even where that
takes an angle beyond the model's limits. Policies are told angles inside the limits; how often
that differs, and by how much at the wrists, is told.
"""

import math
from typing import NamedTuple

import numpy as np

from app.live.snapshot import PlaybackSnapshot
from app.sim.cells.cell import Cell
from app.sim.cells.people import Worker
from app.sim.core.arrays import Vec
from app.sim.human.model import Q_MAX, Q_MIN
from app.sim.mocap.importer import Motion
from app.sim.mocap.joint_centres import WRIST_L, WRIST_R, model_points
from app.sim.people.human_motion_config import at_the_table

YAW = 2
"""Place of the pelvis's yaw, which has no limit while a motion is played."""
FASTEST = 50.0
"""Greatest speed of a joint that is told, and that a policy takes [m/s, rad/s]."""
HALF_SPAN_S = 0.025
"""Half of the time over which speeds are taken [s]."""


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
    """One run of a recording, played in a cell.

    Args:
        recording: The run.
        place: Cell with the home position of the person.
        worker: Person whose walking area the run may leave.
    """

    def __init__(self, recording: Recording, place: Cell, worker: Worker) -> None:
        motion = recording.motion
        self.size = motion.size
        """Lengths of the recorded person."""
        self.duration = float(motion.times[-1])
        """Of the run [s]."""
        self._recording = recording
        path = at_the_table(motion, place).q
        self._times, self._rise = motion.times, motion.pelvis_z
        self._q = path.copy()
        told = np.clip(path, Q_MIN, Q_MAX)
        told[:, YAW] = path[:, YAW]
        clipped = np.abs(told - path)[:, YAW + 1 :].max(axis=1) > 1e-6
        self._clipped_share = float(clipped.mean())
        wrists = [
            model_points(q, motion.pelvis_z, motion.size)[:, [WRIST_R, WRIST_L]]
            for q in (path, told)
        ]
        self._clipped_m = float(np.linalg.norm(wrists[1] - wrists[0], axis=2).max())
        self._outside_share = float(np.mean([is_outside(q, worker) for q in self._q]))

    def at(self, t: float) -> tuple[Vec, Vec]:
        """Return joint positions [m, rad] and speeds [m/s, rad/s] at ``t`` [s], (18,) each.

        Speeds are held within ``FASTEST``: where a shoulder's axes line up, its angles turn
        faster than any joint, though the arm does not.
        """
        start = max(t - HALF_SPAN_S, 0.0)
        end = min(max(t, 0.0) + HALF_SPAN_S, self.duration)
        span = max(end - start, 1e-9)
        speed = (self._between(end) - self._between(start)) / span
        return self._between(t), np.clip(speed, -FASTEST, FASTEST)

    def rise_at(self, t: float) -> float:
        """Return the height of the pelvis above standing at ``t`` [s] [m]."""
        return float(np.interp(t, self._times, self._rise))

    def _between(self, t: float) -> Vec:
        k = int(np.searchsorted(self._times, t, side="right")) - 1
        k = min(max(k, 0), len(self._times) - 2)
        share = (t - self._times[k]) / (self._times[k + 1] - self._times[k])
        share = min(max(float(share), 0.0), 1.0)
        return np.asarray(self._q[k] + share * (self._q[k + 1] - self._q[k]))

    def turn_near(self, yaw: float) -> None:
        """Turn the whole run by full turns so that it begins with a yaw near ``yaw`` [rad]."""
        full = 2.0 * math.pi
        self._q[:, YAW] += full * round((yaw - self._q[0, YAW]) / full)

    def view(self, t: float) -> PlaybackSnapshot:
        """Return what is known of it at ``t`` [s]."""
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


def is_outside(q: Vec, worker: Worker, slack: float = 0.02) -> bool:
    """Whether a pelvis lies outside a person's walking area by more than ``slack`` [m].

    Args:
        q: Joint positions [m, rad], shape (18,).
        worker: Whose area.
        slack: Distance that is not minded [m].
    """
    x, y = float(q[0]), float(q[1])
    inside_x = worker.x_min - slack <= x <= worker.x_max + slack
    return not (inside_x and worker.y_min - slack <= y <= worker.y_max + slack)
