"""The ways that looking ahead tries in place of the policy's own, compiled.

A way leads the robot somewhere for some steps, and then goes on as ``lookahead.py`` says: to a
posture, or to a stop, and then as the policy wants; straight to the goal; or it is a *dash*:
pan, shoulder and elbow each at full speed forward or back, or held, and then a stop; or a
*dart*: to a posture that is drawn, for a time that is drawn, and then straight to the goal.
"""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.reach.rollout.kernels.prediction import MOMENTS, N_PLAYED
from app.sim.robot.kernels.arm import Arm

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
STOP = N_POSTURES - 1
"""In place of a posture: to stop."""
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
DART = DASH + len(DIRECTIONS)
"""In place of a posture: that of a dart."""
N_DRAWN = N_FIRST + len(DIRECTIONS) * len(DASHING)
"""Ways but the darts."""
N_OTHERS = N_DRAWN + 1
"""All ways; first those that the policy ends, then the dashes; the darts are the last one."""
N_DARTS, N_DARTS_LAYERED = 32, 128
"""Darts of one decision, and under a safety layer, where most of the ways begun are darts."""
DART_PLAYED = MOMENTS - 1
"""For how many steps a dart is played, and the longest that one leads away."""
AROUND = np.array([1.5, 0.8, 0.8, 0.8, 0.8, 0.0])
"""How far from home, or from where the robot is, a dart may lead [rad]."""
WAITING = 0.25
"""Share of those drawn that first stop."""
VARIED = 0.7
"""Share of the darts that are like the one that came nearest to the goal so far."""
WIDEST, LONGEST = 0.3, 8.0
"""By how much they differ from it at most, as a standard deviation: shares of AROUND, steps."""

Floats = NDArray[np.float32]


@kernel()
def way_of(k: int) -> tuple[int, int]:
    """Return posture and number of steps of a way by its number, or of PASSED.

    A dart's are drawn: see :func:`draw_dart`.
    """
    if k == PASSED:
        return PASSED, 0
    if k == N_DRAWN:
        return DART, DART_PLAYED
    if k >= N_FIRST:
        k -= N_FIRST
        return DASH + k // len(DASHING), DASHING[k % len(DASHING)]
    if k == STRAIGHT_WAY:
        return STRAIGHT, N_PLAYED
    return k // len(LASTING), LASTING[k % len(LASTING)]


@kernel()
def write_toward(arm: Arm, aim: Vec, q: Vec, act: Floats) -> None:
    """Write the action that leads to a posture.

    Args:
        arm: Model and limits.
        aim: The posture [rad], shape (6,).
        q: Joints [rad], shape (6,).
        act: Filled, shape (6,).
    """
    for j in range(6):
        act[j] = max(-1.0, min(1.0, GAIN * (aim[j] - q[j]) / arm.limits.qd_max[j]))


@kernel()
def write_dash(direction: int, lasts: bool, act: Floats) -> None:
    """Write the action of a dash, or of the stop after it, shape (6,)."""
    for j in range(6):
        act[j] = DIRECTIONS[direction, j] if lasts and j < 3 else 0.0


@kernel()
def draw_dart(arm: Arm, q: Vec, rng: random.State, aim: Vec) -> int:
    """Draw where a dart leads first; return for how many steps.

    Args:
        arm: Model and limits.
        q: Joints now [rad], shape (6,).
        rng: Stream, shape (1,).
        aim: Filled [rad], shape (6,).
    """
    kind = random.uniform(rng)
    for j in range(6):
        away = 0.0 if kind < WAITING else AROUND[j] * (2.0 * random.uniform(rng) - 1.0)
        middle = q[j] if kind < 0.5 * (1.0 + WAITING) else arm.home[j]
        aim[j] = min(arm.limits.q_max[j], max(arm.limits.q_min[j], middle + away))
    return 1 + random.below(rng, DART_PLAYED - 1)


@kernel()
def vary_dart(arm: Arm, aim: Vec, lasting: int, rng: random.State, out: Vec) -> int:
    """Draw a dart like another one; return for how many steps it leads away.

    Args:
        arm: Model and limits.
        aim: Where the other one leads first [rad], shape (6,).
        lasting: For how many steps.
        rng: Stream, shape (1,).
        out: Filled [rad], shape (6,).
    """
    share = random.uniform(rng)
    for j in range(6):
        wanted = aim[j] + share * WIDEST * AROUND[j] * random.normal(rng)
        out[j] = min(arm.limits.q_max[j], max(arm.limits.q_min[j], wanted))
    return max(0, lasting + int(share * LONGEST * random.normal(rng)))
