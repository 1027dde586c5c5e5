"""A live pick cell beside people at rest: a planner acts, and blocked targets are left out."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.live import commands
from app.live.pick.world import LivePickWorld
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.pick.task_policy import Decision
from app.sim.robot.actions import ActionSettings
from tests.support.straight_policy import StraightPolicy


def run(world: LivePickWorld, ticks: int) -> Vec:
    """Joint positions after some periods."""
    for _ in range(ticks):
        world.step()
    return world.robot.q.copy()


class WaitingPolicy(StraightPolicy):
    """Chooses as its parent does, and never moves."""

    def decide(self, *state: Any, **terms: Any) -> Decision:
        decision = super().decide(*state, **terms)
        return replace(decision, actions=np.zeros_like(decision.actions))


@pytest.mark.parametrize("degree", [2, 3])
def test_planner_finishes_a_pick_beside_a_person_at_rest(cell: Cell, degree: int) -> None:
    policy = WaitingPolicy(cell)
    policy.action = ActionSettings(degree=degree)
    world = LivePickWorld(cell, policy, seed=3)
    world.apply(commands.SetSafety(on=False))
    world.apply(commands.SetCandidates(ids=("cube4",)))
    world.apply(commands.MovePerson(pelvis=(0.0, 1.15, -1.57), right=(-0.1, 0.7, 0.2)))
    messages = []
    while world.counters.reached == 0 and world.t < 30.0:
        world.step()
        messages.append(world.snapshot().message)
    assert (world.counters.reached, world.counters.contacts) == (1, 0)
    assert any("on a planned path: nobody has moved for 3 s" in text for text in messages)
    world.apply(commands.SetMode(mode="auto"))
    before = run(world, 20)
    assert np.array_equal(run(world, 20), before)


def test_policy_acts_in_a_cell_without_people(cell: Cell) -> None:
    world = LivePickWorld(cell, WaitingPolicy(cell), seed=3)
    world.apply(commands.RemovePerson(person=0))
    before = world.robot.q.copy()
    assert np.array_equal(run(world, 100), before)


class FirstPolicy(WaitingPolicy):
    """Chooses the first candidate."""

    def decide(self, *state: Any, **terms: Any) -> Decision:
        decision = super().decide(*state, **terms)
        return replace(decision, chosen=state[3][0].id, index=0)


def test_target_that_a_resting_person_blocks_is_left_out(cell: Cell) -> None:
    world = LivePickWorld(cell, FirstPolicy(cell), seed=3)
    world.apply(commands.SetSafety(on=False))
    world.apply(commands.SetCandidates(ids=("cube2", "cube4")))
    x, y, z = cell.station("cube2").position
    world.apply(commands.MovePerson(pelvis=(x, 1.15, -1.57), right=(x, y, z)))
    run(world, 20)
    chosen = world.snapshot().chosen
    while world.counters.reached == 0 and world.t < 30.0:
        world.step()
    assert (chosen, world.counters.reached, world.counters.contacts) == ("cube2", 1, 0)
    assert [one.id for one in world.snapshot().candidates] == ["cube2"]  # cube 4 was picked


def test_robot_waits_and_says_so_where_a_resting_person_blocks_every_target(cell: Cell) -> None:
    world = LivePickWorld(cell, WaitingPolicy(cell), seed=3)
    world.apply(commands.SetSafety(on=False))
    world.apply(commands.SetCandidates(ids=("cube2",)))
    x, y, z = cell.station("cube2").position
    world.apply(commands.MovePerson(pelvis=(x, 1.15, -1.57), right=(x, y, z)))
    before = run(world, 120)
    assert world.snapshot().message == "Waiting: a person at rest blocks Cube 2."
    assert np.array_equal(run(world, 20), before)
    world.apply(commands.MovePerson(pelvis=(0.0, 2.4, -1.57)))
    run(world, 20)
    assert world.snapshot().message.startswith("Moving to Cube 2 (Q")
