"""Tensors of networks and optimisers in checkpoints, and versions of packages."""

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


def moments_of(optimizers: Mapping[str, torch.optim.Optimizer]) -> dict[str, NDArray[Any]]:
    """Return the moments of optimisers as ``optimizer.index.moment``."""
    return {
        f"{name}.{index}.{key}": tensor.numpy()
        for name, optimizer in optimizers.items()
        for index, moments in optimizer.state_dict()["state"].items()
        for key, tensor in moments.items()
    }


def restore(
    arrays: Mapping[str, NDArray[Any]],
    modules: Mapping[str, torch.nn.Module],
    optimizers: Mapping[str, torch.optim.Optimizer],
) -> None:
    """Load tensors and moments of a checkpoint into networks and optimisers."""
    for name, module in modules.items():
        module.load_state_dict(tensors_under(arrays, name))
    for name, optimizer in optimizers.items():
        state: dict[int, dict[str, torch.Tensor]] = {}
        for key, tensor in tensors_under(arrays, name).items():
            index, moment = key.split(".", 1)
            state.setdefault(int(index), {})[moment] = tensor.clone()
        optimizer.load_state_dict({**optimizer.state_dict(), "state": state})


def tensors_under(arrays: Mapping[str, NDArray[Any]], prefix: str) -> dict[str, torch.Tensor]:
    """Return the tensors whose names start with ``prefix.``, without it."""
    return {name: torch.as_tensor(value) for name, value in under(arrays, prefix).items()}


def versions() -> dict[str, str]:
    """Return the versions that a training depends on."""
    return {
        "python": platform.python_version(),
        **{name: version(name) for name in ("torch", "stable-baselines3", "numba")},
    }
