"""What ``docs/cells.md`` says about the file is so."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from app.cli.entry import main
from app.sim.cell_validation.reader import read_cell
from app.sim.cells.cell import Cell, cell_names, lacks_for_pick, load_cell

TEXT = (Path(__file__).resolve().parent.parent / "docs" / "cells.md").read_text("utf-8")


def block(kind: str) -> str:
    (found,) = re.findall(rf"```{kind}\n(.*?)```", TEXT, re.DOTALL)
    return str(found)


def fields(node: Any) -> set[str]:
    """Every field named in a JSON schema."""
    if isinstance(node, dict):
        own = node.get("properties", {})
        return set(own).union(*(fields(one) for one in node.values()))
    return set().union(*(fields(one) for one in node)) if isinstance(node, list) else set()


def test_example_is_a_cell_that_policies_can_act_in() -> None:
    assert lacks_for_pick(read_cell(block("json").encode())) is None


def test_an_environment_takes_the_cell_of_the_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my-cell.json").write_text(block("json"), "utf-8")
    names: dict[str, Any] = {}
    exec(block("python"), names)
    names["env"].reset(seed=1)
    assert names["env"].unwrapped.batch.cell.name == "workshop"


def test_faults_are_listed_as_shown(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell = json.loads(block("json"))
    cell["robot"]["tool_lenght"] = cell["robot"].pop("tool_length")
    cell["robot"]["home_q"][1] = -133
    cell["stations"][0]["position"] = [-400, 620, 120]
    cell["people"][0]["home"][1] = 2.5
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("TANDEM_DATA", str(tmp_path))
    Path("my-cell.json").write_text(json.dumps(cell), encoding="utf-8")
    assert main(["cells", "check", "my-cell.json"]) == 2
    assert sorted(capsys.readouterr().err.splitlines()) == sorted(block("text").splitlines())


def test_check_states_for_what_a_cell_qualifies(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sorting = load_cell("sorting-e0").definition()
    for station in sorting["stations"]:
        if station["kind"] == "cluster":
            station["levels"] = 3
    file = tmp_path / "low.json"
    file.write_text(json.dumps({**sorting, "name": "low"}), "utf-8")
    assert main(["cells", "check", str(file)]) == 0
    _, pick, reach, own, live = capsys.readouterr().out.splitlines()
    assert (
        pick.startswith("pick: no, it needs") and reach == "reach: no, it needs a goal_region"
    )
    assert own.startswith("sorting: no, it needs at least 10 levels for each cluster")
    assert live.removeprefix("live") == own.removeprefix("sorting")
    file.write_text(block("json"), "utf-8")
    assert main(["cells", "check", str(file), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["lacks_for_pick"] is None and found["lacks_for_live"] is None
    assert "clutter" in found["lacks_for_sorting"] and "region" in found["lacks_for_reach"]


def test_every_field_and_every_shipped_cell_is_on_the_page() -> None:
    named = set(re.findall(r"`([a-z0-9_-]+)`", TEXT))
    assert fields(Cell.model_json_schema()) <= named
    assert set(cell_names()) <= named
