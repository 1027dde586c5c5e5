"""Presets are checked field by field, with value, rule and choices in the message."""

import math
import subprocess
import sys

import pytest

from app.errors import InvalidInput, NotFound
from app.policies.configs import presets
from app.sim.robot.actions import ActionSettings


@pytest.mark.parametrize("name", presets.PRESETS)
def test_every_default_lies_inside_its_own_bounds(name):
    for info in presets.fields(name):
        if info.type == "choice":
            assert info.default in info.choices, info.name
        else:
            assert info.minimum <= info.default <= info.maximum, info.name


def test_resolving_without_overrides_gives_the_preset():
    assert presets.resolve("pick-td3", {}) == presets.get("pick-td3")


def test_an_unknown_preset_names_the_known_ones():
    with pytest.raises(NotFound, match="known: pick-td3"):
        presets.resolve("pick-td4", {})


@pytest.mark.parametrize(
    ("overrides", "field"),
    [
        ({"colour": 1}, "overrides.colour"),
        ({"gamma": 2.0}, "overrides.gamma"),
        ({"gamma": math.nan}, "overrides.gamma"),
        ({"gamma": "0.9"}, "overrides.gamma"),
        ({"gamma": True}, "overrides.gamma"),
        ({"n_envs": 16.5}, "overrides.n_envs"),
        ({"total_steps": 10_001}, "overrides.total_steps"),
        ({"checkpoint_steps": 1_280}, "overrides.checkpoint_steps"),
        ({"buffer_size": 2_000}, "overrides.buffer_size"),
        ({"time_limit_s": 5.0}, "overrides.short_limit_s"),
        ({"action_degree": 4}, "overrides.action_degree"),
        ({"action_bounds": "none"}, "overrides.action_bounds"),
        ({"action_meaning": 1}, "overrides.action_meaning"),
        ({"action_degree": 3, "action_bounds": "one-step"}, "overrides.action_bounds"),
        ({"total_steps": 12_800, "progress_steps": 12_800}, "overrides.learning_starts"),
    ],
)
def test_a_bad_override_is_refused_by_name(overrides, field):
    with pytest.raises(InvalidInput) as refused:
        presets.resolve("pick-td3", overrides)
    assert refused.value.field == field
    assert refused.value.rule


def test_presets_load_no_learning_library():
    code = "import sys, app.policies.configs.presets; print('torch' in sys.modules)"
    ran = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert ran.stdout.strip() == "False"


def test_default_action_is_the_viable_speed_of_degree_two():
    assert presets.get("pick-td3").action == ActionSettings()


def test_overrides_choose_the_action():
    chosen = {"action_bounds": "one-step", "action_meaning": "coefficient"}
    action = presets.resolve("pick-td3", chosen).action
    assert action == ActionSettings(bounds="one-step", meaning="coefficient")
    assert presets.resolve("pick-td3", {"action_degree": 3}).action.degree == 3
