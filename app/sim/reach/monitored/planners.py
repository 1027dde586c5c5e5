"""Planners in place of a policy, under the same safety layer and limits (docs/method.md 2.6).

One :class:`~app.sim.planning.replanning.ReplanningExecutor` drives each environment of a
:class:`~app.sim.reach.monitored.batch.MonitoredReachBatch` to configurations of any tilt whose
tcp lies within the success distance of the goal, as a policy may.
"""

from collections.abc import Sequence

import numpy as np

from app.sim.collision.checker import no_people
from app.sim.core.arrays import Vec
from app.sim.planning.replanning import ReplanningExecutor, ReplanningSettings
from app.sim.reach.monitored.batch import MonitoredReachBatch
from app.sim.scenario.kernels.episode import RUNNING

GOAL_SPREAD = 0.08
"""Largest distance of the tcp from the goal at a planner's goal configurations [m]."""


def drive_planner(
    batch: MonitoredReachBatch,
    q_goals: Sequence[Vec],
    settings: ReplanningSettings,
    seed: int,
    *,
    blind: bool = False,
) -> list[Vec]:
    """Drive every environment of a batch that was just reset to the end of its episode.

    Args:
        batch: Environments at the start of their episodes.
        q_goals: Goal configurations of each environment [rad], shape (k, 6) each.
        settings: Planner, role and margins.
        blind: Whether the planner ignores people.

    Returns:
        Override of each period of each environment, in [0, 1].
    """
    state, overrides = batch.state, []
    for row in range(batch.n_envs):
        executor = ReplanningExecutor(batch.arm, q_goals[row], settings, seed + 1000 * row)
        found = []
        while state.outcome[row] == RUNNING:
            people = no_people() if blind else batch.people_shapes(row)
            q, qd = state.q[row].copy(), state.qd[row].copy()
            batch.step_speeds(row, executor.act(q, qd, people, float(state.elapsed[row])))
            found.append(float(batch.override[row]))
        overrides.append(np.array(found))
    return overrides
