"""Scripts of minimum-jerk moves between postures, and their random generation (compiled).

Move ``k`` of a script leaves posture ``k`` at ``start[k]``, reaches posture ``k + 1`` after
``duration[k]``, and rests there until the next move starts. Scripts do not depend on the robot.

Source: docs/method.md 3.2 (cycle home - cube - dock and back) and 3.4 (timing, pauses, starting
phase, reversal); minimum jerk: Flash and Hogan (1985).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels.rng import State, below, normal, uniform

Index = NDArray[np.int64]

MAX_MOVES = 48
"""Moves per script; enough for 20 s from a random starting phase."""
PACE_MEDIAN = 0.55
"""Median of the mean hand speed of a move [m/s]."""
PACE_SPREAD = 0.42
"""Standard deviation of the logarithm of the mean hand speed."""
PACE_MIN, PACE_MAX = 0.22, 1.05
"""Bounds of the mean hand speed [m/s]."""
SHORTEST_MOVE = 0.35
"""Least duration of a move [s]."""


class Moves(NamedTuple):
    """Moves of one script; arrays that :func:`draw_script` fills."""

    start: Vec
    """Start of each move [s], shape (MAX_MOVES,)."""
    duration: Vec
    """Duration of each move [s], shape (MAX_MOVES,)."""
    chosen: Index
    """Indices of the postures between the moves, shape (MAX_MOVES + 1,)."""


@kernel()
def script_at(
    t: float, n_moves: int, start: Vec, duration: Vec, postures: Vec, q: Vec, qd: Vec
) -> None:
    """Write joint positions and speeds of a script at one time.

    Args:
        t: Time [s]; before the first move the first posture holds.
        start: Start of each move [s], shape (>= n_moves,).
        duration: Duration of each move [s], shape (>= n_moves,).
        postures: Postures [m, rad], shape (>= n_moves + 1, 18).
        q: Filled with joint positions [m, rad], shape (18,).
        qd: Filled with joint speeds [m/s, rad/s], shape (18,).
    """
    move = 0
    while move + 1 < n_moves and start[move + 1] <= t:
        move += 1
    move_at(t, start[move], duration[move], postures[move], postures[move + 1], 1.0, q, qd)


@kernel(error_model="numpy", inline="always")
def minimum_jerk(t: float, duration: float) -> tuple[float, float]:
    """Return the minimum-jerk phase in [0, 1] and its rate [1/s], at rest at both ends.

    Args:
        t: Time since the start [s]; clipped to the motion.
        duration: Duration of the motion [s].
    """
    x = min(1.0, max(0.0, t / duration))
    phase = x * x * x * (10.0 + x * (6.0 * x - 15.0))
    return phase, 30.0 * (x * (1.0 - x)) ** 2 / duration


@kernel(error_model="numpy")
def move_at(
    t: float,
    start: float,
    duration: float,
    before: Vec,
    after: Vec,
    pace: float,
    q: Vec,
    qd: Vec,
) -> None:
    """Write joint positions and speeds of one minimum-jerk move.

    Args:
        t: Time in the script [s].
        start: Start of the move [s].
        duration: Its duration [s].
        before: Posture it leaves [m, rad], shape (18,).
        after: Posture it arrives at [m, rad], shape (18,).
        pace: Script's seconds per second; scales the speeds.
        q: Filled with joint positions [m, rad], shape (18,).
        qd: Filled with joint speeds [m/s, rad/s], shape (18,).
    """
    phase, rate = minimum_jerk(t - start, duration)
    for j in range(18):
        span = after[j] - before[j]
        q[j] = before[j] + phase * span
        qd[j] = rate * span * pace


@kernel()
def draw_script(
    state: State, of_station: Index, n_cubes: int, hands: Vec, first: int, moves: Moves
) -> int:
    """Draw a script of cycles home - cube - dock - home and return its number of moves.

    A cycle may be reversed, or omit the return to home. Pace, pauses, hand and the variant of
    each posture are random.

    Args:
        state: Random stream.
        of_station: Index of the first posture and number of postures of each place and hand,
            shape (n_places, 2, 2); cubes come first, home last.
        hands: Palm positions of each posture [m], shape (n_postures, 2, 3).
        first: Initial posture; -1 draws one at home.
        moves: Filled.
    """
    home = of_station.shape[0] - 1
    hand = 0 if uniform(state) < 0.6 else 1
    now = first if first >= 0 else draw_posture(state, of_station, home, hand)
    moves.chosen[0] = now
    t, n = 0.2 + 1.5 * uniform(state), 0
    while n + 3 <= MAX_MOVES:
        hand = 0 if uniform(state) < 0.6 else 1
        cube = below(state, n_cubes)
        dock = n_cubes + below(state, home - n_cubes)
        reverse = uniform(state) < 0.5
        skip_home = uniform(state) < 0.3
        for k in range(3):
            place = home
            if k < 2:
                place = cube if (k == 0) != reverse else dock
            elif skip_home:
                break
            then = draw_posture(state, of_station, place, hand)
            moves.start[n] = t
            moves.duration[n] = _draw_duration(state, hands[now], hands[then])
            moves.chosen[n + 1] = then
            t += moves.duration[n] + draw_pause(state, place == home)
            now = then
            n += 1
    return n


@kernel()
def draw_posture(state: State, of_station: Index, place: int, hand: int) -> int:
    """Draw a posture of a place and hand from ``of_station``, shape (n_places, 2, 2)."""
    first, count = of_station[place, hand, 0], of_station[place, hand, 1]
    return int(first + below(state, count))


@kernel()
def _draw_duration(state: State, hands_from: Vec, hands_to: Vec) -> float:
    """Draw a move's duration [s] from the larger hand displacement and a random pace."""
    longest = 0.0
    for hand in range(2):
        square = 0.0
        for i in range(3):
            square += (hands_to[hand, i] - hands_from[hand, i]) ** 2
        longest = max(longest, math.sqrt(square))
    pace = PACE_MEDIAN * math.exp(PACE_SPREAD * normal(state))
    return max(SHORTEST_MOVE, longest / min(PACE_MAX, max(PACE_MIN, pace)))


@kernel()
def draw_pause(state: State, at_home: bool) -> float:
    """Draw the rest after a move [s]; at a station it is short, with occasional long rests."""
    if at_home:
        return 0.3 + 2.2 * uniform(state)
    if uniform(state) < 0.12:
        return 1.5 + 2.0 * uniform(state)
    return 0.1 + 0.8 * uniform(state)
