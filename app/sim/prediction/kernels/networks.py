"""What a walker's radius and way will be, from how they went so far, compiled.

Radius and speed change by sums of sines (``pedestrian.py``) whose constants nobody is told, but
who has watched for a second and a half can tell how they go on. Two small networks say that:
one from the radii remembered, one from the speeds. They know nothing of where a person turns.

The networks are made by ``tools.train_motion_predictor``; ``app/sim/prediction/weights.py``
loads them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.geometry.segments import FAST
from app.sim.people.kernels.pedestrian import N_PAST

STEP_S = 0.04
"""Time between two forecasts [s]."""
N_TIMES = 32
"""Number of times ahead; the first is one step from now."""
N_IN = N_PAST + 3
"""Inputs: the value now, its rate, the age of the newest moment remembered, and all of them."""
RADIUS_MIDDLE, RADIUS_SCALE = 0.35, 0.15
"""Radii are given to the network less the one and in units of the other [m]."""
SPEED_MIDDLE, SPEED_SCALE = 0.65, 0.35
"""The same for speeds [m/s]."""
RATE_SCALE = 1.0
"""Unit of the rate of the radius [m/s]."""
AGE_SCALE = 0.1
"""Unit of the age [s]."""

Floats = NDArray[np.float32]


class Network(NamedTuple):
    """Two hidden layers of rectified units."""

    w1: Floats
    """(n_in, width)."""
    b1: Floats
    """(width,)."""
    w2: Floats
    """(width, width)."""
    b2: Floats
    """(width,)."""
    w3: Floats
    """(width, n_out)."""
    b3: Floats
    """(n_out,)."""


class Forecaster(NamedTuple):
    """Networks and work space; used by one thread at a time."""

    radius: Network
    """Says how the radius will differ from now, in units of RADIUS_SCALE."""
    way: Network
    """Says how the way will differ from that at constant speed, in units of SPEED_SCALE times
    the time ahead."""
    seen: Floats
    """Work space, shape (N_IN,)."""
    first: Floats
    """Work space, shape (width,)."""
    second: Floats
    """Work space, shape (width,)."""
    said: Floats
    """Work space, shape (N_TIMES,)."""


@kernel(fastmath=FAST)
def layer(x: Floats, w: Floats, b: Floats, rectified: bool, out: Floats) -> None:
    """Write one layer of a network.

    Args:
        x: Inputs, shape (n,).
        w: Weights, shape (n, width).
        b: Biases, shape (width,).
        rectified: Whether outputs below 0 become 0.
        out: Filled, shape (width,).
    """
    for j in range(out.shape[0]):
        out[j] = b[j]
    for i in range(x.shape[0]):
        value = x[i]
        if value != 0.0:
            for j in range(out.shape[0]):
                out[j] += value * w[i, j]
    if rectified:
        for j in range(out.shape[0]):
            out[j] = max(out[j], np.float32(0.0))


@kernel()
def _ask(net: Network, with_: Forecaster) -> None:
    """Fill ``with_.said`` from ``with_.seen``."""
    layer(with_.seen, net.w1, net.b1, True, with_.first)
    layer(with_.first, net.w2, net.b2, True, with_.second)
    layer(with_.second, net.w3, net.b3, False, with_.said)


@kernel(inline="always")
def see_past(
    now: float,
    rate: float,
    age: float,
    past: Vec,
    middle: float,
    scale: float,
    out: Floats,
) -> None:
    """Write what a network sees, shape (N_IN,)."""
    out[0], out[1], out[2] = (now - middle) / scale, rate / RATE_SCALE, age / AGE_SCALE
    for k in range(N_PAST):
        out[3 + k] = (past[k] - middle) / scale


@kernel()
def forecast(
    with_: Forecaster,
    r: float,
    growth: float,
    speed: float,
    age: float,
    radii: Vec,
    speeds: Vec,
    out: Vec,
) -> None:
    """Write how a walker goes on.

    Args:
        with_: Networks and work space.
        r: Radius now [m].
        growth: Its change [m/s].
        speed: Speed now [m/s].
        age: How long ago the newest moment remembered was [s].
        radii: Radii remembered [m], the newest first, shape (N_PAST,).
        speeds: Speeds remembered [m/s], shape (N_PAST,).
        out: Filled with radius and way at each time ahead [m], shape (N_TIMES, 2).
    """
    see_past(r, growth, age, radii, RADIUS_MIDDLE, RADIUS_SCALE, with_.seen)
    _ask(with_.radius, with_)
    for i in range(N_TIMES):
        out[i, 0] = r + RADIUS_SCALE * with_.said[i]
    see_past(speed, 0.0, age, speeds, SPEED_MIDDLE, SPEED_SCALE, with_.seen)
    _ask(with_.way, with_)
    for i in range(N_TIMES):
        out[i, 1] = max(0.0, STEP_S * (i + 1) * (speed + SPEED_SCALE * with_.said[i]))
