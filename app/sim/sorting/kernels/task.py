"""Attempts in sorting environments, their rewards and observations (compiled).

Codes, positions and the numbering of actions are those of ``state.py``; episodes are
drawn by ``initial_states.py`` and the people's interference by ``interference.py``.

Source: docs/method.md 1.2, 1.3; thesis eq. (3.13)-(3.19). Deviates: placing into
an occupied clutter slot, not covered by the thesis, returns the object.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.sorting.kernels.reward import (
    SortingWeights,
    back_cost,
    distance_cost,
    empty_cost,
    fail_cost,
    move_cost,
    stuck_cost,
    success_bonus,
)

Ints = NDArray[np.int64]
Codes = NDArray[np.int8]
Floats = NDArray[np.float64]

RUNNING, SUCCESS, TIMEOUT = 0, 1, 2
"""Outcomes of an episode."""
FAILURE_SCALE = 250
"""Failure probabilities are observed in steps of one 250th."""


class SortingRules(NamedTuple):
    """Starts, disturbances and ends of episodes.

    K_E is the number of objects of an episode, K_G the number of objects in its goal.
    """

    n_sizes: int
    """Number of sizes."""
    horizon: int
    """Attempts after which an episode is truncated."""
    disturbed_share: float
    """Share of episodes that start with junk on the towers and goals partly built."""
    solved_episodes: float
    """Share of episodes that start partly solved, e_s of docs/method.md 1.4."""
    solved_share: float
    """Share of their goal that is done, g_s of docs/method.md 1.4."""
    even_share: float
    """Share of episodes whose K_E and K_G are drawn evenly."""
    human_rate: float
    """Chance per attempt that a person interferes."""
    localisation_rate: float
    """Chance per pick from the clutter that another object is moved than was meant."""
    random_map_share: float
    """Share of episodes with a failure map drawn at random."""
    failure_max: float
    """Greatest failure probability of such a map."""


class SortingEnvs(NamedTuple):
    """State of all environments: n of them, with K clutter slots and C colours."""

    clutter: Codes
    """Objects in the clutter, shape (n, K)."""
    towers: Codes
    """Objects on the towers from the lowest level, shape (n, C, K)."""
    heights: Ints
    """Objects per tower, shape (n, C)."""
    goal: Codes
    """Goal of the towers, shape (n, C, K)."""
    goal_heights: Ints
    """Objects per tower of the goal, shape (n, C)."""
    fail: Floats
    """Failure probabilities of the clutter slots, shape (n, K)."""
    own_fail: Floats
    """Failure probabilities of the clutter slots in the work cell, shape (n, K)."""
    fixed_objects: Ints
    """Objects per episode, K_E; 0 draws it, shape (n,)."""
    fixed_goal: Ints
    """Objects in the goal, K_G; 0 draws it, shape (n,)."""
    steps: Ints
    """Attempts so far, shape (n,)."""
    moves: Ints
    """Attempts that changed something, shape (n,)."""
    failures: Ints
    """Attempts that failed, shape (n,)."""
    interferences: Ints
    """Number of interferences, shape (n,)."""
    episode: Ints
    """Number of the present episode, shape (n,)."""
    outcome: Ints
    """Outcomes: RUNNING, SUCCESS or TIMEOUT, shape (n,)."""
    rng: NDArray[np.uint64]
    """Random stream of the present episode, shape (n, 1)."""
    counts: Ints
    """Work space: objects by code, shape (n, 2, types + 1)."""


@kernel()
def is_solved(envs: SortingEnvs, e: int) -> bool:
    """Return whether every tower of environment ``e`` equals its goal."""
    for c in range(envs.towers.shape[1]):
        if envs.heights[e, c] != envs.goal_heights[e, c]:
            return False
        for k in range(envs.heights[e, c]):
            if envs.towers[e, c, k] != envs.goal[e, c, k]:
                return False
    return True


@kernel()
def push(envs: SortingEnvs, e: int, c: int, code: int) -> None:
    """Place an object on tower ``c``."""
    envs.towers[e, c, envs.heights[e, c]] = code
    envs.heights[e, c] += 1


@kernel()
def pop(envs: SortingEnvs, e: int, c: int) -> int:
    """Remove the top object of tower ``c``, which is not empty; return its code."""
    envs.heights[e, c] -= 1
    level = envs.heights[e, c]
    code = int(envs.towers[e, c, level])
    envs.towers[e, c, level] = 0
    return code


@kernel()
def nth_slot(envs: SortingEnvs, e: int, wanted: int, occupied: bool) -> int:
    """Return the ``wanted``-th occupied or free clutter slot, from 0; -1 without one."""
    seen = 0
    for k in range(envs.clutter.shape[1]):
        if (envs.clutter[e, k] != 0) == occupied:
            if seen == wanted:
                return k
            seen += 1
    return -1


@kernel()
def n_slots(envs: SortingEnvs, e: int, occupied: bool) -> int:
    """Return the number of occupied or free clutter slots."""
    found = 0
    for k in range(envs.clutter.shape[1]):
        if (envs.clutter[e, k] != 0) == occupied:
            found += 1
    return found


@kernel()
def attempt(
    envs: SortingEnvs, rules: SortingRules, weights: SortingWeights, e: int, action: int
) -> float:
    """Execute an attempt; return its reward without the terms of :func:`step_reward`."""
    n, n_towers = envs.clutter.shape[1], envs.towers.shape[1]
    rng = envs.rng[e]
    empty = stuck = failed = back = False
    if action < n * n_towers:
        slot, c = action // n_towers, action % n_towers
        empty = envs.clutter[e, slot] == 0
        if not empty:
            failed = random.uniform(rng) < envs.fail[e, slot]
        if not empty and not failed:
            if rules.localisation_rate > 0.0:
                others = n_slots(envs, e, True) - 1
                if others > 0 and random.uniform(rng) < rules.localisation_rate:
                    found = nth_slot(envs, e, random.below(rng, others), True)
                    # The last one stands in for the one that was meant.
                    slot = nth_slot(envs, e, others, True) if found == slot else found
                    failed = True
            push(envs, e, c, int(envs.clutter[e, slot]))
            envs.clutter[e, slot] = 0
            envs.moves[e] += 1
    elif action < 2 * n * n_towers:
        c, slot = (action - n * n_towers) // n, (action - n * n_towers) % n
        empty = envs.heights[e, c] == 0
        stuck = not empty and envs.clutter[e, slot] != 0
        if not empty and not stuck:
            back = True
            envs.clutter[e, slot] = pop(envs, e, c)
            envs.moves[e] += 1
    else:
        c = (action - 2 * n * n_towers) // n_towers
        d = (action - 2 * n * n_towers) % n_towers
        empty = envs.heights[e, c] == 0
        stuck = not empty and c == d
        if not empty and not stuck:
            push(envs, e, d, pop(envs, e, c))
            envs.moves[e] += 1
    envs.steps[e] += 1
    if failed:
        envs.failures[e] += 1
    return -(
        move_cost(weights)
        + empty_cost(empty, weights)
        + stuck_cost(stuck, weights)
        + fail_cost(failed, weights)
        + back_cost(back, weights)
    )


@kernel()
def write_mask(envs: SortingEnvs, e: int, mask: NDArray[np.bool_]) -> None:
    """Mark the moves that change the state, shape (n_actions,)."""
    n, n_towers = envs.clutter.shape[1], envs.towers.shape[1]
    for k in range(n):
        there = envs.clutter[e, k] != 0
        for c in range(n_towers):
            mask[k * n_towers + c] = there
            mask[n * n_towers + c * n + k] = not there and envs.heights[e, c] > 0
    for c in range(n_towers):
        for d in range(n_towers):
            mask[2 * n * n_towers + c * n_towers + d] = c != d and envs.heights[e, c] > 0


@kernel()
def write_obs(envs: SortingEnvs, e: int, out: NDArray[np.uint8]) -> None:
    """Write slots, towers, goal and failure probabilities of environment ``e`` as integers."""
    n, n_towers = envs.clutter.shape[1], envs.towers.shape[1]
    for k in range(n):
        out[k] = envs.clutter[e, k]
        out[n + 2 * n_towers * n + k] = int(envs.fail[e, k] * FAILURE_SCALE + 0.5)
        for c in range(n_towers):
            out[n + c * n + k] = envs.towers[e, c, k]
            out[n + n_towers * n + c * n + k] = envs.goal[e, c, k]


@kernel()
def step_reward(
    envs: SortingEnvs, rules: SortingRules, weights: SortingWeights, e: int
) -> float:
    """Set the outcome of environment ``e`` after an attempt; return the rest of the reward."""
    solved = is_solved(envs, e)
    if solved:
        envs.outcome[e] = SUCCESS
    elif envs.steps[e] >= rules.horizon:
        envs.outcome[e] = TIMEOUT
    distance = distance_cost(envs.towers[e], envs.goal[e], rules.n_sizes, weights)
    return success_bonus(solved, weights) - distance


@kernel(nogil=True)
def masks_of(envs: SortingEnvs, masks: NDArray[np.bool_]) -> None:
    """Write the masks of all environments, shape (n, n_actions)."""
    for e in range(envs.clutter.shape[0]):
        write_mask(envs, e, masks[e])


@kernel(nogil=True)
def observe_envs(envs: SortingEnvs, obs: NDArray[np.uint8]) -> None:
    """Write the observations of all environments, shape (n, obs_size)."""
    for e in range(envs.clutter.shape[0]):
        write_obs(envs, e, obs[e])
