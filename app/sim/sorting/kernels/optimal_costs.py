"""Moves and expected attempts of the exact planner for many sorting tasks (compiled)."""

import numpy as np
from numpy.typing import NDArray

from app.sim.core.jit import kernel
from app.sim.sorting.kernels.planner import Objects, PlannerWork, Task, plan_state
from app.sim.sorting.kernels.task import Ints, SortingEnvs


@kernel(nogil=True)
def measure_envs(
    envs: SortingEnvs,
    which: Ints,
    work: PlannerWork,
    fewest: Ints,
    attempts: NDArray[np.float64],
) -> None:
    """Write the fewest moves to the goal and the expected attempts of the plan.

    Args:
        envs: All environments.
        which: Environments to evaluate, shape (m,).
        work: Work space of the shape.
        fewest: Fewest moves, -1 where the goal cannot be met, shape (m,), written.
        attempts: Expected attempts, shape (m,), written.
    """
    for i in range(len(which)):
        e = which[i]
        objects = Objects(envs.clutter[e], envs.towers[e], envs.heights[e])
        task = Task(envs.goal[e], envs.goal_heights[e], envs.fail[e])
        fewest[i], attempts[i] = plan_state(objects, task, work)
