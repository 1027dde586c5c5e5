import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import Cell, load_cell
from app.sim.sorting.batch import fail_of
from app.sim.sorting.names import (
    NamedObject,
    fail_with,
    names_of,
    plain_names,
    state_from_names,
)

NAMES = plain_names(4, ["red", "blue"], ["small", "large"])
NO_RISK = np.zeros(4)


def with_levels(cell: Cell, levels: int) -> Cell:
    """Return a cell whose towers have other numbers of levels."""
    stations = tuple(
        one.model_copy(update={"levels": levels}) if one.kind == "cluster" else one
        for one in cell.stations
    )
    return cell.model_copy(update={"name": "other-towers", "stations": stations})


def test_words_of_a_cell_are_its_stations_and_colours() -> None:
    names = names_of(load_cell("sorting-e0"))
    assert names.slots == tuple(f"slot{k}" for k in range(10))
    assert names.towers == names.colours == ("red", "blue")
    assert names.sizes == ("small", "medium", "large")
    assert names.stations[10] == "red"


def test_state_holds_what_the_words_say() -> None:
    objects = [
        NamedObject(colour="blue", size="large", at="slot3"),
        NamedObject(colour="red", size="small", at="blue", level=1),
        NamedObject(colour="red", size="large", at="blue", level=0),
    ]
    goal = {"blue": [(None, "large")], "red": [("red", "large"), (None, "small")]}
    state = state_from_names(NAMES, objects, goal, np.array([0.1, 0.0, 0.0, 0.2]))
    assert state.clutter.tolist() == [0, 0, 0, 4]
    assert state.towers.tolist() == [[0] * 4, [2, 1, 0, 0]]
    assert state.goal.tolist() == [[2, 1, 0, 0], [4, 0, 0, 0]]
    assert state.fail.tolist() == [0.1, 0.0, 0.0, 0.2]


def test_every_code_has_its_own_words() -> None:
    kinds = [NAMES.kind(code) for code in range(1, 5)]
    assert kinds == ["small red", "large red", "small blue", "large blue"]


def test_goal_that_lacks_objects_names_how_many_of_what() -> None:
    objects = [NamedObject(colour="red", size="small", at="slot0")]
    goal = {"red": [(None, "large"), (None, "large"), (None, "small")]}
    with pytest.raises(InvalidInput, match="2 x large red"):
        state_from_names(NAMES, objects, goal, NO_RISK)


def test_towers_of_fewer_levels_than_clutter_slots_are_refused() -> None:
    with pytest.raises(InvalidInput, match="needs at least 10 levels for each cluster") as low:
        names_of(with_levels(load_cell("sorting-e0"), 2))
    assert low.value.field == "cell"
    high = with_levels(load_cell("sorting-e0"), 12)
    assert names_of(high).shape == names_of(load_cell("sorting-e0")).shape


def test_tower_takes_no_more_levels_than_the_task_has() -> None:
    names = names_of(load_cell("sorting-e0"))
    objects = [NamedObject(colour="red", size="small", at="red", level=10)]
    with pytest.raises(InvalidInput, match=r"must lie in \[0, 9\]"):
        state_from_names(names, objects, {}, np.zeros(10))


@pytest.mark.parametrize("chance", [1.0, 0.995, -0.1, float("nan")])
def test_failure_probability_that_leaves_no_plan_is_refused(chance: float) -> None:
    with pytest.raises(InvalidInput, match=r"failure_map\.slot1"):
        fail_with(NAMES, NO_RISK, {"slot1": chance})


def test_cells_that_no_failure_map_names_keep_their_own_risk() -> None:
    cell = load_cell("sorting-e0")
    own = fail_of(cell)
    fail = fail_with(names_of(cell), own, {"slot5": 0.5})
    assert np.flatnonzero(fail != own).tolist() == [5]
    assert own[5] == 0.0


@pytest.mark.parametrize(
    ("colours", "sizes", "field"),
    [
        (["red", "red"], ["small"], "colours"),
        (["slot1"], ["small"], "colours"),
        (["red"], ["small", "small"], "sizes"),
    ],
)
def test_name_of_two_things_is_refused(
    colours: list[str], sizes: list[str], field: str
) -> None:
    with pytest.raises(InvalidInput) as caught:
        plain_names(4, colours, sizes)
    assert caught.value.field == field
