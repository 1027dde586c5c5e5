"""Rules of the values in a checkpoint's manifest, which may come from outside.

The types of required fields are checked by ``checkpoint.check_file``; the fields of the preset
by its configuration.
"""

import re
import sys
from collections.abc import Mapping, Sequence
from typing import Any, TypeGuard

from app.errors import InvalidInput, interval
from app.one_line import ONE_LINE
from app.sim.cells.parts import CELL_NAME

MAX_NAME = 64
"""Longest name of a preset [characters]."""
MAX_WIDTH = 4096
"""Most units of a layer."""
MAX_WHOLE = 2**63 - 1
"""Greatest seed and greatest number of steps and updates."""
_WHOLE = {"seed": "", "width": "units", "step": "", "updates": ""}


def check_values(manifest: Mapping[str, Any]) -> None:
    """Check the values of fields that all purposes have; their types are right.

    Raises:
        InvalidInput: A value breaks its rule.
    """
    for name, unit in _WHOLE.items():
        low, high = (1, MAX_WIDTH) if name == "width" else (0, MAX_WHOLE)
        if not low <= (value := manifest[name]) <= high:
            rule = f"must lie in {interval(low, high)} {unit}".rstrip()
            raise InvalidInput(f"manifest.{name}", value, rule)
    if not re.fullmatch(CELL_NAME, manifest["cell"]):
        rule = f"must be the name of a cell, which matches {CELL_NAME}"
        raise InvalidInput("manifest.cell", manifest["cell"], rule)
    _check_preset(manifest["preset"])
    _check_layout(manifest["layout"])
    _check_origin(manifest)


def _check_preset(preset: Mapping[str, Any]) -> None:
    if not preset:
        raise InvalidInput("manifest.preset", preset, "must hold the fields of the training")
    name = preset.get("name", "")
    if not isinstance(name, str) or len(name) > MAX_NAME or not re.fullmatch(ONE_LINE, name):
        rule = f"must be text of one line, at most {MAX_NAME} characters, none a control"
        raise InvalidInput("manifest.preset.name", name, rule)


def _check_layout(layout: Sequence[Any]) -> None:
    for k, group in enumerate(layout):
        is_pair = isinstance(group, list | tuple) and len(group) == 2
        name, size = group if is_pair else (None, None)
        if not isinstance(name, str) or not is_whole(size) or size < 1:
            rule = "must be a name and a number of values, at least 1"
            raise InvalidInput(f"manifest.layout[{k}]", group, rule)


def _check_origin(manifest: Mapping[str, Any]) -> None:
    """Check what a manifest may lack: processor time, versions, commits, recalibration."""
    cpu_s = manifest.get("cpu_s", 0.0)
    if not _is_finite(cpu_s) or cpu_s < 0.0:
        raise InvalidInput("manifest.cpu_s", cpu_s, "must be a finite number, at least 0 s")
    versions = manifest.get("versions", {})
    if not isinstance(versions, dict) or not _are_texts(versions.values()):
        rule = "must be an object of texts, the version of each package"
        raise InvalidInput("manifest.versions", versions, rule)
    commits = manifest.get("commits", [])
    if not isinstance(commits, list) or not _are_texts(commits):
        raise InvalidInput("manifest.commits", commits, "must be a list of texts")
    if "recalibration" in manifest:
        _check_recalibration(manifest["recalibration"])


def _check_recalibration(record: object) -> None:
    if not isinstance(record, dict):
        raise InvalidInput("manifest.recalibration", record, "must be an object")
    if not isinstance(record.get("from"), str):
        rule = "must be text, the id of a checkpoint"
        raise InvalidInput("manifest.recalibration.from", record.get("from"), rule)
    counts = record.get("outcomes")
    if not isinstance(counts, dict) or not all(
        is_whole(n) and 0 <= n <= MAX_WHOLE for n in counts.values()
    ):
        rule = "must be an object of whole numbers, the count of each outcome"
        raise InvalidInput("manifest.recalibration.outcomes", counts, rule)


def check_ranges(ranges: Mapping[str, Any], sizes: Mapping[str, int], purpose: str) -> None:
    """Check the groups of a training range that are there.

    Args:
        ranges: ``trained_range`` of the manifest.
        sizes: Number of values of each group of the purpose.
        purpose: Purpose of the policy.

    Raises:
        InvalidInput: A group is unknown or no range of as many values.
    """
    for name, entry in ranges.items():
        field = f"manifest.trained_range.{name}"
        if name not in sizes:
            rule = f"is not a group of the training range of a policy for {purpose}"
            raise InvalidInput(field, entry, rule, tuple(sizes))
        if not _is_range(entry, sizes[name]):
            rule = f"must hold two lists of {sizes[name]} finite numbers, low and high"
            raise InvalidInput(field, entry, rule)
        for k, (low, high) in enumerate(zip(entry["low"], entry["high"], strict=True)):
            if low > high:
                raise InvalidInput(
                    f"{field}.low[{k}]", low, f"must be at most {high}, its high"
                )


def is_whole(value: object) -> TypeGuard[int]:
    """Return whether a JSON value is a whole number; booleans are none."""
    return isinstance(value, int) and not isinstance(value, bool)


def _is_finite(value: object) -> TypeGuard[float]:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= sys.float_info.max


def _is_range(entry: object, size: int) -> bool:
    return (
        isinstance(entry, dict)
        and set(entry) == {"low", "high"}
        and all(
            isinstance(bounds, list) and len(bounds) == size and all(map(_is_finite, bounds))
            for bounds in entry.values()
        )
    )


def _are_texts(values: Any) -> bool:
    return all(isinstance(value, str) for value in values)
