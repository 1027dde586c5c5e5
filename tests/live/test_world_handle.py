from dataclasses import replace

import pytest

from app.errors import Conflict, InvalidInput
from app.live.command_checks import Command
from app.live.commands import AddPerson, PauseClock, Reset, SetPolicy
from app.live.factory import new_world
from app.live.reach.commands import SetInferenceMode
from app.live.sorting.commands import AddBlock, MoveBlock, RemoveBlock, StartTest
from app.live.world_handle import WorldHandle
from app.sim.cells.cell import load_cell
from tests.support.straight_policy import StraightPolicy


@pytest.fixture
def handle() -> WorldHandle:
    cell = load_cell("sorting-e0")
    return WorldHandle("main", cell, new_world(cell, None, 1).snapshot())


def test_command_that_does_not_fit_the_table_is_refused_at_once(handle: WorldHandle) -> None:
    with pytest.raises(InvalidInput, match="is not a block"):
        handle.submit(RemoveBlock(id="block99"))
    assert handle.drain() == []


def test_command_about_a_block_that_still_waits_is_left_to_the_world(
    handle: WorldHandle,
) -> None:
    handle.submit(AddBlock(colour="red", size="small"))
    handle.submit(MoveBlock(id="block7", to="red"))
    assert [one.tag for one in handle.drain()] == ["add-block", "move-block"]


def test_table_counts_again_once_a_snapshot_shows_what_was_done(handle: WorldHandle) -> None:
    handle.submit(AddBlock(colour="red", size="small"))
    handle.drain()
    last = handle.submit(RemoveBlock(id="block99"))
    handle.drain()
    handle.publish(replace(handle.snapshot(), commands=last))
    with pytest.raises(InvalidInput):
        handle.submit(RemoveBlock(id="block99"))


@pytest.mark.parametrize("command", [Reset(), StartTest(id="test-1")])
def test_block_is_added_after_a_command_that_replaces_the_blocks(
    handle: WorldHandle, command: Command
) -> None:
    for _ in range(4):
        handle.submit(AddBlock(colour="red", size="small"))
    world = new_world(load_cell("sorting-e0"), None, 1)
    for queued in handle.drain():
        world.apply(queued)
    handle.publish(replace(world.snapshot(), commands=4))
    with pytest.raises(InvalidInput, match="more than 10 blocks"):
        handle.submit(AddBlock(colour="red", size="small"))
    handle.submit(command)
    handle.submit(AddBlock(colour="red", size="small"))
    for queued in handle.drain():
        world.apply(queued)
    sorting = world.snapshot().sorting
    assert sorting is not None and len(sorting.blocks) < 10


def test_inference_mode_of_a_queued_policy_is_left_to_the_world() -> None:
    cell = load_cell("shared-workspace")
    handle = WorldHandle("main", cell, new_world(cell, None, 1).snapshot())
    mode = SetInferenceMode(inference_mode="direct")
    with pytest.raises(InvalidInput, match="needs a policy"):
        handle.submit(mode)
    chosen = handle.submit(SetPolicy(checkpoint=None))
    handle.submit(mode)
    handle.publish(replace(handle.snapshot(), commands=chosen))
    with pytest.raises(InvalidInput, match="needs a policy"):
        handle.submit(mode)


def test_checkpoint_of_a_queued_command_counts_as_acting() -> None:
    cell = load_cell()
    handle = WorldHandle("main", cell, new_world(cell, None, 1).snapshot())
    assert handle.acting == frozenset()
    policy = StraightPolicy(cell)
    command = SetPolicy(checkpoint=policy.checkpoint).with_loaded(policy)
    number = handle.submit(command)
    assert handle.acting == {policy.checkpoint}
    handle.publish(replace(new_world(cell, policy, 1).snapshot(), commands=number))
    assert handle.acting == {policy.checkpoint}
    number = handle.submit(SetPolicy(checkpoint=None))
    handle.publish(replace(new_world(cell, None, 1).snapshot(), commands=number))
    assert handle.acting == frozenset()


def test_people_are_those_of_the_snapshot_once_no_command_waits() -> None:
    cell = load_cell()
    handle = WorldHandle("main", cell, new_world(cell, None, 1).snapshot())
    for _ in range(3):
        last = handle.submit(AddPerson())
    with pytest.raises(InvalidInput, match="people = 5 must be at most 4"):
        handle.submit(AddPerson())
    handle.drain()  # and all three fail
    handle.publish(replace(handle.snapshot(), commands=last))
    assert handle.submit(AddPerson()) == last + 1


def test_stopped_world_takes_no_commands(handle: WorldHandle) -> None:
    handle.submit(PauseClock())
    handle.close()
    with pytest.raises(Conflict, match="was stopped"):
        handle.submit(PauseClock())
    assert [one.tag for one in handle.drain()] == ["pause"]
