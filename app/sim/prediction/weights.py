"""Networks of the shipped motion predictors, from ``data/walker.npz`` and ``worker.npz``."""

from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.prediction.kernels.networks import (
    N_IN,
    N_TIMES,
    MotionPredictor,
    Network,
    new_hidden,
)
from app.sim.prediction.kernels.worker import WorkerPredictor

FOLDER = Path(str(resources.files("app.sim.prediction"))) / "data"
FILE, WORKER_FILE = FOLDER / "walker.npz", FOLDER / "worker.npz"
KINDS = ("radius", "path")
"""Predicted quantities, one network each."""


@lru_cache(maxsize=2)
def _arrays(file: Path) -> dict[str, NDArray[np.float32]]:
    with np.load(file, allow_pickle=False) as data:
        return {name: np.ascontiguousarray(data[name], dtype=np.float32) for name in data.files}


def new_motion_predictor() -> MotionPredictor:
    """Return the shipped networks with their own work space."""
    arrays = _arrays(FILE)
    radius, path = (
        Network(*(arrays[f"{kind}.{field}"] for field in Network._fields)) for kind in KINDS
    )

    return MotionPredictor(
        radius=radius,
        path=path,
        x=np.zeros(N_IN, dtype=np.float32),
        hidden=new_hidden(radius),
        y=np.zeros(N_TIMES, dtype=np.float32),
    )


def worker_predictor(network: Network, mean: Vec, scale: Vec) -> WorkerPredictor:
    """Return a predictor of a network with its own work space.

    Args:
        mean: Mean of its inputs, shape (36,).
        scale: Their scales, shape (36,).
    """
    x, y = (np.zeros(size, dtype=np.float32) for size in (len(network.w1), len(network.b3)))
    return WorkerPredictor(network, mean, scale, x, new_hidden(network), y)


def new_worker_predictor() -> WorkerPredictor:
    """Return the shipped network with its own work space."""
    arrays = _arrays(WORKER_FILE)
    network = Network(*(arrays[field] for field in Network._fields))
    mean, scale = (arrays[name].astype(np.float64) for name in ("mean", "scale"))
    return worker_predictor(network, mean, scale)
