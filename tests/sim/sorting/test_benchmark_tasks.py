"""The six tests of the sorting task: every draw shows what its test is for."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput, NotFound
from app.sim.sorting.benchmark_tasks import (
    TESTS,
    SortingTest,
    add_to_clutter,
    sorted_goal,
    sorting_test,
)
from app.sim.sorting.state import (
    NULL,
    SortingShape,
    SortingState,
    check_state,
    code_counts,
    empty_state,
)

SHAPES = [
    SortingShape(n_slots=10, n_colours=2),
    SortingShape(n_slots=20, n_colours=3),
    SortingShape(n_slots=40, n_colours=5, n_sizes=5),
]
DRAWN = 40


def started(test: SortingTest, shape: SortingShape, seed: int) -> SortingState:
    rng = np.random.default_rng(seed)
    return test.start(shape, np.linspace(0.0, 0.4, shape.n_slots), rng)


def sorted_now(state: SortingState, shape: SortingShape) -> SortingState:
    """Return the state in which the goal is reached and the rest lies in the clutter."""
    left = code_counts(state.clutter, shape) + code_counts(state.towers, shape)
    left -= code_counts(state.goal, shape)
    left[NULL] = 0
    clutter = np.zeros_like(state.clutter)
    rest = np.repeat(np.arange(len(left)), left)
    clutter[: len(rest)] = rest
    return replace(state, clutter=clutter, towers=state.goal.copy())


def drawn(name: str):
    test = sorting_test(name)
    return [
        (shape, started(test, shape, seed), np.random.default_rng(1000 + seed))
        for shape in SHAPES
        if test.fits(shape)
        for seed in range(DRAWN)
    ]


def after(name: str, k: int):
    """Return goals reached in a test, and what they are after interference ``k``."""
    found = []
    for shape, state, rng in drawn(name):
        reached = sorted_now(state, shape)
        change = sorting_test(name).interferences[k].change(reached, shape, rng)
        check_state(change, shape)
        found.append((shape, reached, change))
    return found


@pytest.mark.parametrize("test", TESTS, ids=lambda test: test.name)
def test_starts_are_sound_and_of_the_stated_size(test):
    for shape, state, _ in drawn(test.name):
        check_state(state, shape)
        assert state.n_objects == test.n_objects
        assert (state.goal != NULL).sum() == test.n_goal
        assert not state.solved
        assert not state.heights.any()


def test_the_first_task_is_large_enough_for_all_six():
    assert all(test.fits(SHAPES[0]) for test in TESTS)


def test_a_task_that_is_too_small_fits_no_test_it_cannot_hold():
    assert not sorting_test("test-2").fits(SortingShape(n_slots=9, n_colours=2))
    assert not sorting_test("test-5").fits(SortingShape(n_slots=8, n_colours=2))
    assert not sorting_test("test-6").fits(SortingShape(n_slots=10, n_colours=1))
    assert not sorting_test("test-4").fits(SortingShape(n_slots=10, n_colours=2, n_sizes=1))


def test_every_object_of_the_third_test_has_a_duplicate_in_a_riskier_cell():
    for shape, state, _ in drawn("test-3"):
        for code in np.unique(state.clutter[state.clutter != NULL]):
            risks = np.sort(state.fail[state.clutter == code])
            n_safe = len(risks) // 2
            assert risks[:n_safe].max() < risks[n_safe:].min()
            assert (state.goal == code).sum() == n_safe
            assert int(code) <= shape.n_types


def test_the_fourth_test_adds_an_object_that_belongs_below_a_sorted_one():
    for _shape, reached, changed in after("test-4", 0):
        assert changed.n_objects == reached.n_objects + 1
        assert (changed.goal != NULL).sum() == 6
        assert ((reached.towers != NULL) & (reached.towers != changed.goal)).any()


def test_the_fifth_test_adds_a_duplicate_of_what_is_still_asked_for():
    for shape, state, rng in drawn("test-5"):
        first = sorting_test("test-5").interferences[0]
        changed = first.change(state, shape, rng)
        added = code_counts(changed.clutter, shape) - code_counts(state.clutter, shape)
        code = int(np.flatnonzero(added[1:])[0]) + 1
        assert added[1:].sum() == 1
        assert (changed.goal == state.goal).all()
        assert (state.goal == code).any()


def test_the_fifth_test_then_asks_for_sorted_objects_to_move():
    for _shape, reached, changed in after("test-5", 1):
        assert changed.n_objects == reached.n_objects
        assert ((reached.towers != NULL) & (reached.towers != changed.goal)).any()


def test_the_sixth_test_goes_from_one_colour_to_two():
    for shape, reached, changed in after("test-6", 0):
        before = {shape.colour_of(int(c)) for c in reached.goal[reached.goal != NULL]}
        now = {shape.colour_of(int(c)) for c in changed.goal[changed.goal != NULL]}
        assert (len(before), len(now)) == (1, 2)
        assert (changed.goal != NULL).sum() == 6
        assert (changed.towers == reached.towers).all()


def test_goals_put_the_largest_lowest_and_colours_apart():
    shape = SHAPES[0]
    goal = sorted_goal([1, 3, 2, 6, 4], shape)
    assert goal[:, :3].tolist() == [[3, 2, 1], [6, 4, 0]]


@pytest.mark.parametrize(
    ("name", "field"), [("test-4", "towers"), ("test-5", "goal"), ("test-6", "clutter")]
)
def test_a_change_without_a_meaning_is_a_named_problem(name, field):
    first = sorting_test(name).interferences[0]
    with pytest.raises(InvalidInput) as caught:
        first.change(empty_state(SHAPES[0]), SHAPES[0], np.random.default_rng(1))
    assert caught.value.field == field


def test_no_object_is_added_where_there_is_no_room():
    shape = SHAPES[0]
    full = replace(empty_state(shape), clutter=np.full(10, 2, dtype=np.int8))
    with pytest.raises(InvalidInput, match="no room"):
        add_to_clutter(full, 1, np.random.default_rng(1))


def test_an_unknown_test_is_named():
    with pytest.raises(NotFound, match="no sorting test 'test-7'; known: test-1"):
        sorting_test("test-7")
