"""Variants of the case studies agree with their descriptions, and their set is fixed."""

import hashlib
from dataclasses import replace

import pytest

from app.sim.cells.cell import load_cell
from app.sim.pick.case_geometry import case_geometry
from app.sim.pick.case_variants import (
    DESCRIPTIONS,
    agrees,
    other_goal_free_at_end,
    variants_of,
)
from app.sim.pick.cases import CASES, find_case

CELL = load_cell("pick-and-place")
COUNTS = {"case-1": 339, "case-2": 115, "case-3": 187, "case-4": 251}
"""Variants of each case."""
SHA256 = "65c94cc7ba22cd829f9a7eb009444f7326544074d0130e6489d3e82affef577f"
"""Hash of their names, one a line, in order."""


def test_the_set_of_variants_is_the_one_fixed_before_a_policy_was_evaluated():
    found = {case.id: variants_of(CELL, case) for case in CASES}
    assert {name: len(ones) for name, ones in found.items()} == COUNTS
    names = "\n".join(one.id for ones in found.values() for one in ones)
    assert hashlib.sha256(names.encode()).hexdigest() == SHA256


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_a_case_agrees_with_its_own_description_and_is_no_variant(case):
    shown = case_geometry(CELL, case)
    assert agrees(case.id, shown)
    to_nearer = DESCRIPTIONS[case.id].to_nearer
    assert case.expected == (shown.nearer if to_nearer else shown.farther)
    assert case.first in (None, shown.nearer)
    layouts = [layout(one) for one in variants_of(CELL, case)]
    assert len(set(layouts)) == len(layouts) and layout(case) not in layouts


def layout(case):
    return case.robot_start, case.goals, case.hand, case.human_from, case.human_to


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_a_variant_keeps_what_its_case_expects(case):
    for one in variants_of(CELL, case)[::40]:
        shown = case_geometry(CELL, one)
        assert agrees(case.id, shown)
        assert one.first == (case.first and shown.nearer)
        assert (one.expected == shown.nearer) == (case.expected == nearer_of(case))
        kept = ("switches", "palm_offset", "delay_s")
        assert all(getattr(one, name) == getattr(case, name) for name in kept)


def nearer_of(case):
    return case_geometry(CELL, case).nearer


@pytest.mark.parametrize(
    ("case", "change"),
    [
        ("case-1", {"human_from": "cube0"}),  # beside the farther goal
        ("case-1", {"palm_offset": (0.0, 0.0, 0.0)}),  # on the nearer goal
        ("case-2", {"human_from": "cube0"}),  # on the farther goal
        ("case-2", {"robot_start": "cube1"}),  # both goals as near
        ("case-3", {"human_from": "dock1", "human_to": "cube3"}),  # stays on the nearer goal
        ("case-3", {"human_to": "cube5"}),  # moves away from it
        ("case-4", {"human_to": "cube1"}),  # never over the nearer goal
        ("case-4", {"delay_s": 2.0}),  # too late
        ("case-4", {"robot_start": "cube0"}),  # the robot starts under the hand
    ],
)
def test_other_layouts_do_not_agree(case, change):
    changed = replace(find_case(case), **change)
    assert not agrees(case, case_geometry(CELL, changed))


def test_case_3_leaves_the_robot_no_other_goal_at_the_end():
    case = find_case("case-3")
    assert not other_goal_free_at_end(CELL, case)
    free = {other_goal_free_at_end(CELL, one) for one in variants_of(CELL, case)[::10]}
    assert free == {True, False}
