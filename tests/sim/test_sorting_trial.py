import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells import load_cell
from app.sim.sorting import fail_of, shape_of
from app.sim.sorting_state import SortingShape, check_state
from app.sim.sorting_trial import PAUSE_S, SortingTrial, random_task

CELL = load_cell("sorting-e0")
SHAPE, FAIL = shape_of(CELL), fail_of(CELL)


def test_random_task_has_six_blocks_in_the_clutter_and_a_goal() -> None:
    state = random_task(SHAPE, FAIL, seed=3, number=0)
    check_state(state, SHAPE)
    assert (state.clutter != 0).sum() == 6
    assert (state.goal != 0).any()
    other = random_task(SHAPE, FAIL, seed=3, number=1)
    assert (state.clutter != other.clutter).any()


def test_person_acts_once_the_goal_was_shown_for_a_while() -> None:
    trial = SortingTrial("test-4", (1, 2))
    state = trial.start(SHAPE, FAIL)
    done = type(state)(
        clutter=np.zeros_like(state.clutter), towers=state.goal, goal=state.goal, fail=FAIL
    )
    assert trial.interfere(done, 5, 0.5 * PAUSE_S) is None
    acted = trial.interfere(done, 5, PAUSE_S)
    assert acted is not None
    assert acted.state.n_objects == 6
    assert trial.interfere(done, 5, PAUSE_S) is None


def test_person_whose_part_a_visitor_made_impossible_does_nothing() -> None:
    trial = SortingTrial("test-6", (1, 2))
    state = trial.start(SHAPE, FAIL)
    empty = type(state)(
        clutter=np.zeros_like(state.clutter), towers=state.goal, goal=state.goal, fail=FAIL
    )
    assert trial.interfere(empty, 3, PAUSE_S) is None


def test_test_that_does_not_fit_the_cell_is_refused() -> None:
    with pytest.raises(InvalidInput, match="test-2"):
        SortingTrial("test-2", (1,)).start(SortingShape(n_cells=8, n_colours=2), np.zeros(8))
