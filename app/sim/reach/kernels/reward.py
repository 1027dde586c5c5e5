"""Reward of the reach scenario (docs/method.md 2.3, compiled).

``r = c_p (d_old - gamma d) - c_d d - c_a |c| - c_step - c_c [collision] + c_s [success]``, with
``d`` the distance of tcp and goal and ``|c|`` the Euclidean norm of the control period's second
coefficients; speed and separation monitoring subtracts ``c_o`` in each control period that it
stops. ``c_p = c_step = 0`` is the thesis' reward; ``c_d = c_a = 0`` rewards progress, which
learned far better where a collision ends the episode: a cost of distance alone rewards an early
end.
"""

import math
from typing import NamedTuple

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.scenario.kernels.episode import progress


class ReachWeights(NamedTuple):
    """Coefficients of the reward terms; a preset sets them."""

    c_d: float
    """Cost of the distance to the goal per control period [1/m]."""
    c_p: float
    """Progress toward the goal [1/m]."""
    gamma: float
    """Discount of the progress."""
    c_a: float
    """Cost of the norm of the coefficients, half the acceleration [s^2/rad]."""
    c_step: float
    """Cost of a control period."""
    c_c: float
    """Cost of a control period with a collision."""
    c_s: float
    """Bonus for success."""
    c_o: float = 0.0
    """Cost of a control period in which speed and separation monitoring stops the robot."""


@kernel(inline="always")
def action_cost(c: Vec, c_a: float) -> float:
    """Return the (negative) reward for accelerating; ``c`` [rad/s^2], shape (6,)."""
    if c_a == 0.0:
        return 0.0
    square = 0.0
    for j in range(6):
        square += c[j] * c[j]
    return -c_a * math.sqrt(square)


@kernel()
def reward(
    d_old: float, d: float, c: Vec, collided: bool, succeeded: bool, weights: ReachWeights
) -> float:
    """Return the reward of one control period.

    Args:
        d_old: Distance to the goal before [m].
        d: Distance to the goal after [m].
        c: Coefficients of t^2 in the control period [rad/s^2], shape (6,).
        collided: Whether there was a collision in it.
        succeeded: Whether it ended in success.
        weights: Coefficients.
    """
    bonus = weights.c_s if succeeded else 0.0
    cost = weights.c_c if collided else 0.0
    return (
        progress(d_old, d, weights.c_p, weights.gamma)
        - weights.c_d * d
        + action_cost(c, weights.c_a)
        - weights.c_step
        + (bonus - cost)
    )
