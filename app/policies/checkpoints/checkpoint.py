"""Checkpoint format: tensors as safetensors, everything else as a JSON manifest.

The id of a checkpoint is the SHA-256
of its canonical manifest followed by its tensors. Both state what was learned and from what
(configuration, seed, cell, step, commits and versions), nothing that differs between equal
trainings: equal trainings give equal ids.
"""

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
from app.policies.checkpoints.manifest_rules import check_ranges, check_values, is_whole

FORMAT = "tandem-checkpoint/1"
MAX_BYTES = 16 * 1024 * 1024
"""Maximum size of the tensors of a policy [bytes], stored in one database row."""
MAX_STATE_BYTES = 256 * 1024 * 1024
"""Maximum size of the tensors of a state of a training, as well [bytes]."""
MAX_WEIGHT = float(np.finfo(np.float32).max)
"""Largest absolute value of a tensor: networks compute in single precision."""
REAL = ("F16", "F32", "F64")
"""Types of tensors, as safetensors names them."""
CHOOSING, REACHING, SORTING = "choosing tasks", "reaching goals", "sorting"
"""Purposes of policies."""
RANGE_SIZES: Mapping[str, Mapping[str, int]] = {
    CHOOSING: {"q": 6, "qd": 6, "goal": 3, "human_q": 18, "human_qd": 18},
    REACHING: {"q": 6, "qd": 6, "goal": 3, "human": 5},
    SORTING: {},
}
"""Groups of the training range of each purpose, and their numbers of values."""
_PREFIX = "Error while deserializing: "
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
class TensorFile:
    """A manifest and its tensors: the form of checkpoints and of states of trainings."""

    manifest: dict[str, Any]
    """Description of the tensors; JSON."""
    tensors: bytes
    """safetensors file."""

    @cached_property
    def sha256(self) -> str:
        """Digest of both, 64 hexadecimal digits; the id of a checkpoint."""
        return digest(self.manifest, self.tensors)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the tensors by name.

        Raises:
            InvalidInput: The bytes are no safetensors file, or hold a type that numpy lacks.
        """
        try:
            return load_tensors(self.tensors)
        except SafetensorError as error:
            rule = f"must be a safetensors file ({str(error).removeprefix(_PREFIX)})"
            raise InvalidInput("tensors", f"<{len(self.tensors)} bytes>", rule) from error
        except KeyError as error:  # bfloat16 and types of 8 bits
            kind = str(error.args[0])
            raise InvalidInput("tensors", kind, "is a type that is not read", REAL) from None


def check_file(
    manifest: object, tensors: bytes, kind: str, required: Mapping[str, type], max_bytes: int
) -> dict[str, Any]:
    """Return the manifest of untrusted data; see :func:`load` for errors.

    Args:
        manifest: JSON value.
        tensors: Content of the safetensors file.
        kind: Required value of the field ``format``.
        required: Fields every manifest has, with their JSON types.
        max_bytes: Maximum size of the tensors [bytes].
    """
    if not isinstance(manifest, dict):
        raise InvalidInput("manifest", type(manifest).__name__, "must be a JSON object")
    for name, expected in required.items():
        value = manifest.get(name)
        if not (is_whole(value) if expected is int else isinstance(value, expected)):
            raise InvalidInput(f"manifest.{name}", value, f"must be {expected.__name__}")
        if name == "format" and value != kind:
            raise CheckpointMismatch(name, kind, value)
    if len(tensors) > max_bytes:
        raise InvalidInput("tensors", len(tensors), f"must not exceed {max_bytes} bytes")
    return manifest


def tensor_bytes(arrays: Mapping[str, NDArray[Any]]) -> bytes:
    """Return named arrays as the content of a safetensors file."""
    return save_tensors({k: np.asarray(array, order="C") for k, array in arrays.items()})


@dataclass(frozen=True)
class Checkpoint(TensorFile):
    """The networks of a policy."""

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the tensors by name.

        Raises:
            InvalidInput: The bytes are no safetensors file, or contain other numbers than
                finite ones of single precision.
        """
        arrays = super().arrays()
        for name, array in arrays.items():
            if array.dtype.kind != "f":
                rule = "must be real floating-point numbers"
                raise InvalidInput(f"tensors.{name}", str(array.dtype), rule, REAL)
            largest = np.abs(array.astype(np.float64)).max(initial=0.0)
            if not np.isfinite(largest):
                raise InvalidInput(f"tensors.{name}", "non-finite", "must be finite")
            if largest > MAX_WEIGHT:
                rule = f"must be at most {MAX_WEIGHT:.4g}, the bound of single precision"
                raise InvalidInput(f"tensors.{name}", float(largest), rule)
        return arrays


def pack(manifest: dict[str, Any], arrays: Mapping[str, NDArray[Any]]) -> Checkpoint:
    """Return a checked checkpoint of a manifest and named arrays."""
    return load(manifest, tensor_bytes(arrays))


def load(manifest: object, tensors: bytes) -> Checkpoint:
    """Return a checkpoint from untrusted data.

    Raises:
        InvalidInput: A field is missing or breaks a rule, or the tensors are too large.
        CheckpointMismatch: The format is another one.
    """
    fields = check_file(manifest, tensors, FORMAT, REQUIRED, MAX_BYTES)
    if fields["kind"] != "policy":
        raise InvalidInput("manifest.kind", fields["kind"], "must be policy")
    check_values(fields)
    purpose = purpose_of(fields)
    check_ranges(fields["trained_range"], RANGE_SIZES[purpose], purpose)
    return Checkpoint(fields, bytes(tensors))


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


def require_purpose(checkpoint: Checkpoint, purpose: str) -> None:
    """Check the purpose of a checkpoint's policy.

    Raises:
        CheckpointMismatch: The purpose is another one.
    """
    if (actual := purpose_of(checkpoint.manifest)) != purpose:
        raise CheckpointMismatch("purpose", purpose, actual)
