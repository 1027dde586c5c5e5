"""Presets: every number of an experiment, frozen and named (STYLE 3.5).

A training job names a preset, a seed and overrides. Overrides are checked here, field by field;
this module imports no learning library, so that the service can check and describe presets
cheaply. What a preset holds is said where its class is: ``pick_preset.py``,
``reach_preset.py``, ``sorting_preset.py``.
"""

import dataclasses
import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from app.errors import InvalidInput, NotFound
from app.policies.configs.fields import FieldInfo, checked, describe
from app.policies.configs.pick import PickPreset
from app.policies.configs.reach import REACH_PRESETS, ReachPreset
from app.policies.configs.sorting import SORTING_PRESETS, SortingPreset

Preset = PickPreset | ReachPreset | SortingPreset

PRESETS: Mapping[str, Preset] = MappingProxyType(
    {one.name: one for one in (PickPreset(), *REACH_PRESETS, *SORTING_PRESETS)}
)
"""Every preset by name."""


def get(name: str) -> Preset:
    """Return a preset.

    Raises:
        NotFound: No preset has that name.
    """
    if name not in PRESETS:
        raise NotFound("preset", name, tuple(PRESETS))
    return PRESETS[name]


def fields(name: str) -> list[FieldInfo]:
    """Return the fields of a preset that a job may override, in order.

    Raises:
        NotFound: No preset has that name.
    """
    preset = get(name)
    return [describe(entry, preset) for entry in dataclasses.fields(preset) if entry.metadata]


def resolve(name: str, overrides: Mapping[str, object]) -> Preset:
    """Return a preset with overrides applied.

    Args:
        name: Name of the preset.
        overrides: Field to value.

    Raises:
        NotFound: No preset has that name.
        InvalidInput: An unknown field, or a value outside its bounds.
    """
    known = {info.name: info for info in fields(name)}
    taken: dict[str, Any] = {}
    for key, value in overrides.items():
        if key == "cell":
            taken[key] = _checked_cell(value)
            continue
        if key not in known:
            raise InvalidInput(
                f"overrides.{key}", value, f"is no field of {name}", ("cell", *known)
            )
        taken[key] = checked(known[key], value)
    preset = dataclasses.replace(get(name), **taken)
    preset.check()
    return preset


def _checked_cell(value: object) -> str:
    """Return the name of a cell; whether there is one of that name is for others to say."""
    if not isinstance(value, str) or not re.fullmatch(r"[a-z][a-z0-9-]{0,63}", value):
        raise InvalidInput("overrides.cell", value, "must be the name of a work cell")
    return value
