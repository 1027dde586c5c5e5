"""Segments of task primitives between places, sampled and conditioned on both ends (compiled).

A script is a chain of *segments*: home to a cube or dock, cube to dock, dock to cube, and back
home, each done by one hand; the hand changes at home only. Both ends of a segment are postures
of the worker's library; between them the joints follow a movement primitive,

    q(z) = W' phi(z),   W' = W + K ([q_0; q_1] - [W phi(0); W phi(1)]),

with ``phi`` the normalised Gaussians of ``promp.py``, ``W`` a weight sample of the segment's
primitive and ``K`` the gain of that primitive for its two ends. By Matheron's rule the segment
begins and ends exactly in the two postures. The phase z follows the minimum-jerk profile; a
segment may pause.

Source: docs/method.md 3.2 (cycle) and 3.4 (primitives; execution time, pauses, starting phase,
reversal); Paraschos et al. 2013; Wilson et al. 2021 (pathwise conditioning). Weights come from
``app/sim/primitives/primitive_library.py``.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels.rng import State, below, normal, uniform
from app.sim.primitives.kernels.script import (
    MAX_MOVES,
    Moves,
    draw_pause,
    draw_posture,
    minimum_jerk,
)

Index = NDArray[np.int64]

N_BASIS = 12
"""Gaussians per joint."""
WIDTH = 0.7 / (N_BASIS - 1)
"""Their width [phase]; that of ``promp.usual_width``."""
SHORTEST_SEGMENT = 0.35
"""Shortest duration of a segment [s]."""
P_STOP = 0.15
"""Probability of a pause within a segment."""
STOP_S = (0.2, 1.4)
"""Shortest and longest pause [s]."""

_SCALE = np.exp(-0.5 * (np.linspace(0.0, 1.0, N_BASIS) / WIDTH) ** 2)
_SCALE.setflags(write=False)


class PrimitiveLibrary(NamedTuple):
    """Movement primitives of all segments of a cell's task."""

    samples: Vec
    """Weights drawn from the primitives [m, rad], shape (n_samples, 18, N_BASIS)."""
    gain: Vec
    """K of each primitive, shape (n_primitives, 18 * N_BASIS, 36): weights joint by joint, by
    the 18 joints at the start, then those at the end."""
    segments: Index
    """Primitive, first sample and number of samples of each segment, shape (n_places, n_places,
    2, 3), indexed by start place, end place and hand; home is the last place; primitive -1: no
    such segment."""
    duration: Vec
    """Mean and standard deviation of the log of a segment's duration [s], (n_primitives, 2)."""
    varied: bool
    """Whether durations and starting times are random and segments may pause
    (docs/method.md 3.4)."""


class SegmentState(NamedTuple):
    """Segments of all workers' scripts, rows (n_envs, W, ...)."""

    primitive: Index
    """Primitive of each segment, shape (n_envs, W, MAX_MOVES)."""
    sample: Index
    """Weight sample of each segment, shape (n_envs, W, MAX_MOVES)."""
    stop: Vec
    """Phase (0: none) and length [s] of a pause in each, shape (n_envs, W, MAX_MOVES, 2)."""
    weights: Vec
    """Conditioned weights of each worker's current segment, shape (n_envs, W, 18, N_BASIS)."""
    ready: Index
    """Segment to which ``weights`` belongs, -1 for none, shape (n_envs, W)."""


class Segments(NamedTuple):
    """Segments of one script; arrays that :func:`draw_segments` fills."""

    primitive: Index
    """Primitive of each segment, shape (MAX_MOVES,)."""
    sample: Index
    """Weight sample of each segment, shape (MAX_MOVES,)."""
    stop: Vec
    """Phase and length [s] of a pause in each segment, shape (MAX_MOVES, 2)."""


def empty_primitive_library() -> PrimitiveLibrary:
    """Return the library of workers that use no primitives.

    Samples are read-only, as in other libraries, so that kernels are compiled for one type.
    """
    samples = np.zeros((1, 18, N_BASIS))
    samples.setflags(write=False)
    return PrimitiveLibrary(
        samples=samples,
        gain=np.zeros((1, 18 * N_BASIS, 36)),
        segments=np.full((1, 1, 2, 3), -1, dtype=np.int64),
        duration=np.zeros((1, 2)),
        varied=True,
    )


def new_segment_state(n_envs: int, n_workers: int) -> SegmentState:
    """Return segment rows of all workers before any script is drawn."""
    return SegmentState(
        primitive=np.zeros((n_envs, n_workers, MAX_MOVES), dtype=np.int64),
        sample=np.zeros((n_envs, n_workers, MAX_MOVES), dtype=np.int64),
        stop=np.zeros((n_envs, n_workers, MAX_MOVES, 2)),
        weights=np.zeros((n_envs, n_workers, 18, N_BASIS)),
        ready=np.full((n_envs, n_workers), -1, dtype=np.int64),
    )


@kernel(error_model="numpy")
def condition(sample: Vec, gain: Vec, before: Vec, after: Vec, away: Vec, out: Vec) -> None:
    """Condition a weight sample on the two end postures of a segment.

    Args:
        sample: Weights W, shape (18, N_BASIS).
        gain: K of its primitive, shape (18 * N_BASIS, 36).
        before: Posture at its start [m, rad], shape (18,).
        after: Posture at its end [m, rad], shape (18,).
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
    """Write joint positions and speeds at a phase, clipped to the joint limits.

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
def phase_profile(
    t: float, duration: float, stop_at: float, stop_s: float
) -> tuple[float, float]:
    """Return the phase and its rate [1/s] at a time of a segment.

    Minimum jerk from 0 to 1; with a pause, minimum jerk from 0 to ``stop_at`` and from there to
    1, each with its share of the duration, so that the peak rate does not increase.

    Args:
        t: Time since the start of the segment [s].
        duration: Duration without pauses [s].
        stop_at: Phase of the pause; 0 for none.
        stop_s: Length of the pause [s].
    """
    begin, span = 0.0, 1.0
    if stop_at > 0.0:
        span = stop_at
        if t >= duration * stop_at:
            t = max(0.0, t - duration * stop_at - stop_s)
            begin, span = stop_at, 1.0 - stop_at
    phase, rate = minimum_jerk(t, duration * span)
    return begin + span * phase, span * rate


@kernel()
def draw_segments(
    rng: State,
    library: PrimitiveLibrary,
    of_station: Index,
    n_cubes: int,
    first: int,
    moves: Moves,
    segments: Segments,
) -> int:
    """Draw a script of cycles home - cube - dock - home and return its number of segments.

    A cycle may be reversed, or omit the return to home; the last segment ends at home.

    Args:
        library: Movement primitives of the cell.
        of_station: First posture and count of each place and hand, shape (n_places, 2, 2).
        n_cubes: Number of cubes; they are the first places.
        first: Initial posture, one at home; -1 draws one.
        moves: Filled; durations exclude pauses within segments.
        segments: Filled.
    """
    home, varied = of_station.shape[0] - 1, library.varied
    moves.chosen[0] = first if first >= 0 else draw_posture(rng, of_station, home, 0)
    place, hand, at_cube = home, 0, False
    t, n = 0.2 + 1.5 * uniform(rng) if varied else 0.5, 0
    while n + 4 <= MAX_MOVES:
        reverse = uniform(rng) < 0.5
        if place == home:
            hand = 0 if uniform(rng) < 0.6 else 1
        else:
            reverse = at_cube  # From a cube to a dock, from a dock to a cube.
        skip_home = uniform(rng) < 0.3 and n + 8 <= MAX_MOVES
        for k in range(3):
            if k == 2 and skip_home:
                break
            then = home
            if k < 2:
                at_cube = (k == 0) != reverse
                then = below(rng, n_cubes)
                if not at_cube:
                    then = n_cubes + below(rng, home - n_cubes)
            row = library.segments[place, then, hand]
            segments.primitive[n] = row[0]
            segments.sample[n] = row[1] + below(rng, row[2])
            moves.chosen[n + 1] = draw_posture(rng, of_station, then, hand)
            moves.start[n] = t
            moves.duration[n] = _draw_duration(rng, library, row[0])
            segments.stop[n, 0], segments.stop[n, 1] = 0.0, 0.0
            if varied and uniform(rng) < P_STOP:
                segments.stop[n, 0] = 0.25 + 0.5 * uniform(rng)
                segments.stop[n, 1] = STOP_S[0] + (STOP_S[1] - STOP_S[0]) * uniform(rng)
            t += moves.duration[n] + segments.stop[n, 1]
            t += draw_pause(rng, then == home) if varied else 0.5
            place = then
            n += 1
    return n


@kernel()
def _draw_duration(rng: State, library: PrimitiveLibrary, primitive: int) -> float:
    """Draw a segment's duration [s], log-normal, truncated at two standard deviations."""
    mean, spread = library.duration[primitive, 0], library.duration[primitive, 1]
    away = min(2.0, max(-2.0, normal(rng))) if library.varied else 0.0
    return max(SHORTEST_SEGMENT, math.exp(mean + spread * away))
