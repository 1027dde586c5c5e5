"""Interference of people with a sorting task (docs/method.md 1.2, compiled).

With equal probability, a person adds an object to the clutter, removes one that the goal does
not need, moves one from a clutter slot or the top of a tower to a free slot, or changes the
goal. Goals remain feasible.
"""

from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.sorting.kernels.initial_states import draw_codes, triangular, write_goal
from app.sim.sorting.kernels.task import (
    Ints,
    SortingRows,
    SortingRules,
    is_solved,
    n_slots,
    nth_slot,
    pop,
)

GOAL_TRIES = 20
"""Draws of a goal before one that is reached already is kept."""


@kernel()
def _count(rows: SortingRows, e: int, there: Ints) -> int:
    """Count the objects of row ``e`` by code; return the total."""
    for code in range(there.shape[0]):
        there[code] = 0
    total = 0
    for k in range(rows.clutter.shape[1]):
        there[rows.clutter[e, k]] += 1
        for c in range(rows.towers.shape[1]):
            there[rows.towers[e, c, k]] += 1
    for code in range(1, there.shape[0]):
        total += there[code]
    return total


@kernel()
def _add(rows: SortingRows, e: int, rng: random.State) -> None:
    there = rows.counts[e, 0]
    free = n_slots(rows, e, False)
    if _count(rows, e, there) < rows.clutter.shape[1] and free > 0:
        slot = nth_slot(rows, e, random.below(rng, free), False)
        rows.clutter[e, slot] = 1 + random.below(rng, there.shape[0] - 1)


@kernel()
def _remove(rows: SortingRows, e: int, rng: random.State) -> None:
    occupied = n_slots(rows, e, True)
    if occupied == 0:
        return
    there = rows.counts[e, 0]
    _count(rows, e, there)
    slot = nth_slot(rows, e, random.below(rng, occupied), True)
    code, wanted = int(rows.clutter[e, slot]), 0
    for c in range(rows.goal.shape[1]):
        for k in range(rows.goal_heights[e, c]):
            if rows.goal[e, c, k] == code:
                wanted += 1
    if there[code] > wanted:
        rows.clutter[e, slot] = 0


@kernel()
def _move(rows: SortingRows, e: int, rng: random.State) -> None:
    free, occupied = n_slots(rows, e, False), n_slots(rows, e, True)
    if free == 0:
        return
    target = nth_slot(rows, e, random.below(rng, free), False)
    c = random.below(rng, rows.towers.shape[1])
    if random.uniform(rng) < 0.5 and rows.heights[e, c] > 0:
        rows.clutter[e, target] = pop(rows, e, c)
    elif occupied > 0:
        slot = nth_slot(rows, e, random.below(rng, occupied), True)
        rows.clutter[e, target] = rows.clutter[e, slot]
        rows.clutter[e, slot] = 0


@kernel()
def _change_goal(rows: SortingRows, rules: SortingRules, e: int, rng: random.State) -> None:
    there, wanted = rows.counts[e, 0], rows.counts[e, 1]
    total = _count(rows, e, there)
    if total == 0:
        return
    for _ in range(GOAL_TRIES):
        draw_codes(rng, there, triangular(rng, total), wanted)
        write_goal(rows, rules, e, wanted)
        if not is_solved(rows, e):
            return


@kernel()
def interfere(rows: SortingRows, rules: SortingRules, e: int) -> None:
    """Apply one of the four interferences to row ``e``, if possible."""
    rng = rows.rng[e]
    kind = random.below(rng, 4)
    rows.interferences[e] += 1
    if kind == 0:
        _add(rows, e, rng)
    elif kind == 1:
        _remove(rows, e, rng)
    elif kind == 2:
        _move(rows, e, rng)
    else:
        _change_goal(rows, rules, e, rng)
