"""Presets are checked field by field, with value, rule and choices in the message."""

import math
import subprocess
import sys

import pytest

from app.errors import InvalidInput, NotFound
from app.policies.configs import presets
from app.policies.configs.fields import entries, read_config
from app.sim.robot.actions import ActionSettings


@pytest.mark.parametrize("name", presets.PRESETS)
def test_every_default_lies_inside_its_own_bounds(name):
    for entry in entries(presets.get(name)):
        if entry.bounds is None:
            assert entry.value in entry.choices, entry.path
        else:
            low, high = entry.bounds
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


@pytest.mark.parametrize(
    ("overrides", "field"),
    [
        ({"colour": 1}, "overrides.colour"),
        ({"learning": {"gamma": 2.0}}, "overrides.learning.gamma"),
        ({"learning": {"gamma": math.nan}}, "overrides.learning.gamma"),
        ({"learning": {"gamma": "0.9"}}, "overrides.learning.gamma"),
        ({"learning": {"gamma": True}}, "overrides.learning.gamma"),
        ({"learning": {"n_envs": 16.5}}, "overrides.learning.n_envs"),
        ({"learning": {"total_steps": 10_001}}, "overrides.learning.total_steps"),
        ({"learning": {"checkpoint_steps": 1_280}}, "overrides.learning.checkpoint_steps"),
        ({"learning": {"buffer_size": 2_000}}, "overrides.learning.buffer_size"),
        ({"episode": {"time_limit_s": 5.0}}, "overrides.episode.short_limit_s"),
        ({"action": {"degree": 4}}, "overrides.action.degree"),
        ({"action": {"bounds": "none"}}, "overrides.action.bounds"),
        ({"action": {"meaning": 1}}, "overrides.action.meaning"),
        ({"action": {"degree": 3, "bounds": "one-step"}}, "overrides.action.bounds"),
        ({"networks": {"actor": "plain"}}, "overrides.networks.actor"),
        ({"action": {"meaning": "coefficient"}}, "overrides.action.meaning"),
        ({"networks": {"width": 1024, "layers": 3}}, "overrides.networks.width"),
        ({"networks": {"width": 512, "n_critics": 10}}, "overrides.networks.width"),
        ({"exploration": {"noise": "parameters"}}, "overrides.exploration.noise"),
        ({"exploration": {"greedy_share": 1.0}}, "overrides.exploration.greedy_share"),
        ({"episode": {"curriculum_steps": 1000}}, "overrides.episode.curriculum_steps"),
        (
            {"learning": {"total_steps": 12_800, "progress_steps": 12_800}},
            "overrides.learning.learning_starts",
        ),
    ],
)
def test_a_bad_override_is_refused_by_name(overrides, field):
    with pytest.raises(InvalidInput) as refused:
        presets.resolve("pick-td3", overrides)
    assert refused.value.field == field
    assert refused.value.rule


@pytest.mark.parametrize(
    ("preset", "overrides", "field"),
    [
        (
            "reach-td3-people-set",
            {"networks": {"actor": "ddpg"}},
            "overrides.networks.actor",
        ),
        (
            "reach-td3",
            {"networks": {"critic": "ddpg", "layers": 1}},
            "overrides.networks.layers",
        ),
        ("reach-td3", {"reward": {"c_o": 0.02}}, "overrides.reward.c_o"),
        ("reach-td3", {"action": {"meaning": "coefficient"}}, "overrides.action.meaning"),
        (
            "reach-td3",
            {"exploration": {"greedy_share": 1.0}},
            "overrides.exploration.greedy_share",
        ),
        ("sorting-e0-dqn", {"networks": {"width": 1024}}, "overrides.networks.width"),
        (
            "pick-td3-thesis",
            {"exploration": {"noise": "ar1"}},
            "overrides.exploration.option_rate",
        ),
        (
            "pick-td3-thesis",
            {"learning": {"n_envs": 125}, "networks": {"width": 1024}},
            "overrides.learning.n_envs",
        ),
        (
            "pick-td3-thesis",
            {"learning": {"n_envs": 2500}, "networks": {"width": 128}},
            "overrides.learning.n_envs",
        ),
        (
            "pick-td3-thesis",
            {
                "learning": {
                    **{"n_envs": 1900, "total_steps": 3_800_000, "progress_steps": 38_000},
                    **{"checkpoint_steps": 38_000, "alpha": 0.6, "buffer_size": 2_000_000},
                },
                "networks": {"width": 128},
            },
            "overrides.learning.n_envs",
        ),
    ],
)
def test_what_would_fail_late_or_have_no_effect_is_refused(preset, overrides, field):
    with pytest.raises(InvalidInput) as refused:
        presets.resolve(preset, overrides)
    assert refused.value.field == field


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
