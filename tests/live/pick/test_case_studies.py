"""Case studies of a live pick cell: start, end, and what a visitor does afterwards."""

import numpy as np
import pytest

from app.live.command_checks import Command
from app.live.commands import SetCandidates, SetMode, StartCase
from app.live.pick.world import LivePickWorld
from app.sim.cells.cell import Cell
from tests.live.pick.pick_scenes import until
from tests.support.straight_policy import StraightPolicy


@pytest.fixture
def world(cell: Cell) -> LivePickWorld:
    return LivePickWorld(cell, StraightPolicy(cell), seed=1)


def test_case_study_starts_at_its_station_and_ends_with_a_verdict(
    world: LivePickWorld, cell: Cell
) -> None:
    world.apply(StartCase(id="case-1"))
    start = world.snapshot()
    assert np.allclose(start.tcp, cell.station("cube5").position, atol=1e-6)
    assert {c.id for c in start.candidates} == {"cube0", "cube4"}
    assert not start.safety.on
    end = until(world, "case done")
    assert end.case == "case-1"
    assert "ended" in end.message


def test_leaving_a_case_brings_back_the_visitors_candidates(world: LivePickWorld) -> None:
    world.apply(SetCandidates(ids=("cube3", "dock0")))
    world.apply(StartCase(id="case-2"))
    world.apply(SetMode(mode="manual"))
    after = world.snapshot()
    assert after.case is None
    assert after.safety.on
    assert after.selected == ("cube3", "dock0")


def test_robot_stands_still_after_a_case_and_goes_on_from_there(world: LivePickWorld) -> None:
    world.apply(StartCase(id="case-1"))
    end = until(world, "case done")
    assert end.verdict is not None and "contact" not in end.verdict.observed
    assert not end.robot_qd.any()
    world.apply(SetCandidates(ids=("cube3",)))
    after = world.snapshot()
    assert after.status == "moving"
    assert np.array_equal(after.robot_q, end.robot_q)


@pytest.mark.parametrize("leave", [SetCandidates(ids=("cube3",)), SetMode(mode="manual")])
def test_robot_starts_again_from_home_after_a_case_that_ended_in_a_contact(
    world: LivePickWorld, cell: Cell, leave: Command
) -> None:
    world.apply(StartCase(id="case-2"))
    end = until(world, "case done")
    assert end.contact is not None and not end.robot_qd.any()
    world.apply(leave)
    after = world.snapshot()
    assert (after.status, after.contact, after.case) == ("moving", None, None)
    assert np.array_equal(after.robot_q, cell.robot.home_q)


def test_separation_distance_is_that_of_now_after_a_contact(world: LivePickWorld) -> None:
    world.apply(StartCase(id="case-2"))
    hit = until(world, "contact")
    for _ in range(100):  # shows the contact for 2 s, then the end of the case
        world.step()
        now = world.snapshot()
        assert now.clearance_m == now.people[0].clearance_m
    assert now.status == "case done"
    assert now.contact == hit.contact
