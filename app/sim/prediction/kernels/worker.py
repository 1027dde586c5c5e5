"""Motion predictor of workers: joint positions from the present posture and speed (compiled).

A small network predicts the joints at ``TIMES``; it knows no target and no past. Outside the
range of its training the joints move on at constant speed.

``tools/train_worker_predictor.py`` trains the network; ``app/sim/prediction/weights.py`` loads
it.
"""

from typing import NamedTuple

import numpy as np

from app.sim.core.arrays import Vec
from app.sim.core.jit import kernel
from app.sim.prediction.kernels.networks import Floats, Hidden, Network, evaluate

TIMES = (0.25, 0.5, 1.0)
"""Times of the predictions [s]."""
N_JOINTS = 18
"""Joints of a person."""
WIDEST = 6.0
"""Largest standardised input of the network; beyond, constant speed is predicted."""


class WorkerPredictor(NamedTuple):
    """Network and work space; for one thread."""

    network: Network
    """Predicts the change of each joint at each time [m, rad]."""
    mean: Vec
    """Mean of joints and joint speeds in training, shape (36,)."""
    scale: Vec
    """Their scales, shape (36,)."""
    x: Floats
    """Input, shape (36,)."""
    hidden: Hidden
    """Of the network."""
    y: Floats
    """Output, shape (3 * 18,)."""


@kernel(inline="always")
def standardise(predictor: WorkerPredictor, q: Vec, qd: Vec) -> bool:
    """Write the input of the network; return whether it lies in the range of the training."""
    x, mean, scale, inside = predictor.x, predictor.mean, predictor.scale, True
    for j in range(N_JOINTS):
        k = N_JOINTS + j
        x[j] = np.float32((q[j] - mean[j]) / scale[j])
        x[k] = np.float32((qd[j] - mean[k]) / scale[k])
        inside = inside and abs(x[j]) <= WIDEST and abs(x[k]) <= WIDEST
    return inside


@kernel()
def predict_worker(predictor: WorkerPredictor, q: Vec, qd: Vec, out: Vec) -> None:
    """Predict the joint positions of a worker.

    Args:
        predictor: Network and work space.
        q: Joint positions [m, rad], shape (18,).
        qd: Joint speeds [m/s, rad/s], shape (18,).
        out: Filled with the joint positions at each time, shape (3, 18).
    """
    y, inside = predictor.y, standardise(predictor, q, qd)
    if inside:
        evaluate(predictor.network, predictor.x, predictor.hidden, y)
    for i in range(len(TIMES)):
        for j in range(N_JOINTS):
            out[i, j] = q[j] + (y[N_JOINTS * i + j] if inside else TIMES[i] * qd[j])
