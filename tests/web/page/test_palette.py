"""The page paints goals with the very colours of the scene."""

import itertools
import re
from pathlib import Path

import pytest

from app.sim.cells.colours import BLOCKS, FAILURES, VESTS
from tests.web.page.test_contrast import contrast, tokens
from web.viewer.scene.reach_scene import OVERRIDES
from web.viewer.scene.stations_view import GOALS

PALETTE = Path(__file__).parents[3] / "web" / "page" / "palette.js"
STOP = re.compile(r"\[([\d.]+), \[(\d+), (\d+), (\d+)\]\]")


def ramp(name: str) -> tuple[tuple[float, tuple[int, int, int]], ...]:
    """Return a ramp of the page by its name."""
    text = PALETTE.read_text().split(f"const {name} = [")[1].split("];")[0]
    return tuple((float(x), (int(r), int(g), int(b))) for x, r, g, b in STOP.findall(text))


def test_goals_have_one_colour_on_page_and_in_the_scene() -> None:
    text = PALETTE.read_text().split("const GOALS = [")[1].split("];")[0]
    found = re.findall(r"rgb\((\d+) (\d+) (\d+)\)", text)
    assert tuple((int(r), int(g), int(b)) for r, g, b in found) == GOALS


@pytest.mark.parametrize("panel", [tokens(scheme)["panel"] for scheme in ("light", "dark")])
def test_goals_stand_out_from_the_panel_and_from_each_other(panel: str) -> None:
    assert all(contrast(f"#{r:02x}{g:02x}{b:02x}", panel) >= 3.0 for r, g, b in GOALS)
    pairs = itertools.combinations(GOALS, 2)
    assert min(sum(abs(a - b) for a, b in zip(*pair, strict=True)) for pair in pairs) > 60


def test_page_and_scene_use_one_ramp_of_failures() -> None:
    assert ramp("FAILURES") == FAILURES


def test_blocks_have_one_colour_on_page_and_in_the_scene() -> None:
    line = next(one for one in PALETTE.read_text().splitlines() if "const BLOCKS" in one)
    found = re.findall(r"(\w+): \"rgb\((\d+) (\d+) (\d+)\)\"", line)
    assert {name: (int(r), int(g), int(b)) for name, r, g, b in found} == BLOCKS


def test_people_have_the_colours_of_their_vests() -> None:
    line = next(one for one in PALETTE.read_text().splitlines() if "const VESTS" in one)
    found = re.findall(r"rgb\((\d+) (\d+) (\d+)\)", line)
    assert tuple((int(r), int(g), int(b)) for r, g, b in found) == VESTS


def test_page_and_scene_use_one_ramp_of_overrides() -> None:
    assert ramp("OVERRIDES") == OVERRIDES
