"""Walks of one pedestrian without a robot, for plots and tests."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.core.kernels.rng import State, start_stream
from app.sim.people.kernels.pedestrian import (
    GAIT,
    N_STATE,
    TARGET_X,
    TARGET_Y,
    TIME,
    VX,
    VY,
    PedestrianRules,
    PedestrianState,
    R,
    X,
    Y,
    advance_pedestrian,
    start_pedestrian,
)
from app.sim.people.pedestrian import PedestrianSettings, pedestrian_rules, pedestrian_state


@dataclass(frozen=True, slots=True, kw_only=True)
class Walk:
    """Motion of one pedestrian, sampled at n control periods."""

    time: Vec
    """Time since the start [s], shape (n + 1,)."""
    position: Vec
    """Axis x, y [m], shape (n + 1, 2)."""
    velocity: Vec
    """Velocity in the period to come [m/s], shape (n + 1, 2)."""
    radius: Vec
    """Radius [m], shape (n + 1,); linear between."""
    target: Vec
    """Target [m], shape (n + 1, 2)."""
    gait: NDArray[np.int64]
    """WALKING, STAYING or STILL, shape (n + 1,)."""


def walk(
    walker: PedestrianSettings,
    seed: int,
    seconds: float,
    dt: float = 0.02,
    *,
    env: int = 0,
    episode: int = 0,
) -> Walk:
    """Simulate one pedestrian without a robot or a constraint on its start.

    Args:
        seed: Seed of the batch.
        seconds: Duration [s], rounded to whole periods.
        dt: Control period [s].
        env: Index of the environment.
        episode: Index of the episode.

    Raises:
        InvalidInput: ``dt`` is not positive, or ``seconds`` is negative.
    """
    if not (math.isfinite(dt) and dt > 0.0):
        raise InvalidInput("dt", dt, "must be positive")
    if not (math.isfinite(seconds) and seconds >= 0.0):
        raise InvalidInput("seconds", seconds, "must not be negative")
    stream = np.zeros(1, dtype=np.uint64)
    start_stream(seed, env, episode, stream)
    rows = np.empty((round(seconds / dt) + 1, N_STATE))
    _record(pedestrian_rules([walker]), pedestrian_state(1, 1), stream, dt, rows)
    return Walk(
        time=rows[:, TIME],
        position=rows[:, X : Y + 1],
        velocity=rows[:, VX : VY + 1],
        radius=rows[:, R],
        target=rows[:, TARGET_X : TARGET_Y + 1],
        gait=rows[:, GAIT].astype(np.int64),
    )


def _record(
    rules: PedestrianRules, state: PedestrianState, stream: State, dt: float, out: Vec
) -> None:
    """Write the state after each period, shape (n + 1, N_STATE)."""
    start_pedestrian(rules, state, 0, 0, stream)
    out[0] = state.rows[0, 0]
    for row in out[1:]:
        advance_pedestrian(rules, state, 0, 0, dt)
        row[:] = state.rows[0, 0]
