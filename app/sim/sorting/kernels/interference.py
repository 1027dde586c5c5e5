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
    SortingEnvs,
    SortingRules,
    is_solved,
    n_slots,
    nth_slot,
    pop,
)

GOAL_TRIES = 20
"""Draws of a goal before one that is reached already is kept."""


@kernel()
def _count(envs: SortingEnvs, e: int, there: Ints) -> int:
    """Count the objects of environment ``e``; return the total.

    Args:
        there: Filled with the number of objects by code, shape (types + 1,); entry 0 counts
            empty positions.
    """
    for code in range(there.shape[0]):
        there[code] = 0
    total = 0
    for k in range(envs.clutter.shape[1]):
        there[envs.clutter[e, k]] += 1
        for c in range(envs.towers.shape[1]):
            there[envs.towers[e, c, k]] += 1
    for code in range(1, there.shape[0]):
        total += there[code]
    return total


@kernel()
def _add(envs: SortingEnvs, e: int, rng: random.State) -> None:
    """Add a random object to a random free slot of the clutter, up to K objects in all."""
    there = envs.counts[e, 0]
    free = n_slots(envs, e, False)
    if _count(envs, e, there) < envs.clutter.shape[1] and free > 0:
        slot = nth_slot(envs, e, random.below(rng, free), False)
        envs.clutter[e, slot] = 1 + random.below(rng, there.shape[0] - 1)


@kernel()
def _remove(envs: SortingEnvs, e: int, rng: random.State) -> None:
    """Remove a random object of the clutter, unless the goal needs it."""
    occupied = n_slots(envs, e, True)
    if occupied == 0:
        return
    there = envs.counts[e, 0]
    _count(envs, e, there)
    slot = nth_slot(envs, e, random.below(rng, occupied), True)
    code, wanted = int(envs.clutter[e, slot]), 0
    for c in range(envs.goal.shape[1]):
        for k in range(envs.goal_heights[e, c]):
            if envs.goal[e, c, k] == code:
                wanted += 1
    if there[code] > wanted:
        envs.clutter[e, slot] = 0


@kernel()
def _move(envs: SortingEnvs, e: int, rng: random.State) -> None:
    """Move the top of a random tower, or an object of the clutter, to a random free slot."""
    free, occupied = n_slots(envs, e, False), n_slots(envs, e, True)
    if free == 0:
        return
    target = nth_slot(envs, e, random.below(rng, free), False)
    c = random.below(rng, envs.towers.shape[1])
    if random.uniform(rng) < 0.5 and envs.heights[e, c] > 0:
        envs.clutter[e, target] = pop(envs, e, c)
    elif occupied > 0:
        slot = nth_slot(envs, e, random.below(rng, occupied), True)
        envs.clutter[e, target] = envs.clutter[e, slot]
        envs.clutter[e, slot] = 0


@kernel()
def _change_goal(envs: SortingEnvs, rules: SortingRules, e: int, rng: random.State) -> None:
    """Draw another goal of the present objects."""
    there, wanted = envs.counts[e, 0], envs.counts[e, 1]
    total = _count(envs, e, there)
    if total == 0:
        return
    for _ in range(GOAL_TRIES):
        draw_codes(rng, there, triangular(rng, total), wanted)
        write_goal(envs, rules, e, wanted)
        if not is_solved(envs, e):
            return


@kernel()
def interfere(envs: SortingEnvs, rules: SortingRules, e: int) -> None:
    """Apply one of the four interferences to environment ``e``, if possible."""
    rng = envs.rng[e]
    kind = random.below(rng, 4)
    envs.interferences[e] += 1
    if kind == 0:
        _add(envs, e, rng)
    elif kind == 1:
        _remove(envs, e, rng)
    elif kind == 2:
        _move(envs, e, rng)
    else:
        _change_goal(envs, rules, e, rng)
