import pytest

from app.errors import InvalidInput
from app.live.factory import new_world
from app.live.sorting.commands import AddBlock, MoveBlock, RemoveBlock
from app.live.world_handle import WorldHandle
from app.sim.cells.cell import load_cell


@pytest.fixture
def handle() -> WorldHandle:
    cell = load_cell("sorting-e0")
    return WorldHandle("main", cell, new_world(cell, None, 1).snapshot())


def test_command_that_does_not_fit_the_table_is_refused_at_once(handle: WorldHandle) -> None:
    with pytest.raises(InvalidInput, match="is no block"):
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
    handle.submit(RemoveBlock(id="block99"))
    handle.drain()
    handle.publish(handle.snapshot())
    with pytest.raises(InvalidInput):
        handle.submit(RemoveBlock(id="block99"))
