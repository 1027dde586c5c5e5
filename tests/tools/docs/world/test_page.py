"""``docs/world.md`` shows what ``docs/results`` says, and its pictures are there."""

import json
import re
from pathlib import Path
from string import Formatter

import pytest

from tests.tools.docs.test_people_plots import changed
from tools.docs.results import RESULTS, read_result
from tools.docs.world.page import PAGE, PICTURES, TEMPLATE, page, values


def test_page_is_what_the_results_give() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(RESULTS)


def test_every_number_of_the_page_follows_the_results(tmp_path: Path) -> None:
    for path in RESULTS.glob("*.json"):
        (tmp_path / path.name).write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    found = [read_result(RESULTS / f"{name}.json") for name in ("world", "sim-scaling")]
    before, after = values(*found), values(*(others := [changed(one) for one in found]))
    fields = Formatter().parse(TEMPLATE.read_text(encoding="utf-8"))
    same = {
        name
        for _, name, form, _ in fields
        if name and format(before[name], form or "") == format(after[name], form or "")
    }
    assert same == {"commit", "limits_cell", "visit_cell", "reach_cell"}
    (tmp_path / "world.json").write_text(json.dumps(others[0]), encoding="utf-8")
    text = page(tmp_path)
    assert f"the difference is {after['gap_mean']:.1f} mm on average" in " ".join(text.split())
    assert f"{after['hand_late']} of these were reported later" in " ".join(text.split())


def test_page_shows_every_picture_and_no_other() -> None:
    shown = set(re.findall(r"\]\(img/world/([a-z-]+\.png)\)", page(RESULTS)))
    assert shown == {path.name for path in PICTURES.glob("*.png")}


def test_results_hold_to_what_the_page_claims() -> None:
    world = read_result(RESULTS / "world.json")
    found = values(world, read_result(RESULTS / "sim-scaling.json"))
    assert world["gap"]["all"]["min_mm"] > -1e-6
    assert found["gap_mean"] < 15.0
    assert max(found["ends"], found["distances"]) < 1e-9
    assert max(found["over"], found["excess"]) < 1e-9
    assert world["fast_hands"]["late"] == 0
    assert world["fast_hands"]["touching"] > 100
    assert found["moving"] >= found["protective"]
    assert found["moving"] > found["resting"] > 0.0


@pytest.mark.parametrize("name", ["world", "sim-steps", "sim-scaling", "mesh-gap"])
def test_results_say_where_they_were_measured(name: str) -> None:
    result = read_result(RESULTS / f"{name}.json")
    assert result["seed"] == 11
    assert {"cpu", "cores", "commit"} <= set(result["machine"])
