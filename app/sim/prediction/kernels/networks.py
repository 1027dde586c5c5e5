"""Motion predictor: radius and path length of a pedestrian from its recent motion (compiled).

Two small networks predict the next 1.28 s: one the radius from the radii of the last 1.5 s, the
other the path length from the speeds. They do not predict changes of direction.

``tools/train_motion_predictor.py`` trains the networks; ``app/sim/prediction/weights.py``
loads them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.jit import FAST, kernel
from app.sim.people.kernels.pedestrian import N_PAST

STEP_S = 0.04
"""Time between two predictions [s]."""
N_TIMES = 32
"""Number of predictions; the first is one step from now."""
N_IN = N_PAST + 3
"""Inputs of a network: present value, its rate, age of the newest remembered value, and the
remembered values."""
RADIUS_MIDDLE, RADIUS_SCALE = 0.35, 0.15
"""Offset and unit of radii in the network's inputs and outputs [m]."""
SPEED_MIDDLE, SPEED_SCALE = 0.65, 0.35
"""Offset and unit of speeds [m/s]."""
RATE_SCALE = 1.0
"""Unit of the rate of the radius [m/s]."""
AGE_SCALE = 0.1
"""Unit of the age [s]."""

Floats = NDArray[np.float32]


class Network(NamedTuple):
    """Network with two hidden layers of rectified linear units."""

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


class MotionPredictor(NamedTuple):
    """Networks and work space; for one thread."""

    radius: Network
    """Predicts the change of the radius, in units of RADIUS_SCALE."""
    path: Network
    """Predicts the deviation of the mean speed from the present one, in units of
    SPEED_SCALE."""
    x: Floats
    """Input, shape (N_IN,)."""
    h1: Floats
    """First hidden layer, shape (width,)."""
    h2: Floats
    """Second hidden layer, shape (width,)."""
    y: Floats
    """Output, shape (N_TIMES,)."""


@kernel(fastmath=FAST)
def layer(x: Floats, w: Floats, b: Floats, rectified: bool, out: Floats) -> None:
    """Write the output of one layer.

    Args:
        x: Inputs, shape (n,).
        w: Weights, shape (n, width).
        b: Biases, shape (width,).
        rectified: Whether negative outputs become 0.
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
def _evaluate(net: Network, predictor: MotionPredictor) -> None:
    """Fill ``predictor.y`` from ``predictor.x``."""
    layer(predictor.x, net.w1, net.b1, True, predictor.h1)
    layer(predictor.h1, net.w2, net.b2, True, predictor.h2)
    layer(predictor.h2, net.w3, net.b3, False, predictor.y)


@kernel(inline="always")
def write_predictor_input(
    now: float,
    rate: float,
    age: float,
    past: Vec,
    middle: float,
    scale: float,
    out: Floats,
) -> None:
    """Write the input of a network, shape (N_IN,)."""
    out[0], out[1], out[2] = (now - middle) / scale, rate / RATE_SCALE, age / AGE_SCALE
    for k in range(N_PAST):
        out[3 + k] = (past[k] - middle) / scale


@kernel()
def predict_pedestrian(
    predictor: MotionPredictor,
    r: float,
    growth: float,
    speed: float,
    age: float,
    radii: Vec,
    speeds: Vec,
    out: Vec,
) -> None:
    """Predict radius and path length of a pedestrian.

    Args:
        predictor: Networks and work space.
        r: Present radius [m].
        growth: Rate of the radius [m/s].
        speed: Present speed [m/s].
        age: Age of the newest remembered value [s].
        radii: Remembered radii [m], the newest first, shape (N_PAST,).
        speeds: Remembered speeds [m/s], shape (N_PAST,).
        out: Filled with radius and path length at each time [m], shape (N_TIMES, 2).
    """
    x, y = predictor.x, predictor.y
    write_predictor_input(r, growth, age, radii, RADIUS_MIDDLE, RADIUS_SCALE, x)
    _evaluate(predictor.radius, predictor)
    for i in range(N_TIMES):
        out[i, 0] = r + RADIUS_SCALE * y[i]
    write_predictor_input(speed, 0.0, age, speeds, SPEED_MIDDLE, SPEED_SCALE, x)
    _evaluate(predictor.path, predictor)
    for i in range(N_TIMES):
        out[i, 1] = max(0.0, STEP_S * (i + 1) * (speed + SPEED_SCALE * y[i]))
