"""Learning curves of trainings, from folders with the points and policies of shipped ones."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from app.policies.checkpoints import pretrained
from app.policies.report.commands import training_of
from tools.docs.reach.curves import curve_of_run as reach_curve
from tools.docs.sorting.curves import curve_of_run as sorting_curve
from tools.docs.training_curves import write


@pytest.mark.parametrize(
    ("alias", "curve_of_run", "points"),
    [("sorting-e0", sorting_curve, "pairs"), ("reach", reach_curve, "targets")],
)
def test_a_curve_states_policies_and_commits_of_its_training(
    alias: str,
    curve_of_run: Callable[[Path, int | None], dict[str, Any]],
    points: str,
    tmp_path: Path,
) -> None:
    shipped = pretrained.load(alias)
    manifest = {**shipped.manifest, "commits": ["0123456789ab"]}
    name, step = manifest["preset"]["name"], manifest["step"]
    write(replace(shipped, manifest=manifest), tmp_path / f"step-{step:09d}")
    played = {"cpu_s": 2.5, "success": 0.5, "collision": 0.25, "timeout": 0.25, "reward": 1.0}
    line = {"preset": name, "seed": manifest["seed"], "step": step, **played}
    (tmp_path / "curve.jsonl").write_text(json.dumps(line) + "\n", encoding="utf-8")
    curve = curve_of_run(tmp_path, 1)
    assert (curve["name"], curve["commits"]) == (name, manifest["commits"])
    assert [one["success"] for one in curve["played"]] == [0.5]
    (point,) = curve[points]
    assert (point["step"], point["cpu_s"]) == (step, 2.5)
    assert point["success"] > 0.8  # as the shipped policies have
    said = training_of({"curves": [curve]}, name, curve.get("task", ""))
    assert "commits `0123456789ab`" in said
