"""The layout of the cell shows what the four case studies are about (docs/method.md 3.6)."""

import pytest

from app.errors import NotFound
from app.sim.cells.cell import load_cell
from app.sim.pick.case_geometry import case_geometry
from app.sim.pick.case_variants import MOMENT_S
from app.sim.pick.cases import CASES, find_case

CELL = load_cell("pick-and-place")


def test_case_1_offers_a_nearer_goal_and_blocks_neither():
    shown = case_geometry(CELL, find_case("case-1"))
    assert (shown.nearer, shown.farther) == ("cube4", "cube0")
    assert shown.blocked_s("cube0") is shown.blocked_s("cube4") is None


def test_case_2_blocks_the_nearer_goal_for_good_and_leaves_the_farther_free():
    shown = case_geometry(CELL, find_case("case-2"))
    assert (shown.nearer, shown.farther) == ("cube2", "cube0")
    assert shown.blocked_s("cube2") == (0.0, shown.person.times[-1])
    assert shown.person.goal_m["cube0"].min() > 0.15


def test_case_3_blocks_the_nearer_goal_for_a_while():
    shown = case_geometry(CELL, find_case("case-3"))
    assert (shown.nearer, shown.farther) == ("cube3", "cube1")
    first, last = shown.blocked_s("cube3")
    assert 0.5 < first < last < 2.0


def test_case_4_blocks_the_nearer_goal_for_good_and_the_farther_for_a_moment():
    shown = case_geometry(CELL, find_case("case-4"))
    assert (shown.nearer, shown.farther) == ("cube4", "cube1")
    first, last = shown.blocked_s("cube4")
    assert 1.0 < first < last == shown.person.times[-1]
    start, end = shown.blocked_s("cube1")
    assert start > 0.5 and end - start <= MOMENT_S


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_starts_have_room(case):
    shown = case_geometry(CELL, case)
    assert shown.person.start_m[case.robot_start][0] > 0.05


def test_an_unknown_case_names_the_known_ones():
    with pytest.raises(NotFound, match="case-1, case-2, case-3, case-4"):
        find_case("case-9")
