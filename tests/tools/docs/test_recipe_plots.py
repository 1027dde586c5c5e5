"""Curves of all recipes beside ours, and the points that are joined."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.policies.conftest import TINY, preset_of
from tools.docs.recipe_plots import (
    ABLATED,
    CHANGES,
    ablation,
    curves_of,
    pooled,
    recipes,
    recorded,
    updates_at,
)
from tools.docs.results import RESULTS
from tools.docs.thesis_curves import curve_of
from tools.docs.training_curves import record


def test_updates_follow_from_the_preset() -> None:
    assert updates_at("pick-td3", 25_600) == 0
    assert updates_at("pick-td3", 12_288_000) == 95_800  # as the shipped checkpoint states
    assert updates_at("pick-td3-thesis", 150_000) == 149_900


def test_points_are_joined_to_enough_episodes() -> None:
    point = {"step": 100, "cpu_s": 60.0, "updates": 1, "success": 0.5, "collision": 0.0}
    few = {**point, "episodes": 50}
    played = [{**few, "success": None}, few, few, few, {**few, "step": 200, "success": 1.0}]
    joined = pooled({"name": "pick-td3", "played": [*played, few]})
    expected = {"step": 200, "updates": 1, "cpu_min": 1.0, "success": 0.625, "collision": 0.0}
    assert joined == [expected]
    one = {"step": 12_288_000, "cpu_s": 30.0, "success": 0.5}
    assert pooled({"name": "pick-td3", "played": [one]}) == [
        {"step": 12_288_000, "updates": 95_800, "cpu_min": 0.5, "success": 0.5}
    ]


def test_picture_has_a_row_per_scenario_also_without_curves(tmp_path: Path) -> None:
    assert curves_of(tmp_path, "pick-curves", "pick-td3") == []
    without = recipes(tmp_path).axes
    assert [len(view.lines) for view in without] == [0] * 6 + [1] * 3 + [2] * 3
    played = [{"step": 1000, "cpu_s": 9.0, "updates": 5, "success": 0.5, "collision": 0.5}]
    one = {"name": "pick-td3", "seed": 1, "played": played}
    (tmp_path / "pick-curves.json").write_text(json.dumps({"curves": [one, one]}))
    assert [len(view.lines) for view in recipes(tmp_path).axes[9:]] == [6] * 3


def test_each_recipe_has_a_row_with_its_return_and_rates() -> None:
    names = ("reach-ddpg-authors", "reach-ddpg-thesis")
    axes = recorded(RESULTS, "thesis-reach", names, 0.9176).axes
    for name, left, right in zip(names, axes[::2], axes[1::2], strict=True):
        first = curves_of(RESULTS, "thesis-reach", name)[0]["played"]
        assert list(left.lines[0].get_ydata()) == [point["reward"] for point in first]
        rates = sum(line.get_ydata() for line in right.lines[:3])
        np.testing.assert_allclose(rates, 100.0)  # time-out, collision and success
        assert right.lines[-1].get_ydata()[0] == pytest.approx(91.76)


def test_folder_of_a_training_is_a_curve(tmp_path: Path) -> None:
    run = tmp_path / "run"
    preset = preset_of("pick-td3", {**TINY, "learning.total_steps": 1024})
    record(preset, 3, run, predicts=False)
    curve = curve_of(run)
    assert (curve["name"], curve["seed"]) == ("pick-td3", 3)
    assert [one["step"] for one in curve["played"]] == [256, 512, 768, 1024]
    for kind in ("json", "safetensors"):  # as the command line names the last policy
        (run / f"step-000001024.{kind}").rename(run / f"policy.{kind}")
    assert curve_of(run) == curve
    other = curve_of(run, "shorter")
    assert other.pop("name") == "pick-td3, shorter"
    assert other.pop("fields")["learning.total_steps"] == 1024
    assert other == {key: value for key, value in curve.items() if key != "name"}
    (tmp_path / "pick-curves.json").write_text(json.dumps({"curves": [curve]}))
    assert curves_of(tmp_path, "pick-curves", "pick-td3") == [curve]


def test_each_change_of_a_recipe_is_drawn_beside_it(tmp_path: Path) -> None:
    assert [len(view.lines) for view in ablation(tmp_path).axes] == [1, 1]
    stored = {
        one["name"] for one in json.loads((RESULTS / "thesis-reach.json").read_text())["curves"]
    }
    assert {f"{ABLATED}, {change}" for change in CHANGES} <= stored
    n = sum(name.startswith(ABLATED) for name in stored)
    labels = {line.get_label() for line in ablation(RESULTS).axes[0].lines}
    assert len({one for one in labels if not str(one).startswith("_")}) == n + 1  # the thesis
