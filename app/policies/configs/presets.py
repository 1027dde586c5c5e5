"""Presets: every number of an experiment, frozen and named.

A training job names a preset, a seed and overrides, objects of fields by group:
``{"learning": {"gamma": 0.98}}``. The fields and their bounds are declared by the models in
``pick.py``, ``reach.py`` and ``sorting.py``. No learning library is
imported here, so that the service can check and describe presets cheaply.
"""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from app.errors import InvalidInput, NotFound
from app.policies.configs.fields import read_config
from app.policies.configs.pick import PICK_PRESETS, PickPreset
from app.policies.configs.reach import REACH_PRESETS, ReachPreset
from app.policies.configs.sorting import SORTING_PRESETS, SortingPreset

Preset = PickPreset | ReachPreset | SortingPreset

PRESETS: Mapping[str, Preset] = MappingProxyType(
    {one.name: one for one in (*PICK_PRESETS, *REACH_PRESETS, *SORTING_PRESETS)}
)
"""Every preset by name."""
TITLES: Mapping[str, str] = MappingProxyType(
    {
        "pick-td3": "Pick and place (TD3)",
        "pick-reach-td3": "Pick and place without grasps (TD3)",
        "pick-td3-monitored": "Pick and place under SSM (TD3)",
        "pick-td3-thesis": "Pick and place, thesis tables 5.1 and 5.2 (TD3)",
        "reach-td3": "Reach (TD3)",
        "reach-td3-monitored": "Reach under SSM (TD3)",
        "reach-td3-people-set": "Reach beside up to four people (TD3)",
        "reach-ddpg-authors": "Reach, code of the authors (DDPG)",
        "reach-ddpg-thesis": "Reach, thesis tables 4.1 and 4.2 (DDPG)",
        "sorting-e0-dqn": "Sorting e0 with expert labels (DQN)",
        "sorting-e1-dqn": "Sorting e1 with expert labels (DQN)",
        "sorting-e1-dqn-pure": "Sorting e1 from rewards alone (DQN)",
        "sorting-e0-thesis": "Sorting e0, thesis table 3.1 (DQN)",
        "sorting-e1-thesis": "Sorting e1, thesis table 3.1 (DQN)",
        "sorting-e0-thesis-informed": "Sorting e0, thesis table 3.1, failures observed (DQN)",
    }
)
"""Title of every preset, for people."""


def get(name: str) -> Preset:
    """Return a preset.

    Raises:
        NotFound: No preset has that name.
    """
    if name not in PRESETS:
        raise NotFound("preset", name, tuple(PRESETS))
    return PRESETS[name]


def resolve(name: str, overrides: Mapping[str, object]) -> Preset:
    """Return a preset with overrides applied.

    Args:
        overrides: Fields by group, and the name of the work cell as ``cell``.

    Raises:
        NotFound: No preset has that name.
        InvalidInput: A field is unknown, breaks its rule or contradicts another one.
    """
    preset = get(name)
    data: dict[str, Any] = preset.model_dump()
    for key, value in overrides.items():
        group = data.get(key)
        if key == "name":
            raise InvalidInput("overrides.name", value, "is not a field")
        data[key] = (
            group | value if isinstance(group, dict) and isinstance(value, dict) else value
        )
    return read_config(type(preset), data, "overrides")


def nested(fields: Mapping[str, object]) -> dict[str, Any]:
    """Return overrides by group, of fields with dotted names such as ``learning.gamma``."""
    overrides: dict[str, Any] = {}
    for path, value in fields.items():
        group, dot, name = path.partition(".")
        if dot:
            overrides.setdefault(group, {})[name] = value
        else:
            overrides[group] = value
    return overrides
