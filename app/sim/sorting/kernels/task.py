"""Steps of sorting tasks, one attempt per row and call (docs/method.md 1.2, 1.3, compiled).

Codes, positions and the numbering of actions are those of ``state.py``; episodes are
drawn by ``initial_states.py`` and the people's interference by ``interference.py``.

Source: thesis eq. (3.13)-(3.19). Deviates: placing into an occupied clutter slot, not covered
by the thesis, returns the object.
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
    """Starts, disturbances and ends of episodes."""

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


class SortingRows(NamedTuple):
    """Rows of all tasks; ``n`` of them, ``K`` slots, ``C`` colours."""

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
    """Those of the work cell, shape (n, K)."""
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
def is_solved(rows: SortingRows, e: int) -> bool:
    """Return whether every tower of row ``e`` equals its goal."""
    for c in range(rows.towers.shape[1]):
        if rows.heights[e, c] != rows.goal_heights[e, c]:
            return False
        for k in range(rows.heights[e, c]):
            if rows.towers[e, c, k] != rows.goal[e, c, k]:
                return False
    return True


@kernel()
def push(rows: SortingRows, e: int, c: int, code: int) -> None:
    """Place an object on tower ``c``."""
    rows.towers[e, c, rows.heights[e, c]] = code
    rows.heights[e, c] += 1


@kernel()
def pop(rows: SortingRows, e: int, c: int) -> int:
    """Remove the top object of tower ``c``, which is not empty; return its code."""
    rows.heights[e, c] -= 1
    level = rows.heights[e, c]
    code = int(rows.towers[e, c, level])
    rows.towers[e, c, level] = 0
    return code


@kernel()
def nth_slot(rows: SortingRows, e: int, wanted: int, occupied: bool) -> int:
    """Return the ``wanted``-th occupied or free clutter slot, from 0; -1 without one."""
    seen = 0
    for k in range(rows.clutter.shape[1]):
        if (rows.clutter[e, k] != 0) == occupied:
            if seen == wanted:
                return k
            seen += 1
    return -1


@kernel()
def n_slots(rows: SortingRows, e: int, occupied: bool) -> int:
    """Return the number of occupied or free clutter slots."""
    found = 0
    for k in range(rows.clutter.shape[1]):
        if (rows.clutter[e, k] != 0) == occupied:
            found += 1
    return found


@kernel()
def attempt(
    rows: SortingRows, rules: SortingRules, weights: SortingWeights, e: int, action: int
) -> float:
    """Execute one attempt in row ``e``; return the reward without distance and success."""
    n, n_towers = rows.clutter.shape[1], rows.towers.shape[1]
    rng = rows.rng[e]
    empty = stuck = failed = back = False
    if action < n * n_towers:
        slot, c = action // n_towers, action % n_towers
        empty = rows.clutter[e, slot] == 0
        if not empty:
            failed = random.uniform(rng) < rows.fail[e, slot]
        if not empty and not failed:
            if rules.localisation_rate > 0.0:
                others = n_slots(rows, e, True) - 1
                if others > 0 and random.uniform(rng) < rules.localisation_rate:
                    found = nth_slot(rows, e, random.below(rng, others), True)
                    # The last one stands in for the one that was meant.
                    slot = nth_slot(rows, e, others, True) if found == slot else found
                    failed = True
            push(rows, e, c, int(rows.clutter[e, slot]))
            rows.clutter[e, slot] = 0
            rows.moves[e] += 1
    elif action < 2 * n * n_towers:
        c, slot = (action - n * n_towers) // n, (action - n * n_towers) % n
        empty = rows.heights[e, c] == 0
        stuck = not empty and rows.clutter[e, slot] != 0
        if not empty and not stuck:
            back = True
            rows.clutter[e, slot] = pop(rows, e, c)
            rows.moves[e] += 1
    else:
        c = (action - 2 * n * n_towers) // n_towers
        d = (action - 2 * n * n_towers) % n_towers
        empty = rows.heights[e, c] == 0
        stuck = not empty and c == d
        if not empty and not stuck:
            push(rows, e, d, pop(rows, e, c))
            rows.moves[e] += 1
    rows.steps[e] += 1
    if failed:
        rows.failures[e] += 1
    return -(
        move_cost(weights)
        + empty_cost(empty, weights)
        + stuck_cost(stuck, weights)
        + fail_cost(failed, weights)
        + back_cost(back, weights)
    )


@kernel()
def write_mask(rows: SortingRows, e: int, mask: NDArray[np.bool_]) -> None:
    """Mark the moves that change the state, shape (n_actions,)."""
    n, n_towers = rows.clutter.shape[1], rows.towers.shape[1]
    for k in range(n):
        there = rows.clutter[e, k] != 0
        for c in range(n_towers):
            mask[k * n_towers + c] = there
            mask[n * n_towers + c * n + k] = not there and rows.heights[e, c] > 0
    for c in range(n_towers):
        for d in range(n_towers):
            mask[2 * n * n_towers + c * n_towers + d] = c != d and rows.heights[e, c] > 0


@kernel()
def write_obs(rows: SortingRows, e: int, out: NDArray[np.uint8]) -> None:
    """Write slots, towers, goal and failure probabilities of row ``e`` as integers."""
    n, n_towers = rows.clutter.shape[1], rows.towers.shape[1]
    for k in range(n):
        out[k] = rows.clutter[e, k]
        out[n + 2 * n_towers * n + k] = int(rows.fail[e, k] * FAILURE_SCALE + 0.5)
        for c in range(n_towers):
            out[n + c * n + k] = rows.towers[e, c, k]
            out[n + n_towers * n + c * n + k] = rows.goal[e, c, k]


@kernel()
def step_reward(
    rows: SortingRows, rules: SortingRules, weights: SortingWeights, e: int
) -> float:
    """Set the outcome of row ``e`` after an attempt; return the rest of the reward."""
    solved = is_solved(rows, e)
    if solved:
        rows.outcome[e] = SUCCESS
    elif rows.steps[e] >= rules.horizon:
        rows.outcome[e] = TIMEOUT
    distance = distance_cost(rows.towers[e], rows.goal[e], rules.n_sizes, weights)
    return success_bonus(solved, weights) - distance


@kernel(nogil=True)
def masks_of(rows: SortingRows, masks: NDArray[np.bool_]) -> None:
    """Write the masks of all rows, shape (n, n_actions)."""
    for e in range(rows.clutter.shape[0]):
        write_mask(rows, e, masks[e])


@kernel(nogil=True)
def observe_rows(rows: SortingRows, obs: NDArray[np.uint8]) -> None:
    """Write the observations of all rows, shape (n, obs_size)."""
    for e in range(rows.clutter.shape[0]):
        write_obs(rows, e, obs[e])
