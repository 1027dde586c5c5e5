"""Terms of the sorting reward (docs/method.md 1.3, compiled).

``R = r_move + r_empty + r_stuck + r_fail + r_back + r_dist + r_succ``. All but the last are
costs. The thesis does not state coefficients; with those of :class:`SortingWeights` the plan of
fewest moves and least risk is optimal, as value iteration verifies on small instances
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
    """Cost of an attempt."""
    empty: float = 0.3
    """Cost of picking from an empty position."""
    stuck: float = 0.3
    """Cost of placing an object at its old or at an occupied position."""
    fail: float = 0.01
    """Cost of a failed pick or of moving another object."""
    back: float = 0.01
    """Cost of moving an object from a tower to the clutter."""
    distance: float = 0.01
    """Cost of the share of K levels that differ from the goal after the attempt."""
    success: float = 1.0
    """Bonus at the goal."""
    colour: float = 0.5
    """Share of a wrong colour in a level's distance."""
    size: float = 0.5
    """Share of a wrong size in a level's distance."""


@kernel(inline="always")
def move_cost(weights: SortingWeights) -> float:
    """Return the cost of an attempt."""
    return weights.move


@kernel(inline="always")
def empty_cost(empty: bool, weights: SortingWeights) -> float:
    """Return the cost of picking from an empty position."""
    return weights.empty if empty else 0.0


@kernel(inline="always")
def stuck_cost(stuck: bool, weights: SortingWeights) -> float:
    """Return the cost of returning an object to its position."""
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
        goal: Goal of the towers, shape (C, K).
        n_sizes: Number of sizes; code ``1 + colour * n_sizes + size`` is an object, 0 none.
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
