"""Live sorting cells whose motion is interrupted: time limits, people, changes of the task."""

from dataclasses import replace
from typing import Any

import numpy as np

from app.live import commands
from app.live.sorting.commands import RemoveBlock, SetGoal
from app.sim.cells.cell import load_cell
from app.sim.pick.task_policy import Decision
from tests.sim.sorting.sorting_scenes import empty_world, lay, until
from tests.support.straight_policy import StraightPolicy


class WaitingPolicy(StraightPolicy):
    """Chooses the last candidate and does not move."""

    def decide(self, *state: Any, **terms: Any) -> Decision:
        found = super().decide(*state, **terms)
        last = state[3][-1].id
        index, still = len(found.values) - 1, np.zeros_like(found.actions)
        return replace(found, chosen=last, index=index, actions=still)


def test_block_that_was_not_reached_is_offered_again_after_the_others() -> None:
    world = empty_world(WaitingPolicy(load_cell("sorting-e0")))
    world.apply(commands.RemovePerson(person=0))  # beside people at rest a planner acts
    ids = lay(world, {"slot5": "red-large", "slot9": "red-large"}, {"red": ("large",)})
    assert world.snapshot().chosen == ids["slot9"]
    first = until(world, lambda now: now.counters.timeouts == 1)
    assert first.sorting.duplicates == (ids["slot5"],)
    second = until(world, lambda now: now.counters.timeouts == 2)
    assert set(second.sorting.duplicates) == set(ids.values())


def test_commands_change_the_move_while_a_person_blocks_the_robot() -> None:
    world = empty_world()
    world.apply(commands.PauseClock())
    x, y, z = world.snapshot().tcp
    world.apply(commands.MovePerson(pelvis=(x, 1.15, -1.57), right=(x, y, z)))
    for _ in range(100):
        world.step()
    world.apply(commands.ResumeClock())
    world.apply(commands.Reset())
    before = world.snapshot()
    assert (before.status, before.chosen) == ("blocked", before.sorting.move.block)
    world.apply(RemoveBlock(id=before.sorting.move.block))
    assert world.snapshot().sorting.move.block != before.sorting.move.block
    world.apply(SetGoal(towers={}))
    world.step()
    after = world.snapshot()
    assert after.status == "blocked"
    assert (after.sorting.move, after.chosen, after.candidates) == (None, None, ())


def test_move_names_no_block_that_was_removed() -> None:
    world = empty_world()
    ids = lay(world, {"slot5": "red-large"}, {"red": ("large",)})
    until(world, lambda now: any(one.held for one in now.sorting.blocks))
    assert world.snapshot().sorting.move.block == ids["slot5"]
    world.apply(RemoveBlock(id=ids["slot5"]))
    after = world.snapshot()
    assert after.status == "picking"
    assert (after.sorting.move.block, after.sorting.duplicates) == (None, ())


def test_tool_that_moves_up_again_says_why() -> None:
    world = empty_world()
    lay(world, {"slot5": "red-large"}, {"red": ("large",)})
    going_down = until(world, lambda now: now.status == "picking")
    world.apply(SetGoal(towers={}))
    world.step()
    after = world.snapshot()
    assert (going_down.sorting.phase, after.status) == ("grasp", "picking")
    assert after.message == "Moving up again: blocks, goal or policy have changed."


def test_time_limit_with_a_held_block_names_its_place() -> None:
    world = empty_world()
    world.apply(commands.RemovePerson(person=0))
    lay(world, {"slot5": "blue-large"}, {"blue": ("large",)})
    until(world, lambda now: now.sorting.phase == "carry")
    waiting = commands.SetPolicy(checkpoint="waiting").with_loaded(WaitingPolicy(world.cell))
    world.apply(waiting)
    late = until(world, lambda now: now.counters.timeouts == 1)
    assert (
        late.message
        == "Timed out carrying the large blue block to the blue tower: trying again."
    )
