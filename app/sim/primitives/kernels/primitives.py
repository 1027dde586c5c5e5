"""A worker's task primitives, compiled: legs between places, played from sampled weights.

A script is a chain of *legs*: home to a cube or a dock, cube to dock, dock to cube, and back
home, each done by one hand; hands change at home only. Both ends of a leg are postures of the
worker's library; between them the joints follow a movement primitive,

    q(z) = W' phi(z),   W' = W + K ([q_0; q_1] - [W phi(0); W phi(1)]),

with ``phi`` the normalised Gaussians of ``promp.py``, ``W`` a sample of the leg's primitive
drawn beforehand and ``K`` the primitive's own gain for its two ends: conditioning by Matheron's
rule, so that the leg begins and ends exactly in the two postures. The phase z goes by the
minimum-jerk law; a leg may pause on its way.

Source: METHOD 3.2 (cycle) and 3.4 (primitives; execution time, pauses, starting phase,
reversal); Paraschos et al. 2013; Wilson et al. 2021 (pathwise conditioning). The weights come
from ``app/sim/primitives/primitive_library.py``.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels.rng import State, below, normal, uniform
from app.sim.primitives.kernels.script import MAX_MOVES, draw_pause, draw_posture

Index = NDArray[np.int64]

N_BASIS = 12
"""Gaussians per joint; those of ``promp.N_BASIS``."""
WIDTH = 0.7 / (N_BASIS - 1)
"""Their width [phase]; that of ``promp.usual_width``."""
SHORTEST_SEGMENT = 0.35
"""Least duration of a leg [s]."""
P_STOP = 0.15
"""Chance of a pause on the way of a leg."""
STOP_S = (0.2, 1.4)
"""Least and greatest length of such a pause [s]."""

_SCALE = np.exp(-0.5 * (np.linspace(0.0, 1.0, N_BASIS) / WIDTH) ** 2)
_SCALE.setflags(write=False)


class PrimitiveLibrary(NamedTuple):
    """What all workers of a cell can do."""

    samples: Vec
    """Weights drawn from the primitives [m, rad], shape (n_samples, 18, N_BASIS)."""
    gain: Vec
    """K of each primitive, shape (n_primitives, 18 * N_BASIS, 36): weights joint by joint, by
    the 18 joints at the start, then those at the end."""
    legs: Index
    """Primitive, first sample and number of samples of each leg, (n + 1, n + 1, 2, 3): from
    place, to place, hand; the last place is home; primitive -1 where there is no such leg."""
    duration: Vec
    """Mean and standard deviation of the log of a leg's duration [s], (n_primitives, 2)."""
    varied: bool
    """Whether durations vary, legs pause and scripts begin anywhere (METHOD 3.4)."""


class SegmentState(NamedTuple):
    """The legs of all workers' scripts beyond what every script has; rows (n_envs, W, ...)."""

    primitive: Index
    """Primitive of each leg, shape (n_envs, W, MAX_MOVES)."""
    sample: Index
    """Sample of each leg, shape (n_envs, W, MAX_MOVES)."""
    stop: Vec
    """Phase at which each leg pauses, 0: never, and how long [s], (n_envs, W, MAX_MOVES, 2)."""
    weights: Vec
    """Weights of the leg each worker is in, shape (n_envs, W, 18, N_BASIS)."""
    ready: Index
    """The leg these weights are of, -1 for none, shape (n_envs, W)."""


def empty_primitive_library() -> PrimitiveLibrary:
    """Return the primitive_library of workers who use none.

    Its samples are read-only, like a library's: all that kernels are handed is then of one
    type, and they are compiled once.
    """
    samples = np.zeros((1, 18, N_BASIS))
    samples.setflags(write=False)
    return PrimitiveLibrary(
        samples=samples,
        gain=np.zeros((1, 18 * N_BASIS, 36)),
        legs=np.full((1, 1, 2, 3), -1, dtype=np.int64),
        duration=np.zeros((1, 2)),
        varied=True,
    )


def new_segment_state(n_envs: int, n_workers: int) -> SegmentState:
    """Return rows for the legs of workers, no script drawn yet."""
    return SegmentState(
        primitive=np.zeros((n_envs, n_workers, MAX_MOVES), dtype=np.int64),
        sample=np.zeros((n_envs, n_workers, MAX_MOVES), dtype=np.int64),
        stop=np.zeros((n_envs, n_workers, MAX_MOVES, 2)),
        weights=np.zeros((n_envs, n_workers, 18, N_BASIS)),
        ready=np.full((n_envs, n_workers), -1, dtype=np.int64),
    )


@kernel(error_model="numpy")
def condition(sample: Vec, gain: Vec, before: Vec, after: Vec, away: Vec, out: Vec) -> None:
    """Write the weights of a leg between two postures.

    Args:
        sample: Weights W, shape (18, N_BASIS).
        gain: K of its primitive, shape (18 * N_BASIS, 36).
        before: Posture it begins in [m, rad], shape (18,).
        after: Posture it ends in [m, rad], shape (18,).
        away: Work space, shape (36,).
        out: Filled with W', shape (18, N_BASIS).
    """
    total = 0.0
    for i in range(N_BASIS):
        total += _SCALE[i]
    for j in range(18):
        start, end = 0.0, 0.0
        for i in range(N_BASIS):
            start += sample[j, i] * _SCALE[i]
            end += sample[j, i] * _SCALE[N_BASIS - 1 - i]
        away[j], away[18 + j] = before[j] - start / total, after[j] - end / total
    for j in range(18):
        for i in range(N_BASIS):
            change, row = 0.0, gain[j * N_BASIS + i]
            for k in range(36):
                change += row[k] * away[k]
            out[j, i] = sample[j, i] + change


@kernel(error_model="numpy")
def follow(
    weights: Vec, phase: float, rate: float, q_min: Vec, q_max: Vec, q: Vec, qd: Vec
) -> None:
    """Write joint positions and speeds at a phase, kept inside the joint limits.

    ``phi_i(z)`` is proportional to ``s_i r^i`` with ``s_i = exp(-c_i^2 / (2 h^2))`` and
    ``r = exp(z D / h^2)``, D the distance of the centres: the factors that all have in common
    cancel, and one exponential is enough. Its slope is ``phi_i (c_i - sum_k phi_k c_k) / h^2``.

    Args:
        weights: Weights, shape (18, N_BASIS).
        phase: z in [0, 1].
        rate: dz/dt [1/s].
        q_min: Lower joint limits [m, rad], shape (18,).
        q_max: Upper joint limits [m, rad], shape (18,).
        q: Filled [m, rad], shape (18,).
        qd: Filled [m/s, rad/s], shape (18,).
    """
    ratio = math.exp(phase / ((N_BASIS - 1) * WIDTH * WIDTH))
    total, centre, power = 0.0, 0.0, 1.0
    for i in range(N_BASIS):
        bump = _SCALE[i] * power
        total += bump
        centre += bump * i
        power *= ratio
    centre /= total
    per_step = rate / (WIDTH * WIDTH * (N_BASIS - 1))
    for j in range(18):
        value, slope, power = 0.0, 0.0, 1.0 / total
        for i in range(N_BASIS):
            part = weights[j, i] * (_SCALE[i] * power)
            value += part
            slope += part * (i - centre)
            power *= ratio
        inside = q_min[j] < value < q_max[j]
        q[j] = min(q_max[j], max(q_min[j], value))
        qd[j] = slope * per_step if inside else 0.0


@kernel(error_model="numpy")
def law(t: float, duration: float, stop_at: float, stop_s: float) -> tuple[float, float]:
    """Return phase and its rate [1/s] at a time of a leg.

    Without a pause, minimum jerk from 0 to 1. With one, minimum jerk from 0 to ``stop_at`` and
    from there to 1, each for its share of the duration, so that the leg is nowhere faster.

    Args:
        t: Time since the leg began [s].
        duration: Its duration, pauses not counted [s].
        stop_at: Phase of its pause; 0 for none.
        stop_s: Length of that [s].
    """
    begin, span = 0.0, 1.0
    if stop_at > 0.0:
        span = stop_at
        if t >= duration * stop_at:
            t = max(0.0, t - duration * stop_at - stop_s)
            begin, span = stop_at, 1.0 - stop_at
    seconds = duration * span
    x = min(1.0, max(0.0, t / seconds))
    phase = x * x * x * (10.0 + x * (6.0 * x - 15.0))
    rate = 30.0 * (x * (1.0 - x)) ** 2 / seconds
    return begin + span * phase, span * rate


@kernel()
def draw_segments(
    rng: State,
    primitive_library: PrimitiveLibrary,
    of_station: Index,
    n_cubes: int,
    first: int,
    start: Vec,
    duration: Vec,
    chosen: Index,
    primitive: Index,
    sample: Index,
    stop: Vec,
) -> int:
    """Draw a script of legs: home - cube - dock - home or reversed; some cycles skip home.

    Args:
        rng: Random stream.
        primitive_library: What the worker can do.
        of_station: First posture and count of each place and hand, shape (n + 1, 2, 2).
        n_cubes: Number of cubes; they come first among the places.
        first: Posture to start from, one at home; -1 draws one.
        start: Filled: start of each leg [s], shape (MAX_MOVES,).
        duration: Filled: its duration, pauses on the way not counted [s], (MAX_MOVES,).
        chosen: Filled with the postures between the legs, shape (MAX_MOVES + 1,).
        primitive: Filled, shape (MAX_MOVES,).
        sample: Filled, shape (MAX_MOVES,).
        stop: Filled: phase and length [s] of a pause on the way, shape (MAX_MOVES, 2).

    Returns:
        Number of legs; the last one ends at home.
    """
    home, varied = of_station.shape[0] - 1, primitive_library.varied
    chosen[0] = first if first >= 0 else draw_posture(rng, of_station, home, 0)
    place, hand, at_cube = home, 0, False
    t, n = 0.2 + 1.5 * uniform(rng) if varied else 0.5, 0
    while n + 4 <= MAX_MOVES:
        reverse = uniform(rng) < 0.5
        if place == home:
            hand = 0 if uniform(rng) < 0.6 else 1
        else:
            reverse = at_cube  # From a cube to a dock, from a dock to a cube.
        skip_home = uniform(rng) < 0.3 and n + 8 <= MAX_MOVES
        for leg in range(3):
            if leg == 2 and skip_home:
                break
            then = home
            if leg < 2:
                at_cube = (leg == 0) != reverse
                then = below(rng, n_cubes)
                if not at_cube:
                    then = n_cubes + below(rng, home - n_cubes)
            row = primitive_library.legs[place, then, hand]
            primitive[n] = row[0]
            sample[n] = row[1] + below(rng, row[2])
            chosen[n + 1] = draw_posture(rng, of_station, then, hand)
            start[n] = t
            duration[n] = _draw_duration(rng, primitive_library, row[0])
            stop[n, 0], stop[n, 1] = 0.0, 0.0
            if varied and uniform(rng) < P_STOP:
                stop[n, 0] = 0.25 + 0.5 * uniform(rng)
                stop[n, 1] = STOP_S[0] + (STOP_S[1] - STOP_S[0]) * uniform(rng)
            t += duration[n] + stop[n, 1]
            t += draw_pause(rng, then == home) if varied else 0.5
            place = then
            n += 1
    return n


@kernel()
def _draw_duration(rng: State, primitive_library: PrimitiveLibrary, primitive: int) -> float:
    """Draw a leg's duration [s], log-normal, no draw beyond two standard deviations."""
    mean, spread = (
        primitive_library.duration[primitive, 0],
        primitive_library.duration[primitive, 1],
    )
    away = min(2.0, max(-2.0, normal(rng))) if primitive_library.varied else 0.0
    return max(SHORTEST_SEGMENT, math.exp(mean + spread * away))
