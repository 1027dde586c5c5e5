"""The page paints goals with the very colours of the scene."""

import re
from pathlib import Path

from web.stations_view import RAMP

PALETTE = Path(__file__).parents[3] / "web" / "static" / "palette.js"
STOP = re.compile(r"\[([\d.]+), \[(\d+), (\d+), (\d+)\]\]")


def test_page_and_scene_use_one_ramp_of_colours() -> None:
    stops = STOP.findall(PALETTE.read_text())
    page = tuple((float(x), (int(r), int(g), int(b))) for x, r, g, b in stops)
    assert page == RAMP
