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


class Hidden(NamedTuple):
    """Work space in which a network is evaluated; for one thread."""

    first: Floats
    """First hidden layer, shape (width,)."""
    second: Floats
    """Second hidden layer, shape (width,)."""
    nonzero: NDArray[np.int64]
    """Indices of the inputs of a layer that are not zero, as long as its longest input."""


def new_hidden(net: Network) -> Hidden:
    """Return work space for a network."""
    longest = max(len(net.w1), len(net.w2), len(net.w3))
    first, second = (np.zeros(len(bias), dtype=np.float32) for bias in (net.b1, net.b2))
    return Hidden(first, second, np.zeros(longest, dtype=np.int64))


class MotionPredictor(NamedTuple):
    """Networks and work space; for one thread."""

    radius: Network
    """Predicts the change of the radius, in units of RADIUS_SCALE."""
    path: Network
    """Predicts the deviation of the mean speed from the present one, in units of
    SPEED_SCALE."""
    x: Floats
    """Input, shape (N_IN,)."""
    hidden: Hidden
    """Of either network."""
    y: Floats
    """Output, shape (N_TIMES,)."""


@kernel(fastmath=FAST)
def layer(
    x: Floats,
    w: Floats,
    b: Floats,
    rectified: bool,
    nonzero: NDArray[np.int64],
    out: Floats,
) -> None:
    """Write the output of one layer.

    Inputs that are zero are left out, the others added in their order, four at once: a sum is
    read and written once for four products. They are listed first, without branches, which a
    processor would predict badly.

    Args:
        x: Inputs, shape (n,).
        w: Weights, shape (n, width).
        b: Biases, shape (width,).
        rectified: Whether negative outputs become 0.
        nonzero: Work space, shape (>= n,).
        out: Filled, shape (width,).
    """
    width, n = out.shape[0], 0
    for j in range(width):
        out[j] = b[j]
    for i in range(x.shape[0]):
        nonzero[n] = i
        n += x[i] != 0.0
    whole = n - n % 4
    for k in range(0, whole, 4):
        i0, i1, i2, i3 = nonzero[k], nonzero[k + 1], nonzero[k + 2], nonzero[k + 3]
        x0, x1, x2, x3 = x[i0], x[i1], x[i2], x[i3]
        w0, w1, w2, w3 = w[i0], w[i1], w[i2], w[i3]
        for j in range(width):
            out[j] = out[j] + x0 * w0[j] + x1 * w1[j] + x2 * w2[j] + x3 * w3[j]
    for k in range(whole, n):
        value, row = x[nonzero[k]], w[nonzero[k]]
        for j in range(width):
            out[j] += value * row[j]
    if rectified:
        for j in range(out.shape[0]):
            out[j] = max(out[j], np.float32(0.0))


@kernel()
def evaluate(net: Network, x: Floats, hidden: Hidden, out: Floats) -> None:
    """Write the output of a network for one input.

    Args:
        x: Input, shape (n_in,).
        hidden: Work space.
        out: Filled, shape (n_out,).
    """
    first, second, nonzero = hidden
    layer(x, net.w1, net.b1, True, nonzero, first)
    layer(first, net.w2, net.b2, True, nonzero, second)
    layer(second, net.w3, net.b3, False, nonzero, out)


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
    evaluate(predictor.radius, x, predictor.hidden, y)
    for i in range(N_TIMES):
        out[i, 0] = r + RADIUS_SCALE * y[i]
    write_predictor_input(speed, 0.0, age, speeds, SPEED_MIDDLE, SPEED_SCALE, x)
    evaluate(predictor.path, x, predictor.hidden, y)
    for i in range(N_TIMES):
        out[i, 1] = max(0.0, STEP_S * (i + 1) * (speed + SPEED_SCALE * y[i]))
