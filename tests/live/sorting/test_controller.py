import numpy as np
import pytest

from app.live.sorting.commands import SetOrder
from app.live.sorting.controller import SortController
from app.live.sorting.snapshot import Order
from app.live.sorting.table import SortingTable
from app.sim.cells.cell import load_cell
from app.sim.sorting.state import Move
from tests.support.sorting_values import FixedValues

RED, BLUE = 10, 11


@pytest.fixture
def table() -> SortingTable:
    """Three large red blocks, two of them in slots that never fail; one is asked for."""
    table = SortingTable(load_cell("sorting-e0"))
    for at in ("slot2", "slot5", "slot9"):
        table.add("red", "large", at)
    table.set_goal({"red": ("large",)})
    return table


def test_duplicates_that_fail_as_rarely_are_options_and_riskier_ones_are_not(
    table: SortingTable,
) -> None:
    choice = SortController(None).choose(table)
    assert choice is not None
    moves = {move for _, move in choice.options}
    assert moves == {Move(5, RED), Move(9, RED)}
    assert choice.options[0] == (choice.block, choice.move)


@pytest.mark.parametrize(
    ("order", "tool", "picks"),
    [
        ("critic", (0.3, 0.6, 0.2), {5, 9}),
        ("planner", (0.3, 0.6, 0.2), {5}),
        ("nearest", (0.3, 0.6, 0.2), {9}),
        ("nearest", (-0.3, 0.6, 0.2), {5}),
    ],
)
def test_order_decides_which_of_the_equal_moves_are_options(
    table: SortingTable, order: Order, tool: tuple[float, ...], picks: set[int]
) -> None:
    controller = SortController(None)
    controller.change(SetOrder(order=order))
    choice = controller.choose(table, tcp=np.array(tool))
    assert choice is not None
    assert {move.pick for _, move in choice.options} == picks
    assert choice.options[0] == (choice.block, choice.move)
    assert choice.n_equal == 2


def test_move_of_a_policy_that_is_no_shortest_plan_has_no_equal(table: SortingTable) -> None:
    choice = SortController(FixedValues(table.shape, [Move(5, BLUE)])).choose(table)
    assert choice is not None
    assert (choice.move, choice.n_equal) == (Move(5, BLUE), 1)


def test_block_that_was_not_reached_is_left_for_one_as_good(table: SortingTable) -> None:
    controller = SortController(None)
    first = controller.choose(table)
    assert first is not None
    controller.avoid(first.move.pick)
    second = controller.choose(table)
    assert second is not None
    assert second.move.pick != first.move.pick
    assert second.move.place == RED


def test_all_blocks_are_offered_again_once_none_of_them_was_reached(
    table: SortingTable,
) -> None:
    controller = SortController(None)
    for cell in (2, 5, 9):
        controller.avoid(cell)
    choice = controller.choose(table)
    assert choice is not None
    assert {move.pick for _, move in choice.options} == {5, 9}


def test_held_block_keeps_its_place_while_on_a_shortest_plan(table: SortingTable) -> None:
    table.lift(9)
    on = SortController(None).choose(table, Move(9, RED))
    assert on is not None
    assert (on.move, on.back) == (Move(9, RED), False)


def test_held_block_goes_back_where_it_counts_once_nothing_asks_for_it(
    table: SortingTable,
) -> None:
    table.lift(9)
    table.set_goal({})
    back = SortController(None).choose(table, Move(9, RED))
    assert back is not None
    assert (back.move, back.back) == (Move(9, 9), True)


def test_held_block_takes_the_place_that_a_duplicate_was_meant_for(table: SortingTable) -> None:
    table.lift(2)
    choice = SortController(None).choose(table)
    assert choice is not None
    assert (choice.move, choice.back) == (Move(2, RED), False)
