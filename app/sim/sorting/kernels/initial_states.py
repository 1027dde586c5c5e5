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
    SortingEnvs,
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
def write_goal(envs: SortingEnvs, rules: SortingRules, e: int, wanted: Ints) -> None:
    """Write the goal of objects, on the tower of their colour, the largest at the bottom.

    Args:
        envs: All environments.
        e: Environment.
        wanted: Number of objects per code, shape (types + 1,).
    """
    n_sizes = rules.n_sizes
    for c in range(envs.goal.shape[1]):
        level = 0
        for i in range(n_sizes):
            code = 1 + c * n_sizes + n_sizes - 1 - i
            for _ in range(wanted[code]):
                envs.goal[e, c, level] = code
                level += 1
        envs.goal_heights[e, c] = level
        for k in range(level, envs.goal.shape[2]):
            envs.goal[e, c, k] = 0


@kernel()
def draw_codes(rng: random.State, there: Ints, n: int, wanted: Ints) -> None:
    """Draw ``n`` objects without replacement.

    Args:
        there: Number of existing objects per code, shape (types + 1,).
        n: Number of draws, at most that of existing objects.
        wanted: Filled with the number of drawn objects per code, shape (types + 1,).
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
def _clear(envs: SortingEnvs, e: int) -> None:
    """Remove all objects from clutter and towers."""
    for k in range(envs.clutter.shape[1]):
        envs.clutter[e, k] = 0
        for c in range(envs.towers.shape[1]):
            envs.towers[e, c, k] = 0
    for c in range(envs.towers.shape[1]):
        envs.heights[e, c] = 0


@kernel()
def _build(envs: SortingEnvs, e: int, rng: random.State, n_done: int, rest: Ints) -> None:
    """Build ``n_done`` levels of the goal, on random towers; remove the objects from ``rest``.

    Args:
        rest: Objects not placed yet, by code, shape (types + 1,); changed.
    """
    for _ in range(n_done):
        left = 0
        for c in range(envs.goal.shape[1]):
            left += envs.goal_heights[e, c] - envs.heights[e, c]
        index = random.below(rng, left)
        for c in range(envs.goal.shape[1]):
            more = envs.goal_heights[e, c] - envs.heights[e, c]
            if index < more:
                code = int(envs.goal[e, c, envs.heights[e, c]])
                rest[code] -= 1
                push(envs, e, c, code)
                break
            index -= more


@kernel()
def _scatter(envs: SortingEnvs, e: int, rng: random.State, n_junk: int, rest: Ints) -> None:
    """Place ``n_junk`` random objects on random towers, all others in the clutter.

    Args:
        rest: Objects not placed yet, by code, shape (types + 1,); all zero afterwards.
    """
    n_rest = 0
    for code in range(1, rest.shape[0]):
        n_rest += rest[code]
    for i in range(n_rest):
        index = random.below(rng, n_rest - i)
        for code in range(1, rest.shape[0]):
            if index < rest[code]:
                rest[code] -= 1
                if i < n_junk:
                    push(envs, e, random.below(rng, envs.towers.shape[1]), code)
                else:
                    free = n_slots(envs, e, False)
                    slot = nth_slot(envs, e, random.below(rng, free), False)
                    envs.clutter[e, slot] = code
                break
            index -= rest[code]


@kernel()
def _draw_map(envs: SortingEnvs, rules: SortingRules, e: int, rng: random.State) -> None:
    """Draw the failure map of an episode, or take that of the work cell."""
    drawn = random.uniform(rng) < rules.random_map_share
    steps = int(rules.failure_max * FAILURE_SCALE)
    for k in range(envs.fail.shape[1]):
        if drawn:
            envs.fail[e, k] = random.below(rng, steps + 1) / FAILURE_SCALE
        else:
            envs.fail[e, k] = envs.own_fail[e, k]


@kernel()
def start_env(envs: SortingEnvs, rules: SortingRules, seed: int, number: int, e: int) -> None:
    """Draw the next episode of environment ``e``.

    Args:
        envs: All environments; changed.
        rules: Numbers of objects, disturbances and failure maps.
        seed: Seed of the batch.
        number: Number of the environment in the random streams.
        e: Environment.
    """
    rng, there, wanted = envs.rng[e], envs.counts[e, 0], envs.counts[e, 1]
    random.start_stream(seed, number, envs.episode[e], rng)
    _draw_map(envs, rules, e, rng)
    n_objects, n_goal = envs.fixed_objects[e], envs.fixed_goal[e]
    even = random.uniform(rng) < rules.even_share
    if n_objects == 0:
        n_objects = max(_size(rng, envs.clutter.shape[1], even), n_goal)
    if n_goal == 0:
        n_goal = _size(rng, n_objects, even)
    for code in range(there.shape[0]):
        there[code] = 0
    for _ in range(n_objects):
        there[1 + random.below(rng, there.shape[0] - 1)] += 1
    draw_codes(rng, there, n_goal, wanted)
    write_goal(envs, rules, e, wanted)
    kind = random.uniform(rng)
    disturbed = kind >= 1.0 - rules.disturbed_share
    for attempt in range(TRIES + 1):
        _clear(envs, e)
        for code in range(there.shape[0]):
            wanted[code] = there[code]
        n_done = n_junk = 0
        if kind < rules.solved_episodes:
            n_done = min(int(rules.solved_share * n_goal + 0.5), n_goal - 1)
        elif disturbed and attempt < TRIES:
            n_done = random.below(rng, n_goal)
            n_junk = 1 + random.below(rng, n_objects - n_done)
        _build(envs, e, rng, n_done, wanted)
        _scatter(envs, e, rng, n_junk, wanted)
        if not is_solved(envs, e):
            break
    envs.steps[e] = envs.moves[e] = envs.failures[e] = envs.interferences[e] = 0
    envs.outcome[e] = RUNNING
