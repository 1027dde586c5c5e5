"""Candidate action sequences of the rollout policy improvement (compiled).

A candidate moves the robot for some steps and then continues as its kind says:

- to a via configuration, or a stop, followed by the policy;
- straight to the goal;
- a *bang-bang* evasion: pan, shoulder and elbow each at full speed forward or backward, or
  held, followed by a stop;
- to a randomly sampled waypoint for a random time, followed by a straight motion to the goal
  (random shooting).
"""

from itertools import product
from typing import NamedTuple

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels import rng as random
from app.sim.prediction.kernels.networks import Floats
from app.sim.reach.rollout.kernels.prediction import HORIZON_STEPS, N_MOMENTS
from app.sim.robot.kernels.arm import Arm

GAIN = 5.0
"""Joint speed per remaining joint difference [1/s]."""
POLICY = -1
"""In place of the number or kind of a candidate: the policy's own action."""
VIAS = (
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.0, 0.5, -0.5, 0.0, 0.0, 0.0),
    (0.0, -0.3, 0.7, 0.0, 0.0, 0.0),
    (0.9, 0.0, 0.0, 0.0, 0.0, 0.0),
    (-0.9, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.0, 0.6, 0.3, 0.0, 0.0, 0.0),
)
"""Via configurations relative to home [rad]."""
VIA_NAMES = ("home", "low", "up", "left", "right", "down", "stop")
"""Names of the via configurations and of the stop."""
VIA_STEPS = (2, 8, 15)
"""Durations of the motion to a via configuration [steps]."""
N_VIAS = len(VIAS) + 1
"""Via configurations and the stop."""
STOP = N_VIAS - 1
"""Kind: stop."""
STRAIGHT = N_VIAS
"""Kind: the tcp straight to the goal."""
N_FIXED = N_VIAS * len(VIA_STEPS) + 1
"""Candidates that are not evasions or samples: each via for each duration; straight."""
STRAIGHT_CANDIDATE = N_FIXED - 1
"""Number of the straight candidate."""
SIGNS = tuple(signs for signs in product((0.0, 1.0, -1.0), repeat=3) if any(signs))
"""Directions of pan, shoulder and elbow in each bang-bang evasion."""
DIRECTIONS = np.array(SIGNS)
EVASION_STEPS = (6, 15)
"""Durations of an evasion [steps]."""
EVASION = STRAIGHT + 1
"""Kind of the first evasion."""
SAMPLE = EVASION + len(DIRECTIONS)
"""Kind: sampled waypoint."""
N_DETERMINISTIC = N_FIXED + len(DIRECTIONS) * len(EVASION_STEPS)
"""Candidates that are not sampled."""
N_SAMPLES, N_SAMPLES_SSM = 32, 128
"""Samples per decision, without and with a speed and separation constraint."""
SAMPLE_STEPS = N_MOMENTS - 1
"""Steps of a sampled candidate, and the longest motion to its waypoint."""
SPREAD = np.array([1.5, 0.8, 0.8, 0.8, 0.8, 0.0])
"""Half width of the box around home or the present configuration in which waypoints are sampled
[rad]."""
STOP_SHARE = 0.25
"""Share of samples whose waypoint is the present configuration itself."""
PERTURBED_SHARE = 0.7
"""Share of samples that perturb the incumbent, the best sample so far."""
WIDEST, LONGEST = 0.3, 8.0
"""Largest standard deviation of a perturbation: as a share of SPREAD, and in steps."""


class CandidateSequence(NamedTuple):
    """One candidate action sequence."""

    kind: int
    """Number of a via configuration, STOP, STRAIGHT, EVASION + direction, SAMPLE or POLICY."""
    steps: int
    """Duration of its first part [steps]."""


@kernel()
def candidate_of(k: int) -> CandidateSequence:
    """Return a candidate by its number; waypoint and duration of a sample are drawn later."""
    if k == POLICY:
        return CandidateSequence(POLICY, 0)
    if k == N_DETERMINISTIC:
        return CandidateSequence(SAMPLE, SAMPLE_STEPS)
    if k >= N_FIXED:
        k -= N_FIXED
        n = len(EVASION_STEPS)
        return CandidateSequence(EVASION + k // n, EVASION_STEPS[k % n])
    if k == STRAIGHT_CANDIDATE:
        return CandidateSequence(STRAIGHT, HORIZON_STEPS)
    return CandidateSequence(k // len(VIA_STEPS), VIA_STEPS[k % len(VIA_STEPS)])


@kernel()
def write_joint_move(arm: Arm, aim: Vec, q: Vec, act: Floats) -> None:
    """Write the action that moves all joints to a configuration.

    Args:
        aim: The configuration [rad], shape (6,).
        q: Joint positions [rad], shape (6,).
        act: Filled, shape (6,).
    """
    for j in range(6):
        act[j] = max(-1.0, min(1.0, GAIN * (aim[j] - q[j]) / arm.limits.qd_max[j]))


@kernel()
def write_bang_bang(direction: int, moving: bool, act: Floats) -> None:
    """Write the action of an evasion, or of the stop after it, shape (6,)."""
    for j in range(6):
        act[j] = DIRECTIONS[direction, j] if moving and j < 3 else 0.0


@kernel()
def sample_waypoint(arm: Arm, q: Vec, rng: random.State, aim: Vec) -> int:
    """Sample a waypoint uniformly; return the duration of the motion to it [steps].

    Args:
        q: Joint positions [rad], shape (6,).
        rng: Random stream, shape (1,).
        aim: Filled with the waypoint [rad], shape (6,).
    """
    kind = random.uniform(rng)
    for j in range(6):
        away = 0.0 if kind < STOP_SHARE else SPREAD[j] * (2.0 * random.uniform(rng) - 1.0)
        middle = q[j] if kind < 0.5 * (1.0 + STOP_SHARE) else arm.home[j]
        aim[j] = min(arm.limits.q_max[j], max(arm.limits.q_min[j], middle + away))
    return 1 + random.below(rng, SAMPLE_STEPS - 1)


@kernel()
def perturb_waypoint(arm: Arm, aim: Vec, steps: int, rng: random.State, out: Vec) -> int:
    """Sample a waypoint near another one; return the duration of the motion to it [steps].

    Args:
        aim: The other waypoint [rad], shape (6,).
        steps: Duration of the motion to the other waypoint [steps].
        rng: Random stream, shape (1,).
        out: Filled with the waypoint [rad], shape (6,).
    """
    share = random.uniform(rng)
    for j in range(6):
        wanted = aim[j] + share * WIDEST * SPREAD[j] * random.normal(rng)
        out[j] = min(arm.limits.q_max[j], max(arm.limits.q_min[j], wanted))
    return max(0, steps + int(share * LONGEST * random.normal(rng)))
