"""The documented frame is the robot's: ``base_link``, table, floor and the person's side."""

from pathlib import Path

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.robot.ur10 import Robot
from tools.docs.frame_plot import IMAGE, frame

ROOT = Path(__file__).resolve().parents[3]
CELL = load_cell("pick-and-place")
A2, A3, D1, D4, D5, D6 = -0.612, -0.5723, 0.1273, 0.163941, 0.1157, 0.0922
"""DH parameters of the UR10 as its controller has them, in the frame ``base`` [m]."""


def test_the_frame_is_base_link_and_the_controllers_base_is_turned_by_half_a_turn() -> None:
    """By hand, all joints at 0: the flange is at (a2 + a3, -d4 - d6, d1 - d5) in ``base``."""
    in_base = np.array([A2 + A3, -D4 - D6, D1 - D5])
    flange = Robot(0.12).tcp_pose(np.zeros(6))
    here = flange[:3, 3] - 0.12 * flange[:3, 2]
    np.testing.assert_allclose(here, in_base * [-1.0, -1.0, 1.0], atol=1e-4)


def test_the_picture_shows_both_views_with_floor_table_and_frame() -> None:
    above, side = frame(CELL).axes
    texts = [text.get_text() for view in (above, side) for text in view.texts]
    assert {"base_link", "x of base", "y of base", "floor, z = -0.75 m"} <= set(texts)
    ends = [round(float(y), 6) for line in side.lines for y in line.get_ydata()]
    assert CELL.floor_z in ends
    assert above.get_xlabel() == "x [m]" and side.get_ylabel() == "z [m]"


def test_the_page_shows_the_picture_and_the_heights() -> None:
    page = (ROOT / "docs/http.md").read_text("utf-8")
    assert IMAGE.is_file() and f"({IMAGE.relative_to(ROOT / 'docs')})" in page
    for name in ("pick-and-place", "shared-workspace"):
        assert f"{load_cell(name).table.height:.2f} m" in page
