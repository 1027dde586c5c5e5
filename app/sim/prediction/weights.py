"""The shipped networks that say how walkers go on, from ``forecasts_data/walker.npz``."""

from functools import lru_cache
from importlib import resources
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.sim.prediction.kernels.networks import N_IN, N_TIMES, Forecaster, Network

FILE = Path(str(resources.files("app.sim.prediction"))) / "data" / "walker.npz"
KINDS = ("radius", "way")
"""What there is a network for."""


@lru_cache(maxsize=1)
def _arrays() -> dict[str, NDArray[np.float32]]:
    with np.load(FILE, allow_pickle=False) as data:
        return {name: np.ascontiguousarray(data[name], dtype=np.float32) for name in data.files}


def new_motion_predictor() -> Forecaster:
    """Return the shipped networks with work space of their own."""
    arrays = _arrays()
    networks = [
        Network(*(arrays[f"{kind}.{field}"] for field in Network._fields)) for kind in KINDS
    ]
    return forecaster_of(*networks)


def forecaster_of(radius: Network, way: Network) -> Forecaster:
    """Return networks of one width with work space.

    Args:
        radius: For the radius.
        way: For the way.
    """

    def room(n: int) -> NDArray[np.float32]:
        return np.zeros(n, dtype=np.float32)

    width = len(radius.b1)
    return Forecaster(
        radius=radius,
        way=way,
        seen=room(N_IN),
        first=room(width),
        second=room(width),
        said=room(N_TIMES),
    )


def write_networks(radius: Network, way: Network, path: Path = FILE) -> None:
    """Write networks as the shipped file."""
    arrays = {
        f"{kind}.{field}": getattr(network, field)
        for kind, network in zip(KINDS, (radius, way), strict=True)
        for field in Network._fields
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, **arrays)
