"""What every valid move of the sorting task is worth to the exact planner, compiled.

A move that comes first costs ``1 / (1 - p)`` attempts, ``p`` the failure probability of its
pick, and then what the plan from the state it gives costs.
"""

import numpy as np
from numpy.typing import NDArray

from app.sim.kernels.compiled import kernel
from app.sim.kernels.sorting_planner import PlannerWork, plan_state
from app.sim.kernels.sorting_progress import Bytes, Ints, lay_out
from app.sim.ports import Vec


@kernel()
def _shift(
    source: int, target: int, clutter: Bytes, towers: Bytes, heights: Ints, n_cells: int
) -> None:
    """Move the object at one position to another."""
    if source < n_cells:
        code = clutter[source]
        clutter[source] = 0
    else:
        c = source - n_cells
        heights[c] -= 1
        code = towers[c, heights[c]]
        towers[c, heights[c]] = 0
    if target < n_cells:
        clutter[target] = code
    else:
        c = target - n_cells
        towers[c, heights[c]] = code
        heights[c] += 1


@kernel(nogil=True)
def attempts_by_move(
    clutter: Bytes,
    towers: Bytes,
    heights: Ints,
    goal: Bytes,
    goal_heights: Ints,
    fail: Vec,
    moves: Ints,
    most: int,
    work: PlannerWork,
    first: NDArray[np.bool_],
    attempts: Vec,
) -> bool:
    """Write the attempts expected to the goal by the move that comes first.

    Args:
        clutter: Objects in the cells, shape (K,); as before at the end.
        towers: Objects on the towers, lowest first, shape (C, K); as before at the end.
        heights: Objects per tower, shape (C,); as before at the end.
        goal: What the towers shall be, shape (C, K).
        goal_heights: Objects per tower there, shape (C,).
        fail: Failure probabilities of the cells, shape (K,).
        moves: Valid moves as positions to pick and to place, shape (n, 2).
        most: States of the planner, over all moves, beyond which nothing is written.
        work: Work space of the shape.
        first: Work space, shape (n_actions,).
        attempts: Expected attempts by move, shape (n,), written.

    Returns:
        Whether they were written.
    """
    n_cells = len(clutter)
    size = lay_out(clutter, towers, heights, goal, goal_heights, work.progress)
    if size * len(moves) > most:
        return False
    for i in range(len(moves)):
        pick, place = moves[i, 0], moves[i, 1]
        _shift(pick, place, clutter, towers, heights, n_cells)
        _, after = plan_state(clutter, towers, heights, goal, goal_heights, fail, work, first)
        _shift(place, pick, clutter, towers, heights, n_cells)
        attempts[i] = after + (1.0 / (1.0 - fail[pick]) if pick < n_cells else 1.0)
    return True
