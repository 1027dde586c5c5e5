"""The exact planner against brute force: fewest moves, all best next moves, whole plans."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.sorting.batch import apply
from app.sim.sorting.planner import follow, solve
from app.sim.sorting.state import Move, SortingShape, SortingState
from tests.sim.sorting.sorting_search import (
    attempts_of,
    fewest_attempts,
    first_moves,
    moves_to_go,
    random_task,
)

Task = tuple[SortingState, SortingShape]


def task(
    clutter: list[int], towers: list[list[int]], goal: list[list[int]], fail: float = 0.0
) -> Task:
    """A task from lists; every pick from the clutter fails with the same probability."""
    shape = SortingShape(n_slots=len(clutter), n_colours=len(towers), n_sizes=3)
    stacks = [np.zeros((len(towers), len(clutter)), dtype=np.int8) for _ in range(2)]
    for filled, wanted in zip(stacks, (towers, goal), strict=True):
        for c, tower in enumerate(wanted):
            filled[c, : len(tower)] = tower
    state = SortingState(
        clutter=np.array(clutter, dtype=np.int8),
        towers=stacks[0],
        goal=stacks[1],
        fail=np.full(len(clutter), fail),
    )
    return state, shape


def random_tasks(n: int, seed: int, most: int) -> list[Task]:
    """Tasks of up to ``most`` cells, 1 to 3 colours, 1 to 3 sizes, with junk on towers."""
    rng = np.random.default_rng(seed)
    tasks = []
    for _ in range(n):
        shape = SortingShape(
            n_slots=int(rng.integers(2, most + 1)),
            n_colours=int(rng.integers(1, 4)),
            n_sizes=int(rng.integers(1, 4)),
        )
        n_objects = int(rng.integers(1, shape.n_slots + 1))
        on_towers = float(rng.choice([0.0, 0.5, 0.9]))
        tasks.append((random_task(shape, rng, n_objects, on_towers), shape))
    return tasks


def crowded_tasks(n: int, seed: int) -> list[Task]:
    """Tasks of 4 cells whose 3 or 4 towers are full of duplicates, where goals partly stand."""
    rng = np.random.default_rng(seed)
    shapes = [SortingShape(n_slots=4, n_colours=3 + i % 2, n_sizes=1) for i in range(n)]
    return [(random_task(shape, rng, 4, on_towers=0.9), shape) for shape in shapes]


def test_fewest_moves_and_all_first_moves_are_those_of_brute_force() -> None:
    for state, shape in random_tasks(250, seed=1, most=4) + random_tasks(25, seed=2, most=5):
        plan = solve(state, shape)
        assert (plan.moves, plan.first) == first_moves(state, shape)


def test_they_are_so_on_crowded_towers_with_duplicates() -> None:
    for state, shape in crowded_tasks(40, seed=3):
        plan = solve(state, shape)
        assert (plan.moves, plan.first) == first_moves(state, shape)


def test_what_matches_is_taken_apart_where_that_saves_a_move() -> None:
    state, shape = task([0] * 4, [[1], [], [1, 2, 3]], [[1], [1, 3, 2], []])
    assert first_moves(state, shape)[0] == 4
    assert follow(state, shape) == [Move(4, 5), Move(6, 5), Move(6, 5), Move(6, 4)]


def test_an_object_may_wait_on_another_tower_where_that_costs_no_move() -> None:
    state, shape = task([0, 0], [[1, 4], []], [[4], [1]], fail=0.5)
    plan = solve(state, shape)
    assert shape.action_of(Move(2, 3)) not in plan.first  # 1 would have to go below it
    state, shape = task([0, 0, 0], [[2, 1], [], [3]], [[], [2, 1], [3]], fail=0.5)
    plan = solve(state, shape)
    assert plan.first == first_moves(state, shape)[1]
    assert shape.move_of(plan.best or 0) == Move(3, 5)
    assert plan.attempts == 3.0


def test_the_plan_reaches_the_goal_in_the_fewest_moves_at_the_stated_attempts() -> None:
    for state, shape in random_tasks(200, seed=4, most=9):
        plan, moves = solve(state, shape), follow(state, shape)
        after = state
        for move in moves:
            after = apply(after, shape, move)
        assert after.solved and len(moves) == plan.moves
        assert attempts_of(moves, state.fail) == pytest.approx(plan.attempts)


def test_the_best_move_is_one_of_the_first_and_the_plan_begins_with_it() -> None:
    for state, shape in random_tasks(200, seed=5, most=9):
        plan = solve(state, shape)
        if plan.best is not None:
            assert plan.best in plan.first
            assert shape.move_of(plan.best) == follow(state, shape)[0]


def test_attempts_are_hardly_more_than_the_fewest_of_brute_force() -> None:
    excess = []
    for state, shape in random_tasks(80, seed=6, most=4):
        plan, distance = solve(state, shape), moves_to_go(state, shape)[1]
        if plan.moves:
            excess.append(plan.attempts / fewest_attempts(state, shape, distance) - 1.0)
    assert min(excess) > -1e-9  # below the fewest would be an error of either
    assert np.mean(np.array(excess) < 1e-9) >= 0.97
    assert max(excess) < 0.1


def test_the_least_risky_of_duplicates_is_taken() -> None:
    state, shape = task([1, 1, 2, 0], [[], []], [[1], []])
    state.fail[:] = [0.4, 0.1, 0.0, 0.0]
    plan = solve(state, shape)
    assert plan.first == (0, 2)
    assert (plan.best, plan.attempts) == (2, pytest.approx(1.0 / 0.9))


def test_an_object_wanted_again_is_put_into_the_best_free_cell() -> None:
    state, shape = task([0, 0, 0], [[1, 2]], [[2, 1]])
    state.fail[:] = [0.3, 0.1, 0.2]
    plan = solve(state, shape)
    assert plan.attempts == pytest.approx(1.0 + 1.0 + 1.0 / 0.9 + 1.0 / 0.8)


def test_an_object_wanted_no_more_leaves_the_good_cells_free() -> None:
    state, shape = task([0, 0, 0], [[3, 1]], [[]])
    state.fail[:] = [0.3, 0.1, 0.2]
    assert follow(state, shape) == [Move(3, 0), Move(3, 2)]


def test_a_good_cell_is_kept_for_the_object_that_has_no_duplicate() -> None:
    state, shape = task([0, 2, 1, 0], [[1, 2]], [[2, 1, 1]])
    state.fail[:] = [0.37, 0.035, 0.28, 0.03]
    assert follow(state, shape)[:2] == [Move(4, 0), Move(4, 3)]


def test_a_goal_that_is_reached_needs_no_plan() -> None:
    state, shape = task([2, 0, 0], [[1]], [[1]], fail=0.3)
    plan = solve(state, shape)
    assert (plan.moves, plan.attempts, plan.first, plan.best) == (0, 0.0, (), None)
    assert follow(state, shape) == []


def test_a_goal_whose_objects_are_missing_is_named() -> None:
    state, shape = task([2, 0, 0], [[1]], [[1, 3]])
    with pytest.raises(InvalidInput, match=r"goal = \[3\].*missing"):
        solve(state, shape)


def test_more_objects_than_cells_are_refused() -> None:
    state, shape = task([1, 1], [[1]], [[1]])
    with pytest.raises(InvalidInput, match="objects = 3 must be at most 2"):
        solve(state, shape)


def test_the_largest_task_is_planned() -> None:
    shape = SortingShape(n_slots=40, n_colours=5, n_sizes=5)
    state = random_task(shape, np.random.default_rng(8), 40, on_towers=0.5)
    assert len(follow(state, shape)) == solve(state, shape).moves
