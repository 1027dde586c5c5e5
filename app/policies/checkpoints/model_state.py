"""Tensors of networks in checkpoints, and versions of packages."""

import platform
from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import torch
from numpy.typing import NDArray

from app.state_dict import under


def weights_of(modules: Mapping[str, torch.nn.Module]) -> dict[str, NDArray[Any]]:
    """Return the tensors of networks as ``network.tensor``."""
    return {
        f"{name}.{key}": tensor.numpy()
        for name, module in modules.items()
        for key, tensor in module.state_dict().items()
    }


def tensors_under(arrays: Mapping[str, NDArray[Any]], prefix: str) -> dict[str, torch.Tensor]:
    """Return the tensors whose names start with ``prefix.``, without it."""
    return {name: torch.as_tensor(value) for name, value in under(arrays, prefix).items()}


def versions() -> dict[str, str]:
    """Return the versions that a training depends on."""
    return {
        "python": platform.python_version(),
        **{name: version(name) for name in ("torch", "stable-baselines3", "numba")},
    }
