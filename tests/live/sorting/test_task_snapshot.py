import numpy as np
import pytest

from app.live.sorting.controller import MoveChoice, SortController
from app.live.sorting.snapshot import MAX_RANKED, SortingCounters, SortingSnapshot
from app.live.sorting.table import SortingTable
from app.live.sorting.task_snapshot import task_snapshot
from app.sim.cells.cell import load_cell
from app.sim.sorting.state import Move


@pytest.fixture
def table() -> SortingTable:
    """Six large red blocks, five of which are asked for."""
    table = SortingTable(load_cell("sorting-e0"))
    for _ in range(6):
        table.add("red", "large", None)
    table.set_goal({"red": ("large",) * 5})
    return table


def shown(table: SortingTable, controller: SortController, move: Move) -> SortingSnapshot:
    """Return the snapshot while the robot makes a move."""
    block = table.top(move.pick)
    assert block is not None
    return task_snapshot(
        table,
        controller,
        MoveChoice(move=move, block=block, options=((block, move),)),
        phase="approach",
        counters=SortingCounters(),
        test=None,
        tcp=np.zeros(3),
    )


@pytest.mark.parametrize("place", [0, MAX_RANKED - 1, MAX_RANKED, -1])
def test_ranked_moves_contain_the_present_one_whatever_its_rank(
    table: SortingTable, place: int
) -> None:
    controller = SortController(None)
    controller.choose(table)
    assert controller.decision is not None
    ranked = controller.decision.ranked
    view = shown(table, controller, ranked[place].move)
    assert view.move is not None
    assert view.move.value == ranked[place].value
    assert view.ranked.count(view.move) == 1
    assert len(view.ranked) == MAX_RANKED
    values = [one.value for one in view.ranked if one.value is not None]
    assert values == sorted(values, reverse=True)


def test_move_that_the_decision_does_not_value_is_ranked_without_a_value(
    table: SortingTable,
) -> None:
    controller = SortController(None)
    controller.choose(table)
    view = shown(table, controller, Move(0, 0))
    assert view.ranked[-1] == view.move
    assert view.ranked[-1].value is None
