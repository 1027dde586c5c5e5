"""What the exact planner needs from where many sorting tasks are, in one call."""

import numpy as np
from numpy.typing import NDArray

from app.sim.kernels.compiled import kernel
from app.sim.kernels.sorting import Ints, SortingRows
from app.sim.kernels.sorting_planner import PlannerWork, follow_plan
from app.sim.kernels.sorting_progress import fill, lay_out, state_number


@kernel()
def _copy(rows: SortingRows, e: int, work: PlannerWork) -> None:
    """Put the objects of row ``e`` into the work space."""
    for k in range(rows.clutter.shape[1]):
        work.clutter[k] = rows.clutter[e, k]
    for c in range(rows.heights.shape[1]):
        work.heights[c] = rows.heights[e, c]
        for level in range(rows.clutter.shape[1]):
            work.towers[c, level] = rows.towers[e, c, level]


@kernel(nogil=True)
def measure_rows(
    rows: SortingRows,
    which: Ints,
    work: PlannerWork,
    fewest: Ints,
    attempts: NDArray[np.float64],
) -> None:
    """Write the fewest moves to the goal, and the attempts the planner expects for its plan.

    Args:
        rows: Rows of all tasks.
        which: Rows that are measured, shape (m,).
        work: Work space of the shape.
        fewest: Fewest moves, -1 where the goal cannot be met, shape (m,), written.
        attempts: Expected attempts, shape (m,), written.
    """
    p = work.progress
    for i in range(len(which)):
        e = which[i]
        goal, heights = rows.goal[e], rows.goal_heights[e]
        size = lay_out(rows.clutter[e], rows.towers[e], rows.heights[e], goal, heights, p)
        fewest[i], attempts[i] = -1, 0.0
        if size == 0:
            continue
        fill(size, work.at, p)
        fewest[i] = p.table[state_number(p)]
        _copy(rows, e, work)
        attempts[i] = follow_plan(goal, heights, rows.fail[e], work)
