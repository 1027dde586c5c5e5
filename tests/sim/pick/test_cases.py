"""The layout of the cell shows what the four case studies are about (docs/method.md 3.6)."""

import pytest

from app.errors import NotFound
from app.sim.cells.cell import load_cell
from app.sim.pick.cases import CASES, find_case, geometry

CELL = load_cell("pick-and-place")


def test_case_1_offers_a_nearer_goal_and_blocks_neither():
    shown = geometry(CELL, find_case("case-1"))
    assert shown.joint_distance_rad["cube4"] < shown.joint_distance_rad["cube0"]
    assert shown.blocked_s == {"cube0": None, "cube4": None}


def test_case_2_blocks_the_nearer_goal_for_good_and_leaves_the_farther_free():
    shown = geometry(CELL, find_case("case-2"))
    assert shown.joint_distance_rad["cube2"] < shown.joint_distance_rad["cube0"]
    assert shown.blocked_s["cube2"] == pytest.approx((0.0, 5.95))
    assert shown.clearance_m["cube0"] > 0.15


def test_case_3_blocks_the_nearer_goal_for_a_while():
    shown = geometry(CELL, find_case("case-3"))
    assert shown.joint_distance_rad["cube3"] < shown.joint_distance_rad["cube1"]
    first, last = shown.blocked_s["cube3"]
    assert 0.5 < first < last < 2.0


def test_case_4_blocks_the_nearer_goal_for_good_and_the_farther_for_a_moment():
    shown = geometry(CELL, find_case("case-4"))
    assert shown.joint_distance_rad["cube4"] < shown.joint_distance_rad["cube1"]
    first, last = shown.blocked_s["cube4"]
    assert 1.0 < first < last == pytest.approx(5.95)
    start, end = shown.blocked_s["cube1"]
    assert start > 0.5 and end - start < 0.2


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_every_case_starts_with_room_between_robot_and_person(case):
    assert geometry(CELL, case).start_clearance_m > 0.05


def test_an_unknown_case_names_the_known_ones():
    with pytest.raises(NotFound, match="case-1, case-2, case-3, case-4"):
        find_case("case-9")
