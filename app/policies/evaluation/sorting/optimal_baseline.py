"""Optimal baseline of sorting episodes: the exact planner's moves and expected attempts."""

from functools import cache

import numpy as np

from app.errors import SimulationError
from app.policies.evaluation.statistics import Index
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import SortingBatch
from app.sim.sorting.kernels.optimal_costs import measure_envs
from app.sim.sorting.kernels.planner import PlannerWork, new_work
from app.sim.sorting.kernels.planner_batch import TaskBatch, plan_tasks
from app.sim.sorting.state import SortingShape


@cache
def _work(shape: SortingShape) -> PlannerWork:
    return new_work(shape.n_slots, shape.n_colours, shape.n_sizes)


def measure(batch: SortingBatch, which: Index) -> tuple[Index, Vec]:
    """Return the fewest moves to the goal and the expected attempts, shape (m,) each.

    Args:
        batch: Tasks.
        which: Environments, shape (m,).

    Raises:
        SimulationError: The objects of an environment cannot form its goal.
    """
    fewest, attempts = np.zeros(len(which), dtype=np.int64), np.zeros(len(which))
    measure_envs(batch.envs, which, _work(batch.shape), fewest, attempts)
    if (fewest < 0).any():
        e = int(which[fewest.argmin()])
        raise SimulationError(f"environment {e} of seed {batch.seed}: goal is unreachable")
    return fewest, attempts


def choose_by_planner(batch: SortingBatch, which: Index) -> Index:
    """Return the exact planner's moves in environments that are not at their goals, (m,).

    Args:
        batch: Tasks.
        which: Environments, shape (m,).
    """
    envs, best = batch.envs, np.zeros(len(which), dtype=np.int64)
    tasks = TaskBatch(
        clutter=envs.clutter[which],
        towers=envs.towers[which],
        heights=envs.heights[which],
        goal=envs.goal[which],
        goal_heights=envs.goal_heights[which],
        fail=envs.fail[which],
    )
    plan_tasks(tasks, _work(batch.shape), best, np.zeros_like(best))
    return best
