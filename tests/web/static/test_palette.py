"""The page paints goals with the very colours of the scene."""

import re
from pathlib import Path

from web.mannequin import VESTS
from web.stations_view import RAMP

PALETTE = Path(__file__).parents[3] / "web" / "static" / "palette.js"
STOP = re.compile(r"\[([\d.]+), \[(\d+), (\d+), (\d+)\]\]")


def test_page_and_scene_use_one_ramp_of_colours() -> None:
    stops = STOP.findall(PALETTE.read_text())
    page = tuple((float(x), (int(r), int(g), int(b))) for x, r, g, b in stops)
    assert page == RAMP


def test_people_have_the_colours_of_their_vests() -> None:
    line = next(one for one in PALETTE.read_text().splitlines() if "const VESTS" in one)
    found = re.findall(r"rgb\((\d+) (\d+) (\d+)\)", line)
    assert tuple((int(r), int(g), int(b)) for r, g, b in found) == VESTS
