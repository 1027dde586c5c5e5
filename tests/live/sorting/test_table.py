import pytest

from app.errors import InvalidInput
from app.live.sorting.table import SortingTable
from app.sim.cells.cell import load_cell
from app.sim.sorting.state import check_state

RED, BLUE = 10, 11


@pytest.fixture
def table() -> SortingTable:
    """Two large red blocks, a small one, and a large blue one."""
    table = SortingTable(load_cell("sorting-e0"))
    for colour, size, at in (
        ("red", "large", "slot0"),
        ("red", "large", "slot1"),
        ("red", "small", "slot2"),
        ("blue", "large", "blue"),
    ):
        table.add(colour, size, at)
    return table


def goal(table: SortingTable) -> list[str]:
    return [table.names.kind(int(code)) for code in table.goal.ravel() if code]


def test_held_block_counts_where_it_came_from(table: SortingTable) -> None:
    before = table.state
    table.lift(0)
    held = table.state
    assert (held.clutter == before.clutter).all()
    table.drop(RED)
    after = table.state
    assert (after.clutter[0], after.towers[0, 0]) == (0, before.clutter[0])


def test_held_block_counts_on_the_first_free_cell_once_its_own_is_taken(
    table: SortingTable,
) -> None:
    table.lift(0)
    table.add("blue", "small", "slot0")
    assert table.held_position == 3
    check_state(table.state, table.shape)


def test_block_that_is_taken_from_under_another_lets_it_down(table: SortingTable) -> None:
    table.move("block1", "blue")
    table.remove("block4")
    assert [one.id for one in table.towers[1]] == ["block1"]


def test_goal_loses_what_no_block_is_left_for(table: SortingTable) -> None:
    table.set_goal({"red": ("large", "large", "small")})
    table.remove("block1")
    assert goal(table) == ["large red", "small red"]
    assert table.goal_ids == {"block2", "block3"}


def test_duplicate_stands_in_for_a_block_that_is_removed(table: SortingTable) -> None:
    table.set_goal({"red": ("large",)})
    table.remove("block1")
    assert goal(table) == ["large red"]
    assert table.goal_ids == {"block2"}


def test_blocks_are_toggled_in_and_out_of_the_goal_largest_lowest(table: SortingTable) -> None:
    for id in ("block3", "block2"):
        table.toggle_goal(id)
    assert goal(table) == ["large red", "small red"]
    assert table.goal_ids == {"block2", "block3"}
    table.toggle_goal("block2")
    assert goal(table) == ["small red"]


def test_kind_is_toggled_one_by_one_and_then_out(table: SortingTable) -> None:
    seen = []
    for _ in range(3):
        table.toggle_goal("red-large")
        seen.append(len(goal(table)))
    assert seen == [1, 2, 0]


def test_block_in_its_place_stands_for_the_goal_rather_than_its_duplicate(
    table: SortingTable,
) -> None:
    table.toggle_goal("block1")
    table.lift(1)
    table.drop(RED)
    assert table.goal_ids == {"block2"}


def test_adopted_state_keeps_the_blocks_that_stay(table: SortingTable) -> None:
    state = table.state
    state.clutter[1], state.clutter[5] = 0, table.shape.code(1, 0)
    table.adopt(state)
    assert [one.id for one in table.blocks] == ["block1", "block3", "block4", "block5"]
    assert (table.state.clutter == state.clutter).all()


def test_table_holds_no_more_blocks_than_clutter_slots(table: SortingTable) -> None:
    for _ in range(6):
        table.add("blue", "small", None)
    with pytest.raises(InvalidInput, match="more than 10 blocks"):
        table.add("blue", "small", "red")


def test_goal_that_the_blocks_cannot_meet_names_what_is_missing(table: SortingTable) -> None:
    with pytest.raises(InvalidInput, match="1 x medium blue"):
        table.set_goal({"blue": ("large", "medium")})


def test_taken_cell_is_refused_with_the_free_ones(table: SortingTable) -> None:
    with pytest.raises(InvalidInput, match="taken by block2") as caught:
        table.move("block1", "slot1")
    assert "slot3" in caught.value.choices
