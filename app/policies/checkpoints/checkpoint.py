"""Checkpoint format: tensors as safetensors, everything else as a JSON manifest.

Loading never executes code, because nothing is unpickled. The id of a checkpoint is the SHA-256
of its canonical manifest followed by its tensors. Both state what was learned and from what
(configuration, seed, cell, step, commits and versions), nothing that differs between equal
trainings: equal trainings give equal ids.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load as load_tensors
from safetensors.numpy import save as save_tensors

from app.digests import digest
from app.errors import CheckpointMismatch, InvalidInput

FORMAT = "tandem-checkpoint/1"
MAX_BYTES = 16 * 1024 * 1024
"""Maximum size of the tensors of a policy [bytes], stored in one database row."""
CHOOSING, REACHING, SORTING = "choosing tasks", "reaching goals", "sorting"
"""Purposes of policies."""
REQUIRED = {
    "format": str,
    "kind": str,
    "preset": dict,
    "seed": int,
    "cell": str,
    "layout": list,
    "act_size": int,
    "width": int,
    "step": int,
    "updates": int,
    "trained_range": dict,
}
"""Fields every manifest has, with their JSON types."""


@dataclass(frozen=True)
class Checkpoint:
    """A manifest and its tensors."""

    manifest: dict[str, Any]
    """Description of the tensors; JSON."""
    tensors: bytes
    """safetensors file."""

    @cached_property
    def sha256(self) -> str:
        """Id of the checkpoint, 64 hexadecimal digits."""
        return digest(self.manifest, self.tensors)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the tensors by name.

        Raises:
            InvalidInput: The bytes are no safetensors file, or contain non-finite numbers.
        """
        try:
            arrays = load_tensors(self.tensors)
        except SafetensorError as error:
            raise InvalidInput("tensors", str(error), "must be a safetensors file") from error
        for name, array in arrays.items():
            if not np.isfinite(array).all():
                raise InvalidInput(f"tensors.{name}", "non-finite", "must be finite")
        return arrays


def pack(manifest: dict[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Checkpoint:
    """Return a checked checkpoint of a manifest and named arrays."""
    contiguous = {name: np.ascontiguousarray(array) for name, array in arrays.items()}
    return load(manifest, save_tensors(contiguous))


def load(manifest: object, tensors: bytes) -> Checkpoint:
    """Return a checkpoint from untrusted data.

    Raises:
        InvalidInput: A field is missing, of a wrong type, or the tensors are too large.
        CheckpointMismatch: The format is another one.
    """
    if not isinstance(manifest, dict):
        raise InvalidInput("manifest", type(manifest).__name__, "must be a JSON object")
    for name, kind in REQUIRED.items():
        if not isinstance(manifest.get(name), kind):
            raise InvalidInput(
                f"manifest.{name}", manifest.get(name), f"must be {kind.__name__}"
            )
    if manifest["format"] != FORMAT:
        raise CheckpointMismatch("format", FORMAT, manifest["format"])
    if manifest["kind"] != "policy":
        raise InvalidInput("manifest.kind", manifest["kind"], "must be policy")
    if not 1 <= manifest["width"] <= 4096:
        raise InvalidInput("manifest.width", manifest["width"], "must lie in [1, 4096] units")
    _check_ranges(manifest["trained_range"])
    if len(tensors) > MAX_BYTES:
        raise InvalidInput("tensors", len(tensors), f"must not exceed {MAX_BYTES} bytes")
    return Checkpoint(manifest, bytes(tensors))


def _check_ranges(ranges: dict[str, Any]) -> None:
    for name, entry in ranges.items():
        fine = (
            isinstance(entry, dict)
            and set(entry) == {"low", "high"}
            and isinstance(entry["low"], list)
            and isinstance(entry["high"], list)
            and len(entry["low"]) == len(entry["high"])
            and all(
                isinstance(value, int | float) and math.isfinite(value)
                for value in entry["low"] + entry["high"]
            )
        )
        if not fine:
            raise InvalidInput(
                f"manifest.trained_range.{name}",
                entry,
                "must hold two lists of finite numbers, low and high",
            )


def expect_layout(checkpoint: Checkpoint, layout: list[list[Any]], act_size: int) -> None:
    """Check that a checkpoint's networks fit the layout of observations and actions.

    Raises:
        CheckpointMismatch: The networks have another layout.
    """
    if checkpoint.manifest["layout"] != layout:
        raise CheckpointMismatch("layout", layout, checkpoint.manifest["layout"])
    if checkpoint.manifest["act_size"] != act_size:
        raise CheckpointMismatch("act_size", act_size, checkpoint.manifest["act_size"])


def purpose_of(manifest: Mapping[str, Any]) -> str:
    """Return the purpose of a policy from its observation layout.

    Towers are observed by sorting policies, cylinders of people by reach policies.
    """
    layout = manifest.get("layout")
    entries = layout if isinstance(layout, list) else []
    groups = [entry[0] for entry in entries if isinstance(entry, list) and entry]
    if "towers" in groups:
        return SORTING
    return REACHING if "human" in groups else CHOOSING


def task_of(checkpoint: Checkpoint) -> str:
    """Return the purpose of a checkpoint's policy."""
    return purpose_of(checkpoint.manifest)


def require_purpose(checkpoint: Checkpoint, purpose: str) -> None:
    """Check the purpose of a checkpoint's policy.

    Raises:
        CheckpointMismatch: The purpose is another one.
    """
    if (actual := purpose_of(checkpoint.manifest)) != purpose:
        raise CheckpointMismatch("purpose", purpose, actual)
