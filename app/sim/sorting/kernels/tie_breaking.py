"""Selection of the next move among shortest plans, by rules of low risk (compiled).

Shortest plans come from :mod:`app.sim.sorting.kernels.shortest_paths`. The rules prefer, in
this order:

1. tower to tower, without risk;
2. clutter to tower, the least risky of all wanted objects, which frees a good slot;
3. tower to clutter: the object with the least risk when picked again, into the best free slot;
   an object that is not needed again into the worst free slot.
"""

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.sorting.kernels.shortest_paths import (
    Bytes,
    Ints,
    ShortestPaths,
    state_number,
    ties_on_tower,
)

NONE = -1
"""No action: solved or infeasible."""


@kernel()
def safest_slot(code: int, clutter: Bytes, fail: Vec) -> int:
    """Return the least risky slot that contains an object (code 0: a free slot), -1 if none.

    Args:
        code: Code of the object.
        clutter: Objects in the slots, shape (K,).
        fail: Failure probabilities of the slots, shape (K,).
    """
    best = -1
    for k in range(len(clutter)):
        if clutter[k] == code and (best < 0 or fail[k] < fail[best]):
            best = k
    return best


@kernel()
def worst_free(clutter: Bytes, fail: Vec) -> int:
    """Return the most risky free slot, -1 without one."""
    worst = -1
    for k in range(len(clutter)):
        if clutter[k] == 0 and (worst < 0 or fail[k] > fail[worst]):
            worst = k
    return worst


@kernel()
def still_wanted(code: int, goal: Bytes, goal_heights: Ints, p: ShortestPaths) -> int:
    """Return how many objects of a code the towers still need for the goal."""
    count = 0
    for c in range(len(p.at)):
        level = p.match[c] if p.at[c] < p.junk[c] else p.at[c] - p.junk[c] + p.cut[c]
        for j in range(level, goal_heights[c]):
            count += goal[c, j] == code
    return count


@kernel()
def _next_risk(code: int, wanted: int, clutter: Bytes, fail: Vec, free: int) -> float:
    """Return the additional risk of one more object in the clutter, -1 for none.

    With ``wanted`` picks to come, the object in the slot ``free`` and its duplicates serve
    them, the least risky first: what counts is the risk of the last one.
    """
    last = -1.0
    for k in range(len(clutter)):
        if k != free and clutter[k] != code:
            continue
        safer = 0
        for j in range(len(clutter)):
            if j == free or clutter[j] == code:
                safer += fail[j] < fail[k]
        if safer < wanted and fail[k] > last:
            last = fail[k]
    return last


@kernel()
def _slot_for(code: int, wanted: int, clutter: Bytes, fail: Vec) -> int:
    """Return the slot for a removed object: the best one if it is picked again."""
    free = safest_slot(0, clutter, fail)
    if free < 0:
        return -1
    safer = 0
    for k in range(len(clutter)):
        safer += clutter[k] == code and fail[k] <= fail[free]
    return free if wanted > safer else worst_free(clutter, fail)


@kernel()
def _transfer(index: int, p: ShortestPaths) -> int:
    """Return a tower-to-tower move of a shortest plan as ``c * C + d``, -1 without one."""
    n_towers = len(p.at)
    for c in range(n_towers):
        top = p.top[c, p.at[c]]
        if top == 0:
            continue
        removed = index + (p.below[c, p.at[c]] - p.at[c]) * p.stride[c]
        for d in range(n_towers):
            if d != c and p.want[d, p.at[d]] == top:
                if p.table[removed + p.stride[d]] == p.table[index] - 1:
                    return c * n_towers + d
    return NONE


@kernel()
def _placement(index: int, clutter: Bytes, fail: Vec, p: ShortestPaths) -> int:
    """Return the least risky placement of a shortest plan as ``k * C + c``, -1 if none is."""
    n_towers = len(p.at)
    best, least = NONE, 2.0
    for c in range(n_towers):
        want = p.want[c, p.at[c]]
        if want == 0 or p.table[index + p.stride[c]] != p.table[index] - 1:
            continue
        k = safest_slot(want, clutter, fail)
        if k >= 0 and fail[k] < least:
            best, least = k * n_towers + c, fail[k]
    return best


@kernel()
def _removal(
    index: int, clutter: Bytes, goal: Bytes, goal_heights: Ints, fail: Vec, p: ShortestPaths
) -> int:
    """Return the action of the least risky removal of a shortest plan, -1 without one."""
    n_slots, n_towers = len(clutter), len(p.at)
    best, least = NONE, 2.0
    free = safest_slot(0, clutter, fail)
    for c in range(n_towers):
        top = p.top[c, p.at[c]]
        removed = index + (p.below[c, p.at[c]] - p.at[c]) * p.stride[c]
        if top == 0 or free < 0 or p.table[removed] != p.table[index] - 1:
            continue
        for d in range(n_towers):
            if d != c and p.want[d, p.at[d]] != top and ties_on_tower(removed, d, top, p):
                return 2 * n_slots * n_towers + c * n_towers + d
        wanted = still_wanted(top, goal, goal_heights, p)
        risk = _next_risk(top, wanted, clutter, fail, free)
        if risk < least:
            k = _slot_for(top, wanted, clutter, fail)
            best, least = n_slots * n_towers + c * n_slots + k, risk
    return best


@kernel()
def choose(clutter: Bytes, goal: Bytes, goal_heights: Ints, fail: Vec, p: ShortestPaths) -> int:
    """Return the next action of the plan, -1 at the goal.

    Args:
        clutter: Objects in the slots, shape (K,).
        goal: Goal of the towers, shape (C, K).
        goal_heights: Objects per tower of the goal, shape (C,).
        fail: Failure probabilities of the slots, shape (K,).
        p: State graph, ``table`` filled; ``at`` is the present state.
    """
    index = state_number(p)
    if p.table[index] == 0:
        return NONE
    n_slots, n_towers = len(clutter), len(p.at)
    action = _transfer(index, p)
    if action >= 0:
        return 2 * n_slots * n_towers + action
    action = _placement(index, clutter, fail, p)
    if action >= 0:
        return action
    return _removal(index, clutter, goal, goal_heights, fail, p)


@kernel()
def mark_first(clutter: Bytes, p: ShortestPaths, first: NDArray[np.bool_]) -> None:
    """Mark the first actions of shortest plans.

    Args:
        clutter: Objects in the slots, shape (K,).
        p: State graph, ``table`` filled; ``at`` is the present state.
        first: Marks, shape (n_actions,), written.
    """
    n_slots, n_towers = len(clutter), len(p.at)
    index = state_number(p)
    left = p.table[index] - 1
    for action in range(len(first)):
        first[action] = False
    for c in range(n_towers):
        want, top = p.want[c, p.at[c]], p.top[c, p.at[c]]
        if want != 0 and p.table[index + p.stride[c]] == left:
            for k in range(n_slots):
                first[k * n_towers + c] = clutter[k] == want
        if top == 0:
            continue
        removed = index + (p.below[c, p.at[c]] - p.at[c]) * p.stride[c]
        for k in range(n_slots):
            free = clutter[k] == 0 and p.table[removed] == left
            first[n_slots * n_towers + c * n_slots + k] = free
        for d in range(n_towers):
            if d == c:
                continue
            if p.want[d, p.at[d]] == top:
                best = p.table[removed + p.stride[d]] == left
            else:
                best = p.table[removed] == left and ties_on_tower(removed, d, top, p)
            first[2 * n_slots * n_towers + c * n_towers + d] = best
