"""The terms of the sorting reward (METHOD 1.3), each a function of its own.

``R = r_move + r_empty + r_stuck + r_fail + r_back + r_dist + r_succ``. All but the last are
costs. The coefficients are open in the source; those of :class:`SortingWeights` keep the plan
of fewest moves and least risk optimal, which value iteration checks on small instances
(``tests/sim/test_sorting_reward.py``).

Source: thesis eq. (3.18), (3.19).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.jit import kernel


class SortingWeights(NamedTuple):
    """Coefficients of the reward; costs are given as positive numbers."""

    move: float = 0.05
    """Cost of an attempt, whatever comes of it."""
    empty: float = 0.3
    """Cost of picking where nothing is."""
    stuck: float = 0.3
    """Cost of putting an object back where it was, or where no room is."""
    fail: float = 0.01
    """Cost of a pick that failed, or moved another object than was meant."""
    back: float = 0.01
    """Cost of sending an object from a tower back to the clutter."""
    distance: float = 0.01
    """Cost per share of the levels, of K, that differ from the goal after the attempt."""
    success: float = 1.0
    """Bonus when every tower is as the goal asks."""
    colour: float = 0.5
    """Share of a level's distance that a wrong colour makes."""
    size: float = 0.5
    """Share of a level's distance that a wrong size makes."""


@kernel(inline="always")
def move_cost(weights: SortingWeights) -> float:
    """Return the cost of an attempt."""
    return weights.move


@kernel(inline="always")
def empty_cost(empty: bool, weights: SortingWeights) -> float:
    """Return the cost of picking where nothing is."""
    return weights.empty if empty else 0.0


@kernel(inline="always")
def stuck_cost(stuck: bool, weights: SortingWeights) -> float:
    """Return the cost of putting an object back where it was."""
    return weights.stuck if stuck else 0.0


@kernel(inline="always")
def fail_cost(failed: bool, weights: SortingWeights) -> float:
    """Return the cost of a failure, of grasping or of localisation."""
    return weights.fail if failed else 0.0


@kernel(inline="always")
def back_cost(back: bool, weights: SortingWeights) -> float:
    """Return the cost of sending an object from a tower to the clutter."""
    return weights.back if back else 0.0


@kernel()
def distance_cost(
    towers: NDArray[np.int8], goal: NDArray[np.int8], n_sizes: int, weights: SortingWeights
) -> float:
    """Return the cost of the attributes that differ from the goal (3.19).

    Args:
        towers: Objects on the towers, shape (C, K).
        goal: What they shall be, shape (C, K).
        n_sizes: Number of sizes.
        weights: Coefficients.
    """
    total: float = 0.0
    for c in range(towers.shape[0]):
        for k in range(towers.shape[1]):
            there, wanted = int(towers[c, k]), int(goal[c, k])
            if there == wanted:
                continue
            null = there == 0 or wanted == 0
            if null or (there - 1) // n_sizes != (wanted - 1) // n_sizes:
                total += weights.colour
            if null or (there - 1) % n_sizes != (wanted - 1) % n_sizes:
                total += weights.size
    return float(weights.distance * total / towers.shape[1])


@kernel(inline="always")
def success_bonus(solved: bool, weights: SortingWeights) -> float:
    """Return the bonus for a goal that is met."""
    return weights.success if solved else 0.0
