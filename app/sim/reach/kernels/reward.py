"""Reward of the reach scenario as named terms (METHOD 2.3), compiled.

``r = c_p (d_old - gamma d) - c_d d - c_a |c| - c_step - c_c [collision] + c_s [success]``, with
``d`` the distance of tcp and goal and ``|c|`` the Euclidean norm of the period's second
coefficients; under speed and separation monitoring less ``c_o`` in a period that it stops.
With ``c_p = c_step = 0`` it is the source's; with ``c_d = c_a = 0`` it rewards
progress, which learned far better where a collision ends the episode: a cost of distance alone
then rewards an early end.
"""

import math
from typing import NamedTuple

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel


class ReachWeights(NamedTuple):
    """Coefficients of the terms; a preset gives them."""

    c_d: float
    """Cost of the distance to the goal, per period [1/m]."""
    c_p: float
    """Progress toward the goal [1/m]."""
    gamma: float
    """Discount of the progress."""
    c_a: float
    """Cost of the coefficients' norm, half the acceleration [s^2/rad]."""
    c_step: float
    """Cost of a control period."""
    c_c: float
    """Cost of a period with a collision."""
    c_s: float
    """Bonus of a success."""
    c_o: float = 0.0
    """Cost of a period in which speed and separation monitoring stops the robot."""


@kernel(inline="always")
def distance_cost(d: float, c_d: float) -> float:
    """Return the (negative) reward for being away from the goal [m]."""
    return -c_d * d


@kernel(inline="always")
def progress(d_old: float, d: float, c_p: float, gamma: float) -> float:
    """Return the reward for coming closer: positive when ``d`` [m] is less than ``d_old``."""
    return c_p * (d_old - gamma * d)


@kernel(inline="always")
def action_cost(c: Vec, c_a: float) -> float:
    """Return the (negative) reward for accelerating; ``c`` [rad/s^2], shape (6,)."""
    if c_a == 0.0:
        return 0.0
    square = 0.0
    for j in range(6):
        square += c[j] * c[j]
    return -c_a * math.sqrt(square)


@kernel(inline="always")
def end_reward(collided: bool, succeeded: bool, c_c: float, c_s: float) -> float:
    """Return the reward for what happened in the period: collision, success or neither."""
    return (c_s if succeeded else 0.0) - (c_c if collided else 0.0)


@kernel()
def reward(
    d_old: float, d: float, c: Vec, collided: bool, succeeded: bool, weights: ReachWeights
) -> float:
    """Return the sum of all terms for one period.

    Args:
        d_old: Distance to the goal before [m].
        d: Distance to the goal after [m].
        c: Second coefficients of the period [rad/s^2], shape (6,).
        collided: Whether there was a collision in the period.
        succeeded: Whether the period ended in success.
        weights: Coefficients.
    """
    return (
        progress(d_old, d, weights.c_p, weights.gamma)
        + distance_cost(d, weights.c_d)
        + action_cost(c, weights.c_a)
        - weights.c_step
        + end_reward(collided, succeeded, weights.c_c, weights.c_s)
    )
