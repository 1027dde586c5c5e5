"""Checkpoints from outside: one line of JSON, the manifest, followed by a safetensors file.

Nothing is unpickled or executed. ``check`` is called before anything is stored; that the
tensors fit the networks of the manifest is checked by loading the policy.
"""

import json
from collections.abc import Mapping
from typing import Any

from app.digests import digest
from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import (
    CHOOSING,
    MAX_BYTES,
    RANGE_SIZES,
    Checkpoint,
    load,
    purpose_of,
)
from app.policies.checkpoints.trained_cell import cell_of

MAX_MANIFEST = 1 << 18
"""Longest manifest [bytes]."""
MAX_FILE = MAX_MANIFEST + 1 + MAX_BYTES
"""Largest file [bytes]."""
MAX_DEPTH = 16
"""Largest depth of nested lists and objects in a manifest."""
_BYTES_PER_WEIGHT = 4


def read_upload(content: bytes) -> Checkpoint:
    """Return the checkpoint of a file.

    Args:
        content: The manifest in one line, and the bytes of the safetensors file.

    Raises:
        InvalidInput: A part is missing, too large, or not what it must be.
        CheckpointMismatch: The format is another one.
    """
    manifest, tensors = split(content, MAX_MANIFEST)
    checkpoint = load(manifest, tensors)
    if not tensors:
        raise InvalidInput("tensors", "nothing", "must follow the manifest's line")
    checkpoint.arrays()
    _check_size(checkpoint)
    return checkpoint


def require_ranges(manifest: Mapping[str, Any]) -> None:
    """Check that no group of the training range is missing.

    Inputs are not compared with a missing one. Groups of people may be missing where the
    training had no people.

    Args:
        manifest: Manifest of a checkpoint that was loaded as a policy.

    Raises:
        InvalidInput: A group is missing.
    """
    for name, size in RANGE_SIZES[purpose_of(manifest)].items():
        is_needed = not name.startswith("human") or _has_people(manifest)
        if is_needed and name not in manifest["trained_range"]:
            rule = f"must be given: low and high of {size} values in training"
            raise InvalidInput(f"manifest.trained_range.{name}", None, rule)


def _has_people(manifest: Mapping[str, Any]) -> bool:
    """Return whether there were people in the training."""
    people = manifest["preset"].get("people", {})
    if purpose_of(manifest) == CHOOSING:
        return people.get("human_absent") != 1 and bool(cell_of(manifest).workers)
    return bool(people.get("n_people") != 0)


def join(manifest: Mapping[str, Any], tensors: bytes) -> bytes:
    """Return the file of a manifest and its tensors."""
    return json.dumps(manifest, allow_nan=False).encode() + b"\n" + tensors


def split(content: bytes, max_manifest: int) -> tuple[object, bytes]:
    """Return the manifest and the tensors of a file; the tensors are not read.

    Args:
        max_manifest: Longest manifest [bytes].

    Raises:
        InvalidInput: The manifest is missing, too long, too deep, or not JSON.
    """
    line, separator, _ = content[: max_manifest + 1].partition(b"\n")
    if not separator:
        rule = f"must begin with a line of JSON, the manifest, of at most {max_manifest} bytes"
        raise InvalidInput("body", f"{len(content)} bytes", rule)
    return _manifest(line), content[len(line) + 1 :]


def _manifest(line: bytes) -> object:
    if line.count(b"[") + line.count(b"{") > MAX_DEPTH:
        steps = {ord("["): 1, ord("{"): 1, ord("]"): -1, ord("}"): -1}
        depth = most = 0
        for byte in line:
            depth += steps.get(byte, 0)
            most = max(most, depth)
        if most > MAX_DEPTH:
            rule = f"must be nested at most {MAX_DEPTH} deep"
            raise InvalidInput("manifest", f"{most} levels", rule)
    try:
        manifest = json.loads(line.decode())
        digest(manifest)
        json.dumps(manifest, ensure_ascii=False).encode()  # as the database gets it
    except (ValueError, RecursionError) as error:
        rule = "must be JSON in UTF-8, in one line, with finite numbers and whole characters"
        raise InvalidInput("manifest", str(error), rule) from None
    return manifest


def _check_size(checkpoint: Checkpoint) -> None:
    """Check that the networks of the manifest are not larger than the tensors.

    They are allocated before the tensors are loaded into them.
    """
    networks = checkpoint.manifest["preset"].get("networks")
    sizes = networks if isinstance(networks, dict) else {}
    width, layers = sizes.get("width"), sizes.get("layers", 2)
    if not isinstance(width, int) or not isinstance(layers, int):
        return  # refused with the preset's rules
    least = _BYTES_PER_WEIGHT * width**2 * max(layers - 1, 0)
    if least > len(checkpoint.tensors):
        rule = f"means at least {least} bytes of tensors; there are {len(checkpoint.tensors)}"
        raise InvalidInput("manifest.preset.networks.width", width, rule)
