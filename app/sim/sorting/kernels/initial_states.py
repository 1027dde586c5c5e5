"""Initial states of sorting episodes (docs/method.md 1.4, compiled).

The number of objects ``K_E`` is triangular on 1 to ``K`` with its mode at ``K``, the number in
the goal ``K_G`` triangular on 1 to ``K_E`` with its mode at ``K_E``. Objects are drawn evenly
among the types; the goal is some of them, each on the tower of its colour, the largest at the
bottom. A share of episodes starts with the goal partly done (the curriculum), another share
disturbed: the goal partly built and objects standing on towers where they may not belong.

Source: thesis section 3.4.2. Deviates: disturbed starts are ours, and so is the share of
episodes whose sizes are drawn evenly, without which small goals among many objects are hardly
ever met.
"""

import math

from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.sorting.kernels.task import (
    FAILURE_SCALE,
    RUNNING,
    Ints,
    SortingRows,
    SortingRules,
    is_solved,
    n_slots,
    nth_slot,
    push,
)

TRIES = 50
"""Draws of a disturbed start before an undisturbed one is used."""


@kernel()
def triangular(rng: random.State, n: int) -> int:
    """Draw from 1 to ``n``; the chance grows linearly and is greatest at ``n``."""
    return min(n, 1 + int(math.sqrt(random.uniform(rng)) * n))


@kernel()
def _size(rng: random.State, n: int, even: bool) -> int:
    """Draw from 1 to ``n``, evenly or triangular."""
    return 1 + random.below(rng, n) if even else triangular(rng, n)


@kernel()
def write_goal(rows: SortingRows, rules: SortingRules, e: int, wanted: Ints) -> None:
    """Write the goal of objects, on the tower of their colour, the largest at the bottom.

    Args:
        rows: All environments.
        e: Row.
        wanted: Number of objects per code, shape (types + 1,).
    """
    n_sizes = rules.n_sizes
    for c in range(rows.goal.shape[1]):
        level = 0
        for i in range(n_sizes):
            code = 1 + c * n_sizes + n_sizes - 1 - i
            for _ in range(wanted[code]):
                rows.goal[e, c, level] = code
                level += 1
        rows.goal_heights[e, c] = level
        for k in range(level, rows.goal.shape[2]):
            rows.goal[e, c, k] = 0


@kernel()
def draw_codes(rng: random.State, there: Ints, n: int, wanted: Ints) -> None:
    """Draw ``n`` objects without replacement.

    Args:
        there: Number of existing objects per code, shape (types + 1,).
        n: Number of draws, at most that of existing objects.
        wanted: Filled with how many of each code were drawn.
    """
    left = 0
    for code in range(1, there.shape[0]):
        left += there[code]
        wanted[code] = 0
    for _ in range(n):
        index = random.below(rng, left)
        left -= 1
        for code in range(1, there.shape[0]):
            rest = there[code] - wanted[code]
            if index < rest:
                wanted[code] += 1
                break
            index -= rest


@kernel()
def _clear(rows: SortingRows, e: int) -> None:
    for k in range(rows.clutter.shape[1]):
        rows.clutter[e, k] = 0
        for c in range(rows.towers.shape[1]):
            rows.towers[e, c, k] = 0
    for c in range(rows.towers.shape[1]):
        rows.heights[e, c] = 0


@kernel()
def _build(rows: SortingRows, e: int, rng: random.State, n_done: int, rest: Ints) -> None:
    """Place ``n_done`` objects of the goal on random towers; remove them from ``rest``."""
    for _ in range(n_done):
        left = 0
        for c in range(rows.goal.shape[1]):
            left += rows.goal_heights[e, c] - rows.heights[e, c]
        index = random.below(rng, left)
        for c in range(rows.goal.shape[1]):
            more = rows.goal_heights[e, c] - rows.heights[e, c]
            if index < more:
                code = int(rows.goal[e, c, rows.heights[e, c]])
                rest[code] -= 1
                push(rows, e, c, code)
                break
            index -= more


@kernel()
def _scatter(rows: SortingRows, e: int, rng: random.State, n_junk: int, rest: Ints) -> None:
    """Place ``n_junk`` objects on random towers, all others in the clutter."""
    n_rest = 0
    for code in range(1, rest.shape[0]):
        n_rest += rest[code]
    for i in range(n_rest):
        index = random.below(rng, n_rest - i)
        for code in range(1, rest.shape[0]):
            if index < rest[code]:
                rest[code] -= 1
                if i < n_junk:
                    push(rows, e, random.below(rng, rows.towers.shape[1]), code)
                else:
                    free = n_slots(rows, e, False)
                    slot = nth_slot(rows, e, random.below(rng, free), False)
                    rows.clutter[e, slot] = code
                break
            index -= rest[code]


@kernel()
def _draw_map(rows: SortingRows, rules: SortingRules, e: int, rng: random.State) -> None:
    drawn = random.uniform(rng) < rules.random_map_share
    steps = int(rules.failure_max * FAILURE_SCALE)
    for k in range(rows.fail.shape[1]):
        if drawn:
            rows.fail[e, k] = random.below(rng, steps + 1) / FAILURE_SCALE
        else:
            rows.fail[e, k] = rows.own_fail[e, k]


@kernel()
def start_row(rows: SortingRows, rules: SortingRules, seed: int, row: int, e: int) -> None:
    """Draw the next episode of row ``e``.

    Args:
        rows: All environments; changed.
        seed: Seed of the batch.
        row: Number of the row in the random streams.
        e: Row.
    """
    rng, there, wanted = rows.rng[e], rows.counts[e, 0], rows.counts[e, 1]
    random.start_stream(seed, row, rows.episode[e], rng)
    _draw_map(rows, rules, e, rng)
    n_objects, n_goal = rows.fixed_objects[e], rows.fixed_goal[e]
    even = random.uniform(rng) < rules.even_share
    if n_objects == 0:
        n_objects = max(_size(rng, rows.clutter.shape[1], even), n_goal)
    if n_goal == 0:
        n_goal = _size(rng, n_objects, even)
    for code in range(there.shape[0]):
        there[code] = 0
    for _ in range(n_objects):
        there[1 + random.below(rng, there.shape[0] - 1)] += 1
    draw_codes(rng, there, n_goal, wanted)
    write_goal(rows, rules, e, wanted)
    kind = random.uniform(rng)
    disturbed = kind >= 1.0 - rules.disturbed_share
    for attempt in range(TRIES + 1):
        _clear(rows, e)
        for code in range(there.shape[0]):
            wanted[code] = there[code]
        n_done = n_junk = 0
        if kind < rules.solved_episodes:
            n_done = min(int(rules.solved_share * n_goal + 0.5), n_goal - 1)
        elif disturbed and attempt < TRIES:
            n_done = random.below(rng, n_goal)
            n_junk = 1 + random.below(rng, n_objects - n_done)
        _build(rows, e, rng, n_done, wanted)
        _scatter(rows, e, rng, n_junk, wanted)
        if not is_solved(rows, e):
            break
    rows.steps[e] = rows.moves[e] = rows.failures[e] = rows.interferences[e] = 0
    rows.outcome[e] = RUNNING
