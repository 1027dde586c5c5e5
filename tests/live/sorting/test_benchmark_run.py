from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput
from app.live.sorting.benchmark_run import PAUSE_S, SortingTestRun, random_task
from app.sim.cells.cell import load_cell
from app.sim.sorting.batch import fail_of, shape_of
from app.sim.sorting.benchmark_tasks import TESTS, sorting_test
from app.sim.sorting.state import SortingShape, check_state

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
    trial = SortingTestRun("test-4", (1, 2))
    state = trial.start(SHAPE, FAIL)
    done = type(state)(
        clutter=np.zeros_like(state.clutter), towers=state.goal, goal=state.goal, fail=FAIL
    )
    assert trial.interfere(done, 5, 0.5 * PAUSE_S) is None
    acted = trial.interfere(done, 5, PAUSE_S)
    assert acted is not None
    assert acted[0].n_objects == 6
    assert trial.interfere(done, 5, PAUSE_S) is None


def test_person_whose_part_a_visitor_made_impossible_does_nothing() -> None:
    trial = SortingTestRun("test-6", (1, 2))
    state = trial.start(SHAPE, FAIL)
    empty = type(state)(
        clutter=np.zeros_like(state.clutter), towers=state.goal, goal=state.goal, fail=FAIL
    )
    assert trial.interfere(empty, 3, PAUSE_S) is None


def test_test_that_does_not_fit_the_cell_is_refused() -> None:
    with pytest.raises(InvalidInput, match="test-2"):
        SortingTestRun("test-2", (1,)).start(SortingShape(n_slots=8, n_colours=2), np.zeros(8))


def begun(name: str) -> SortingTestRun:
    trial = SortingTestRun(name, (1, 2))
    trial.start(SHAPE, FAIL)
    return trial


@pytest.mark.parametrize("name", [one.name for one in TESTS])
def test_goal_that_is_reached_is_a_verdict_only_after_the_last_interference(name: str) -> None:
    trial = begun(name)
    state = trial.start(SHAPE, FAIL)
    assert trial.verdict(solved=False, moves=0).as_expected is None
    for one in sorting_test(name).interferences:
        assert trial.verdict(solved=True, moves=5).as_expected is None
        towers = state.goal if one.after_moves is None else state.towers
        now = replace(state, towers=towers, clutter=without(state.clutter, towers))
        acted = trial.interfere(now, 5, PAUSE_S)
        assert acted is not None
        state = acted[0]
    end = trial.verdict(solved=True, moves=7)
    assert end.as_expected is True
    assert "7 moves" in end.observed
    assert "no contacts" in end.observed
    trial.note_contact()
    assert trial.verdict(solved=False, moves=7) is end


def without(clutter: np.ndarray, towers: np.ndarray) -> np.ndarray:
    """Return the clutter without the blocks that stand on towers."""
    rest = clutter.copy()
    for code in towers[towers != 0]:
        rest[np.flatnonzero(rest == code)[0]] = 0
    return rest


def test_contact_or_a_riskier_duplicate_is_not_as_expected() -> None:
    touched = begun("test-1")
    touched.note_contact()
    assert touched.verdict(solved=True, moves=5).as_expected is False
    duplicates = begun("test-3")
    duplicates.note_pick(riskier=False)
    assert duplicates.verdict(solved=False, moves=1).as_expected is None
    duplicates.note_pick(riskier=True)
    found = duplicates.verdict(solved=True, moves=5)
    assert found.as_expected is False
    assert "1 of 2 grasps in a riskier slot" in found.observed
    elsewhere = begun("test-2")
    elsewhere.note_pick(riskier=True)
    assert elsewhere.verdict(solved=True, moves=5).as_expected is True


def test_test_that_a_visitor_changed_is_not_judged() -> None:
    changed = begun("test-1")
    changed.note_visitor()
    found = changed.verdict(solved=True, moves=5)
    assert found.as_expected is None
    assert found.observed == "Not judged: blocks or goal were changed by hand."
    robbed = begun("test-6")
    state = robbed.start(SHAPE, FAIL)
    empty = replace(state, clutter=np.zeros_like(state.clutter), towers=state.goal)
    assert robbed.interfere(empty, 3, PAUSE_S) is None
    assert robbed.verdict(solved=True, moves=3).as_expected is None
