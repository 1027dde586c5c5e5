"""The layout of the cell shows what the four case studies are about (docs/method.md 3.6)."""

from dataclasses import dataclass

import numpy as np
import pytest

from app.errors import NotFound
from app.sim.cells.cell import Cell, load_cell
from app.sim.people.kernels.people import people_clearance
from app.sim.pick.cases import CASES, Case, find_case, script_of
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.robot.kernels import kinematics
from app.sim.scene.scene import NO_CYLINDERS, arm_of, people_geometry_of, people_of

CELL = load_cell("pick-and-place")
BLOCKED_BELOW = 0.0
"""Clearance below which a goal configuration is blocked [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseGeometry:
    """Geometry of a case study in a cell, by goal."""

    joint_distance_rad: dict[str, float]
    """Largest joint difference from the start to each goal configuration [rad]."""
    distance_m: dict[str, float]
    """Distance from the start to each goal [m]."""
    blocked_s: dict[str, tuple[float, float] | None]
    """First and last time at which each goal configuration is blocked [s]; None for never."""
    clearance_m: dict[str, float]
    """Least clearance of each goal configuration over the first 6 s [m]."""
    start_clearance_m: float
    """Clearance of the start configuration at t = 0 [m]."""


def geometry(cell: Cell, case: Case) -> CaseGeometry:
    """Measure a case study in a cell."""
    arm = arm_of(cell)
    names = (case.robot_start, *case.goals)
    positions = np.array([cell.station(name).position for name in names])
    configurations, _ = kinematics.ik_vertical_batch(arm.lengths, arm.limits, positions)
    script = script_of(cell, case)
    times = np.arange(0.0, 6.0, 0.05)
    pose, people = arm_kernel.new_robot_pose(arm), people_of(cell)
    clearance = np.empty((3, len(times)))
    for k, t in enumerate(times):
        human_q, _ = script.at(float(t))
        crowd = people_geometry_of(people, human_q[None], NO_CYLINDERS)
        for i, configuration in enumerate(configurations):
            arm_kernel.place_robot(arm, configuration, pose)
            clearance[i, k] = people_clearance(people, pose.columns, crowd)
    blocked = {}
    for i, name in enumerate(case.goals, start=1):
        when = times[clearance[i] < BLOCKED_BELOW]
        blocked[name] = (float(when[0]), float(when[-1])) if when.size else None
    goals = list(enumerate(case.goals, start=1))
    return CaseGeometry(
        joint_distance_rad={
            n: float(np.abs(configurations[i] - configurations[0]).max()) for i, n in goals
        },
        distance_m={n: float(np.linalg.norm(positions[i] - positions[0])) for i, n in goals},
        blocked_s=blocked,
        clearance_m={n: float(clearance[i].min()) for i, n in goals},
        start_clearance_m=float(clearance[0, 0]),
    )


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
