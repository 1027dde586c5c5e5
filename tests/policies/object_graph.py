"""Arrays, tensors, generators and numbers below an object, to compare two objects."""

import dataclasses
from collections.abc import Iterator
from typing import Any

import numpy as np
import torch

MEASURED = ("_cpu", "_untimed", "start_time", "_wall", "_window", "_custom_logger", "_logger")
"""Attributes with times and texts, which do not influence what is learned."""
SET_AGAIN = (
    *(
        "_total_timesteps",
        "_num_timesteps_at_start",
        "training",
        "locals",
        "globals",
        "n_calls",
    ),
    *("_actions", "_compiled", "_test_batch", "_played", "_saved", "_commits"),
    "_last_original_obs",
)
"""Attributes that are set at each start, in each step or for each point of the curve before
they are read, and those about files."""


def leaves(
    value: Any, path: str, seen: dict[int, Any] | None = None
) -> Iterator[tuple[str, str]]:
    """Yield path and content of every leaf, each object once."""
    seen = {} if seen is None else seen  # keeps all objects, whose ids are used again otherwise
    if isinstance(value, bool | int | float | str | np.generic):
        yield path, repr(value)
    elif value is not None and id(value) not in seen:
        seen[id(value)] = value
        text = content_of(value)
        if text is not None:
            yield path, text
        for name, item in parts_of(value).items():
            if not name.startswith((*MEASURED, *SET_AGAIN)):
                yield from leaves(item, f"{path}.{name}", seen)


def content_of(value: Any) -> str | None:
    """Return the content of an array, tensor or generator as text; None for others."""
    if isinstance(value, np.random.Generator):
        return repr(value.bit_generator.state)
    if isinstance(value, torch.Tensor):
        value = value.detach().numpy()
    if isinstance(value, np.ndarray):
        digits = hash(np.ascontiguousarray(value).tobytes())
        return f"{value.dtype} {value.shape} {digits}"
    return None


def parts_of(value: Any) -> dict[str, Any]:
    """Return the parts of an object by name."""
    if isinstance(value, np.ndarray | torch.Tensor | np.random.Generator | type):
        return {}
    if isinstance(value, torch.optim.Optimizer):  # rates follow from the step
        return {str(k): one for k, one in value.state_dict()["state"].items()}
    if isinstance(value, torch.nn.Module):
        own = {name: one for name, one in vars(value).items() if not name.startswith("_")}
        return {**value.state_dict(), **own}
    if isinstance(value, dict):
        return {name: one for name, one in value.items() if isinstance(name, str)}
    if isinstance(value, list | tuple):
        names = getattr(value, "_fields", None) or map(str, range(len(value)))
        return dict(zip(names, value, strict=True))
    if dataclasses.is_dataclass(value):
        return {one.name: getattr(value, one.name) for one in dataclasses.fields(value)}
    return dict(getattr(value, "__dict__", {}))
