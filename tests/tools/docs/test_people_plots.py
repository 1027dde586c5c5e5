"""``docs/people.md`` shows what ``docs/results`` says, and its pictures are there."""

import json
import re
from pathlib import Path
from typing import Any

from app.sim.primitives.library_file import load_primitives
from tools.docs.people_plots import KINDS, PAGE, PICTURES, page, section
from tools.docs.results import RESULTS, read_result
from tools.make_primitives import N_DEMONSTRATIONS, SEED


def test_page_is_what_the_results_give() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text == page(text)


def changed(result: Any) -> Any:
    """Return a result with other numbers."""
    if isinstance(result, dict):
        return {key: changed(value) for key, value in result.items()}
    if isinstance(result, list):
        return [changed(value) for value in result]
    if isinstance(result, bool) or not isinstance(result, int | float):
        return result
    return result + 7 if isinstance(result, int) else 1.5 * result + 0.25


def test_every_number_of_the_section_follows_the_results(tmp_path: Path) -> None:
    found = read_result(RESULTS / "task-primitives.json")
    other, number = changed(found), re.compile(r"(?<![\w.#+-])\d[\d.,]*")
    pairs = zip(*(number.findall(section(one)) for one in (found, other)), strict=True)
    counts = [str(len(found["primitives"])), str(len(found["header"]["styles"]))]
    assert [before for before, after in pairs if before == after] == [*counts, "1"]  # 1 mrad
    (tmp_path / "task-primitives.json").write_text(json.dumps(other), encoding="utf-8")
    assert section(other) in page(PAGE.read_text(encoding="utf-8"), tmp_path)


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
