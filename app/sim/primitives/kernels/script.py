"""A person's movements as a script of postures and minimum-jerk moves, compiled.

A script is a list of moves: move ``k`` leaves posture ``k`` at ``start[k]``, arrives at
posture ``k + 1`` after ``duration[k]``, and rests there until the next one starts. It does
not depend on the robot, so an episode's whole human motion is fixed when the episode starts.

Source: METHOD 3.2 (cycle home - cube - dock and back) and 3.4 (timing, pauses, starting phase,
reversal); minimum jerk after Flash and Hogan (1985).
"""

import math

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.core.kernels.rng import State, below, normal, uniform

Index = NDArray[np.int64]

MAX_MOVES = 48
"""Moves per script; enough for 20 s and a random starting phase."""
PACE_MEDIAN = 0.55
"""Median over moves of the mean hand speed [m/s]."""
PACE_SPREAD = 0.42
"""Standard deviation of the logarithm of the mean hand speed."""
PACE_MIN, PACE_MAX = 0.22, 1.05
"""Bounds of the mean hand speed [m/s]."""
SHORTEST_MOVE = 0.35
"""Least duration of a move [s]."""


@kernel()
def script_at(
    t: float, n_moves: int, start: Vec, duration: Vec, postures: Vec, q: Vec, qd: Vec
) -> None:
    """Write joint positions and speeds at one time.

    Args:
        t: Time [s]; before the first move the first posture is held.
        n_moves: Number of moves.
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
    phase = min(1.0, max(0.0, (t - start) / duration))
    blend = phase * phase * phase * (10.0 + phase * (6.0 * phase - 15.0))
    rate = 30.0 * (phase * (1.0 - phase)) ** 2 / duration
    for j in range(18):
        span = after[j] - before[j]
        q[j] = before[j] + blend * span
        qd[j] = rate * span * pace


@kernel()
def draw_script(
    state: State,
    of_station: Index,
    n_stations: int,
    n_cubes: int,
    hands: Vec,
    first: int,
    start: Vec,
    duration: Vec,
    chosen: Index,
) -> int:
    """Draw a script through a library of postures.

    Cycles go home - cube - dock - home, or reversed; some skip home. Pace, pauses, hand and
    variant of each posture are random.

    Args:
        state: Random stream.
        of_station: First posture of each (place, hand), shape (n_stations + 1, 2, 2): first
            index and count; place ``n_stations`` is home.
        n_stations: Number of stations, cubes first.
        n_cubes: Number of cubes.
        hands: Palm positions of each posture [m], shape (n_postures, 2, 3).
        first: Posture to start from; -1 draws one at home.
        start: Filled [s], shape (MAX_MOVES,).
        duration: Filled [s], shape (MAX_MOVES,).
        chosen: Filled with posture numbers, shape (MAX_MOVES + 1,).

    Returns:
        Number of moves.
    """
    hand = 0 if uniform(state) < 0.6 else 1
    now = first if first >= 0 else draw_posture(state, of_station, n_stations, hand)
    chosen[0] = now
    t, n = 0.2 + 1.5 * uniform(state), 0
    while n + 3 <= MAX_MOVES:
        hand = 0 if uniform(state) < 0.6 else 1
        cube = below(state, n_cubes)
        dock = n_cubes + below(state, n_stations - n_cubes)
        reverse = uniform(state) < 0.5
        skip_home = uniform(state) < 0.3
        for leg in range(3):
            place = n_stations
            if leg < 2:
                place = cube if (leg == 0) != reverse else dock
            elif skip_home:
                break
            then = draw_posture(state, of_station, place, hand)
            start[n] = t
            duration[n] = _draw_duration(state, hands[now], hands[then])
            chosen[n + 1] = then
            t += duration[n] + draw_pause(state, place == n_stations)
            now = then
            n += 1
    return n


@kernel()
def draw_posture(state: State, of_station: Index, place: int, hand: int) -> int:
    """Draw one of the postures of a place and hand from ``of_station``, (n_places, 2, 2)."""
    first, count = of_station[place, hand, 0], of_station[place, hand, 1]
    return int(first + below(state, count))


@kernel()
def _draw_duration(state: State, hands_from: Vec, hands_to: Vec) -> float:
    """Draw a move's duration [s] from the farther hand's way and a random pace."""
    way = 0.0
    for hand in range(2):
        square = 0.0
        for i in range(3):
            square += (hands_to[hand, i] - hands_from[hand, i]) ** 2
        way = max(way, math.sqrt(square))
    pace = PACE_MEDIAN * math.exp(PACE_SPREAD * normal(state))
    return max(SHORTEST_MOVE, way / min(PACE_MAX, max(PACE_MIN, pace)))


@kernel()
def draw_pause(state: State, at_home: bool) -> float:
    """Draw the rest after a move [s]: short at a station, now and then long."""
    if at_home:
        return 0.3 + 2.2 * uniform(state)
    if uniform(state) < 0.12:
        return 1.5 + 2.0 * uniform(state)
    return 0.1 + 0.8 * uniform(state)
