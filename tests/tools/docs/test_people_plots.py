"""``docs/people.md`` shows what ``docs/results`` says, and its pictures are there."""

import json
from pathlib import Path

from app.sim.primitives.library_file import load_primitives
from tools.docs.people_plots import KINDS, PAGE, PICTURES, page
from tools.docs.results import RESULTS, read_result
from tools.make_primitives import N_DEMONSTRATIONS, SEED


def test_page_is_what_the_results_give() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text == page(text)


def test_every_number_of_the_section_follows_the_results(tmp_path: Path) -> None:
    found = read_result(RESULTS / "task-primitives.json")
    found["lowest_m"], found["primitives"][0]["duration_s"] = 0.077, 7.7
    (tmp_path / "task-primitives.json").write_text(json.dumps(found), encoding="utf-8")
    text = page(PAGE.read_text(encoding="utf-8"), tmp_path)
    assert "above the table [mm] | 77 |" in text and "| home – cube0 | 7.70 (" in text


def test_section_describes_the_shipped_primitives() -> None:
    found = read_result(RESULTS / "task-primitives.json")
    assert found["header"]["seed"] == SEED
    assert found["header"]["demonstrations"] == N_DEMONSTRATIONS
    legs = [(one["start"], one["end"], one["hand"]) for one in found["primitives"]]
    assert legs == [(p.segment.start, p.segment.end, p.segment.hand) for p in load_primitives()]


def test_section_shows_a_small_picture_of_every_kind_of_leg() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for name in (*KINDS, "styles"):
        assert f"](img/people/{name}.png)" in text
        assert (PICTURES / f"{name}.png").stat().st_size <= 300_000
