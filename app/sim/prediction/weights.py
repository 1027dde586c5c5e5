"""Networks of the shipped motion predictor, from ``data/walker.npz``."""

from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.sim.prediction.kernels.networks import N_IN, N_TIMES, MotionPredictor, Network

FILE = Path(str(resources.files("app.sim.prediction"))) / "data" / "walker.npz"
KINDS = ("radius", "path")
"""Predicted quantities, one network each."""


@lru_cache(maxsize=1)
def _arrays() -> dict[str, NDArray[np.float32]]:
    with np.load(FILE, allow_pickle=False) as data:
        return {name: np.ascontiguousarray(data[name], dtype=np.float32) for name in data.files}


def new_motion_predictor() -> MotionPredictor:
    """Return the shipped networks with their own work space."""
    arrays = _arrays()
    radius, path = (
        Network(*(arrays[f"{kind}.{field}"] for field in Network._fields)) for kind in KINDS
    )

    def floats(n: int) -> NDArray[np.float32]:
        return np.zeros(n, dtype=np.float32)

    width = len(radius.b1)
    return MotionPredictor(
        radius=radius,
        path=path,
        x=floats(N_IN),
        h1=floats(width),
        h2=floats(width),
        y=floats(N_TIMES),
    )


def write_networks(radius: Network, path: Network, file: Path = FILE) -> None:
    """Write networks as the shipped file."""
    arrays = {
        f"{kind}.{field}": getattr(network, field)
        for kind, network in zip(KINDS, (radius, path), strict=True)
        for field in Network._fields
    }
    file.parent.mkdir(parents=True, exist_ok=True)
    np.savez(file, **arrays)
