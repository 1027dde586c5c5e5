"""Results of full sorting tasks, and the throughput that they imply."""

from dataclasses import dataclass
from typing import Any

from app.policies.evaluation.statistics import (
    Flags,
    Index,
    count_of,
    mean_of,
    rate_of,
    ratio_values,
)
from app.sim.core.arrays import Vec


@dataclass(frozen=True, slots=True, kw_only=True)
class FullTasks:
    """Results of n full tasks under one order rule; arrays of shape (n,)."""

    finished: Flags
    """Whether the goal was reached within ``LIMIT_S``."""
    cycle_s: Vec
    """Time to the goal, or ``LIMIT_S`` [s]."""
    moving: Index
    """Contacts of the moving robot."""
    resting: Index
    """Contacts of the robot at standstill."""
    stopped: Vec
    """Share of the control periods with override 0."""
    parts: Index
    """Objects set down in their places."""
    attempts: Index
    """Grasps."""
    late: Index
    """Motions that reached the time limit."""
    options: Index
    """Objects to choose among, summed over the grasps."""

    def row(self, name: str) -> dict[str, Any]:
        """Return the result row of these tasks, with 95 % intervals."""
        return {
            "name": name,
            "n": len(self.finished),
            "finished": rate_of(self.finished),
            "without_moving_contact": rate_of((self.moving == 0) & self.finished),
            "moving_contacts": count_of(self.moving),
            "contacts_at_rest": count_of(self.resting),
            "stopped": mean_of(self.stopped),
            "late_motions": count_of(self.late),
            "grasps": mean_of(self.attempts),
            "options_per_grasp": float(self.options.sum() / max(1, self.attempts.sum())),
            "cycle_time_s": mean_of(self.cycle_s[self.finished]),
        }

    def throughput(self) -> Vec:
        """Return values per task whose mean is the number of parts per hour, shape (n,).

        The estimate is the ratio of all parts to the whole time, tasks that were not finished
        included; see :func:`ratio_values`.
        """
        return ratio_values(self.parts, self.cycle_s / 3600.0)
