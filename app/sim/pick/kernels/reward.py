"""Reward of the pick scenario (docs/method.md 3.3, compiled).

``r = c_d (d_old - gamma d) + c_th (th_old - gamma th) - c_c [collision] - c_step - c_v
|v_tcp| [d <= d_v] + c_s [success]``; ``gamma`` is 1 for undiscounted progress.

Deviates: (5.11) prints ``d - d_old`` and table 5.1 prints ``c_c`` and ``c_v`` as -1, which
would reward moving away and colliding; the text asks for the signs used here.
"""

from typing import NamedTuple

from app.sim.core.jit import kernel
from app.sim.scenario.kernels.episode import progress


class RewardWeights(NamedTuple):
    """Coefficients of the reward terms; a preset sets them."""

    c_d: float
    """Progress toward the target [1/m]."""
    c_th: float
    """Progress toward a vertical tool [1/rad]."""
    c_c: float
    """Cost of a collision."""
    c_step: float
    """Cost of a control period."""
    c_v: float
    """Cost of tcp speed near the target [s/m]."""
    d_v: float
    """Distance within which tcp speed is penalised [m]."""
    c_s: float
    """Bonus for success."""
    gamma: float
    """Discount of the progress terms."""


@kernel()
def speed_near_target(speed: float, distance: float, weights: RewardWeights) -> float:
    """Return the (negative) reward for tcp speed [m/s] within ``d_v`` of the target."""
    return -weights.c_v * speed if distance <= weights.d_v else 0.0


@kernel()
def reward(
    d_old: float,
    d: float,
    tilt_old: float,
    tilt: float,
    speed: float,
    collided: bool,
    succeeded: bool,
    weights: RewardWeights,
) -> float:
    """Return the reward of one control period.

    Args:
        d_old: Distance to the target before [m].
        d: Distance to the target after [m].
        tilt_old: Angle of the tool to the vertical before [rad].
        tilt: Angle of the tool to the vertical after [rad].
        speed: Speed of the tcp after [m/s].
        collided: Whether the control period ended in a collision.
        succeeded: Whether it ended in success.
        weights: Coefficients.
    """
    total = progress(d_old, d, weights.c_d, weights.gamma)
    total += progress(tilt_old, tilt, weights.c_th, weights.gamma)
    total += speed_near_target(speed, d, weights) - weights.c_step
    if collided:
        total -= weights.c_c
    if succeeded:
        total += weights.c_s
    return total
