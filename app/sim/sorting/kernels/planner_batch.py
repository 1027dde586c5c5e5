"""Exact plans of the sorting task for batches (compiled)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.sorting.kernels.planner import (
    Objects,
    PlannerWork,
    Task,
    copy_objects,
    lay_out_task,
    next_action,
)
from app.sim.sorting.kernels.shortest_paths import Bytes, Ints, state_number
from app.sim.sorting.kernels.tie_breaking import NONE, mark_first


class TaskBatch(NamedTuple):
    """States and goals of ``n`` tasks of one shape."""

    clutter: Bytes
    """Objects in the slots, shape (n, K)."""
    towers: Bytes
    """Objects on the towers, lowest first, shape (n, C, K)."""
    heights: Ints
    """Objects per tower, shape (n, C)."""
    goal: Bytes
    """Goal of the towers, shape (n, C, K)."""
    goal_heights: Ints
    """Objects per tower in the goal, shape (n, C)."""
    fail: Vec
    """Failure probabilities of the slots, shape (n, K)."""


@kernel()
def _task_of(tasks: TaskBatch, e: int) -> tuple[Objects, Task]:
    """Return the state and the goal of one task."""
    objects = Objects(tasks.clutter[e], tasks.towers[e], tasks.heights[e])
    return objects, Task(tasks.goal[e], tasks.goal_heights[e], tasks.fail[e])


@kernel(nogil=True)
def plan_tasks(tasks: TaskBatch, work: PlannerWork, best: Ints, fewest: Ints) -> None:
    """Write the next action of the plan for every task.

    Args:
        tasks: States and goals.
        work: Work space of the shape.
        best: Next action, -1 where solved or unsolvable, shape (n,), written.
        fewest: Fewest moves, -1 where the goal cannot be met, shape (n,), written.
    """
    p = work.paths
    for e in range(len(tasks.clutter)):
        best[e], fewest[e] = NONE, NONE
        objects, task = _task_of(tasks, e)
        size = lay_out_task(objects, task, work)
        if size > 0:
            fewest[e] = p.table[state_number(p)]
            copy_objects(objects, work.now)
            best[e] = next_action(size, task, work)


@kernel(nogil=True)
def mark_tasks(tasks: TaskBatch, work: PlannerWork, first: NDArray[np.bool_]) -> None:
    """Mark the first actions of shortest plans, for every task.

    Args:
        tasks: States and goals.
        work: Work space of the shape.
        first: Marks, shape (n, actions), written; all false where solved or unsolvable.
    """
    for e in range(len(tasks.clutter)):
        first[e, :] = False
        objects, task = _task_of(tasks, e)
        if lay_out_task(objects, task, work) > 0:
            mark_first(tasks.clutter[e], work.paths, first[e])
