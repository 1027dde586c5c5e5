"""Planners in place of a policy, under the same safety layer and limits (docs/method.md 2.6).

One :class:`~app.sim.planning.replanning.ReplanningExecutor` drives each environment of a
:class:`~app.sim.reach.monitored.batch.MonitoredReachBatch` to configurations of any tilt whose
tcp lies within the success distance of the goal, as a policy may.
"""

from collections.abc import Sequence

import numpy as np

from app.sim.collision.checker import Shapes, no_people
from app.sim.core.arrays import Vec
from app.sim.planning.goal_configurations import goal_configurations
from app.sim.planning.replanning import ReplanningExecutor, ReplanningReport, ReplanningSettings
from app.sim.reach.monitored.batch import MonitoredReachBatch
from app.sim.robot.kernels.arm import Arm
from app.sim.scenario.kernels.episode import RUNNING

GOAL_SPREAD = 0.08
"""Largest distance of the tcp from the goal at a planner's goal configurations [m]."""


def goal_configurations_of(arm: Arm, goals: Vec, seed: int) -> list[Vec]:
    """Return the configurations at each goal that a planner may choose [rad], (k, 6) each.

    Args:
        arm: From ``scene.arm_of``.
        goals: Goals [m], shape (n, 3).
        seed: Seed of the search; (seed, index) determines those of a goal.
    """
    return [
        goal_configurations(arm, goal, np.random.default_rng([seed, k]), spread=GOAL_SPREAD)
        for k, goal in enumerate(goals)
    ]


def drive_planner(
    batch: MonitoredReachBatch,
    q_goals: Sequence[Vec],
    settings: ReplanningSettings,
    seed: int,
    *,
    blind: bool = False,
) -> tuple[list[Vec], list[ReplanningReport]]:
    """Drive every environment of a batch that was just reset to the end of its episode.

    Args:
        batch: Environments at the start of their episodes.
        q_goals: Goal configurations of each environment [rad], shape (k, 6) each.
        settings: Planner, role and margins.
        blind: Whether the planner ignores people.

    Returns:
        Override of each period of each environment, in [0, 1], and the planners' reports.
    """
    overrides, reports = [], []
    for row in range(batch.n_envs):
        executor = ReplanningExecutor(batch.arm, q_goals[row], settings, seed + 1000 * row)
        overrides.append(_drive(batch, row, executor, blind))
        reports.append(executor.report)
    return overrides, reports


def _drive(
    batch: MonitoredReachBatch, row: int, executor: ReplanningExecutor, blind: bool
) -> Vec:
    """Drive environment ``row`` to the end of its episode; return its overrides in [0, 1]."""
    state, found = batch.state, []
    while state.outcome[row] == RUNNING:
        people: Shapes = no_people() if blind else batch.people_shapes(row)
        q, qd = state.q[row].copy(), state.qd[row].copy()
        wanted = executor.act(q, qd, people, float(state.elapsed[row]))
        batch.step_speeds(row, wanted)
        found.append(float(batch.override[row]))
    return np.array(found)
