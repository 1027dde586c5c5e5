"""Presets are checked field by field, with value, rule and choices in the message."""

import math
import subprocess
import sys

import pytest

from app.errors import InvalidInput, NotFound
from app.policies.configs import presets
from app.policies.configs.fields import bounds_of, choices_of, entries, read_config
from app.sim.robot.actions import ActionSettings


@pytest.mark.parametrize("name", presets.PRESETS)
def test_every_default_lies_inside_its_own_bounds(name):
    for entry in entries(presets.get(name)):
        bounds = bounds_of(entry.info)
        if bounds is None:
            assert entry.value in choices_of(entry.info), entry.path
        else:
            low, high = bounds
            assert low <= entry.value <= high, entry.path


@pytest.mark.parametrize("name", presets.PRESETS)
def test_a_preset_is_read_from_its_own_data(name):
    preset = presets.get(name)
    assert read_config(type(preset), preset.model_dump(), "manifest.preset") == preset


@pytest.mark.parametrize("name", ["pick-td3", "reach-td3", "sorting-e0-dqn"])
@pytest.mark.parametrize("value", [{}, [], 1, None])
def test_the_name_of_a_preset_is_text(name, value):
    preset = presets.get(name)
    with pytest.raises(InvalidInput, match=r"manifest\.preset\.name = .* must be text$"):
        read_config(type(preset), preset.model_dump() | {"name": value}, "manifest.preset")


def test_every_preset_has_its_own_title():
    assert list(presets.TITLES) == list(presets.PRESETS)
    assert len(set(presets.TITLES.values())) == len(presets.TITLES)


def test_resolving_without_overrides_gives_the_preset():
    assert presets.resolve("pick-td3", {}) == presets.get("pick-td3")


def test_an_unknown_preset_names_the_known_ones():
    with pytest.raises(NotFound, match="known: pick-td3"):
        presets.resolve("pick-td4", {})


REFUSED = [
    ("pick-td3", "colour", {"colour": 1}),
    ("pick-td3", "learning.gamma", {"learning.gamma": 2.0}),
    ("pick-td3", "learning.gamma", {"learning.gamma": math.nan}),
    ("pick-td3", "learning.gamma", {"learning.gamma": "0.9"}),
    ("pick-td3", "learning.gamma", {"learning.gamma": True}),
    ("pick-td3", "learning.n_envs", {"learning.n_envs": 16.5}),
    ("pick-td3", "learning.total_steps", {"learning.total_steps": 10_001}),
    ("pick-td3", "learning.checkpoint_steps", {"learning.checkpoint_steps": 1_280}),
    ("pick-td3", "learning.buffer_size", {"learning.buffer_size": 2_000}),
    ("pick-td3", "episode.short_limit_s", {"episode.time_limit_s": 5.0}),
    ("pick-td3", "action.degree", {"action.degree": 4}),
    ("pick-td3", "action.bounds", {"action.bounds": "none"}),
    ("pick-td3", "action.meaning", {"action.meaning": 1}),
    ("pick-td3", "action.bounds", {"action.degree": 3, "action.bounds": "one-step"}),
    ("pick-td3", "networks.actor", {"networks.actor": "plain"}),
    ("pick-td3", "action.meaning", {"action.meaning": "coefficient"}),
    ("pick-td3", "networks.width", {"networks.width": 1024, "networks.layers": 3}),
    ("pick-td3", "networks.width", {"networks.width": 512, "networks.n_critics": 10}),
    ("pick-td3", "exploration.noise", {"exploration.noise": "parameters"}),
    ("pick-td3", "exploration.greedy_share", {"exploration.greedy_share": 1.0}),
    ("pick-td3", "episode.curriculum_steps", {"episode.curriculum_steps": 1000}),
    (
        "pick-td3",
        "learning.learning_starts",
        {"learning.total_steps": 12_800, "learning.progress_steps": 12_800},
    ),
    ("reach-td3-people-set", "networks.actor", {"networks.actor": "ddpg"}),
    ("reach-td3", "networks.layers", {"networks.critic": "ddpg", "networks.layers": 1}),
    ("reach-td3", "reward.c_o", {"reward.c_o": 0.02}),
    ("reach-td3", "action.meaning", {"action.meaning": "coefficient"}),
    ("reach-td3", "exploration.greedy_share", {"exploration.greedy_share": 1.0}),
    ("sorting-e0-dqn", "networks.width", {"networks.width": 1024}),
    ("pick-td3-thesis", "exploration.option_rate", {"exploration.noise": "ar1"}),
    ("pick-td3-thesis", "learning.n_envs", {"learning.n_envs": 125, "networks.width": 1024}),
    ("pick-td3-thesis", "learning.n_envs", {"learning.n_envs": 2500, "networks.width": 128}),
    (
        "pick-td3-thesis",
        "learning.n_envs",
        {
            **{"learning.n_envs": 1900, "learning.total_steps": 3_800_000},
            **{"learning.progress_steps": 38_000, "learning.checkpoint_steps": 38_000},
            **{"learning.alpha": 0.6, "learning.buffer_size": 2_000_000},
            "networks.width": 128,
        },
    ),
]
"""Overrides that break a rule, would fail late or have no effect, and the refused field."""


@pytest.mark.parametrize(("preset", "field", "overrides"), REFUSED)
def test_a_bad_override_is_refused_by_name(preset, field, overrides):
    with pytest.raises(InvalidInput) as refused:
        presets.resolve(preset, presets.nested(overrides))
    assert refused.value.field == f"overrides.{field}"
    assert refused.value.rule


def test_noise_without_options_explores_coefficients():
    noise = {"noise": "ar1", "option_rate": 0.0}
    preset = presets.resolve("pick-td3-thesis", {"exploration": noise})
    assert (preset.action.meaning, preset.exploration.option_rate) == ("coefficient", 0.0)


def test_presets_load_no_learning_library():
    code = "import sys, app.policies.configs.presets; print('torch' in sys.modules)"
    ran = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert ran.stdout.strip() == "False"


def test_default_action_is_the_viable_speed_of_degree_two():
    assert presets.get("pick-td3").action.settings == ActionSettings()


def test_overrides_choose_the_action():
    chosen = {"action": {"bounds": "one-step"}}
    action = presets.resolve("pick-td3-thesis", chosen).action.settings
    assert action == ActionSettings(bounds="one-step", meaning="coefficient")
    assert presets.resolve("pick-td3", {"action": {"degree": 3}}).action.degree == 3
