"""The ways that looking ahead tries in place of the policy's own, compiled.

A way leads the robot somewhere for some steps, and then goes on as ``lookahead.py`` says: to a
posture, or to a stop, and then as the policy wants; straight to the goal; or it is a *dash*:
pan, shoulder and elbow each at full speed forward or back, or held, and then a stop.
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from app.sim.kernels.arm import Arm
from app.sim.kernels.compiled import kernel
from app.sim.kernels.foretold import N_PLAYED
from app.sim.ports import Vec

GAIN = 5.0
"""Speed wanted of a joint per way left to a posture [1/s]."""
PASSED = -1
"""In place of the number of a way, or of a posture: the policy's action passes as it is."""
POSTURES = (
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.0, 0.5, -0.5, 0.0, 0.0, 0.0),
    (0.0, -0.3, 0.7, 0.0, 0.0, 0.0),
    (0.9, 0.0, 0.0, 0.0, 0.0, 0.0),
    (-0.9, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.0, 0.6, 0.3, 0.0, 0.0, 0.0),
)
"""Where ways lead first, less home [rad]: home, ahead and low, drawn up, to either side, ahead
and down."""
NAMES = ("home", "low", "up", "left", "right", "down", "stop")
"""Their names; the last is to stop where it is."""
LASTING = (2, 8, 15)
"""For how many steps they do."""
N_POSTURES = len(POSTURES) + 1
"""Postures, and the one at which it stops."""
STRAIGHT = N_POSTURES
"""In place of a posture: the tcp straight to the goal, all the time."""
N_FIRST = N_POSTURES * len(LASTING) + 1
"""Ways but the dashes: each posture for each time, then the policy; straight."""
STRAIGHT_WAY = N_FIRST - 1
"""Number of the straight one."""
SIGNS = tuple(signs for signs in product((0.0, 1.0, -1.0), repeat=3) if any(signs))
"""Directions of the dashes: of pan, shoulder and elbow."""
DIRECTIONS = np.array(SIGNS)
DASHING = (6, 15)
"""For how many steps they last."""
DASH = STRAIGHT + 1
"""In place of a posture: the first of them."""
N_OTHERS = N_FIRST + len(DIRECTIONS) * len(DASHING)
"""All ways; the dashes come last."""

Floats = NDArray[np.float32]


@kernel()
def way_of(k: int) -> tuple[int, int]:
    """Return posture and number of steps of a way by its number, or of PASSED."""
    if k == PASSED:
        return PASSED, 0
    if k >= N_FIRST:
        k -= N_FIRST
        return DASH + k // len(DASHING), DASHING[k % len(DASHING)]
    if k == STRAIGHT_WAY:
        return STRAIGHT, N_PLAYED
    return k // len(LASTING), LASTING[k % len(LASTING)]


@kernel()
def write_toward(arm: Arm, aim: Vec, posture: int, q: Vec, act: Floats) -> None:
    """Write the action that leads to a posture, or stops.

    Args:
        arm: Model and limits.
        aim: Postures [rad], shape (N_POSTURES, 6).
        posture: Which; the last stops.
        q: Joints [rad], shape (6,).
        act: Filled, shape (6,).
    """
    for j in range(6):
        wanted = 0.0
        if posture < N_POSTURES - 1:
            wanted = GAIN * (aim[posture, j] - q[j]) / arm.qd_max[j]
        act[j] = max(-1.0, min(1.0, wanted))


@kernel()
def write_dash(direction: int, lasts: bool, act: Floats) -> None:
    """Write the action of a dash, or of the stop after it, shape (6,)."""
    for j in range(6):
        act[j] = DIRECTIONS[direction, j] if lasts and j < 3 else 0.0
