"""Batches of plans against plans of single states, and bounds of the work space."""

import itertools

import numpy as np

from app.sim.sorting.kernels.planner import (
    Objects,
    Task,
    new_work,
    plan_by_rules,
    plan_state,
)
from app.sim.sorting.kernels.planner_batch import TaskBatch, mark_tasks, plan_tasks
from app.sim.sorting.kernels.shortest_paths import lay_out, most_states, new_shortest_paths
from app.sim.sorting.planner import solve
from app.sim.sorting.state import SortingShape, SortingState
from tests.sim.sorting.sorting_search import random_task

SHAPE = SortingShape(n_slots=8, n_colours=3, n_sizes=2)


def tasks(n: int, seed: int) -> list[SortingState]:
    """Tasks of one shape."""
    rng = np.random.default_rng(seed)
    return [random_task(SHAPE, rng, int(rng.integers(9))) for _ in range(n)]


def rows_of(states: list[SortingState]) -> tuple[np.ndarray, ...]:
    """The arrays of a batch."""
    rows = [
        (s.clutter, s.towers, s.heights, s.goal, (s.goal != 0).sum(axis=1), s.fail)
        for s in states
    ]
    return tuple(np.stack(column) for column in zip(*rows, strict=True))


def planned(rows: tuple[np.ndarray, ...]) -> tuple[list[int], list[int]]:
    """Best actions and fewest moves of a batch."""
    best, fewest = (np.zeros(len(rows[0]), dtype=np.int64) for _ in range(2))
    plan_tasks(TaskBatch(*rows), new_work(8, 3, 2), best, fewest)
    return best.tolist(), fewest.tolist()


def test_rows_are_planned_as_single_states_are() -> None:
    states = tasks(200, seed=11)
    best, fewest = planned(rows_of(states))
    plans = [solve(state, SHAPE) for state in states]
    assert best == [-1 if plan.best is None else plan.best for plan in plans]
    assert fewest == [plan.moves for plan in plans]


def test_rows_that_cannot_be_solved_have_no_action_and_no_moves() -> None:
    rows = rows_of(tasks(3, seed=12))
    rows[3][1] = 0
    rows[3][1, 0, :8], rows[4][1] = 1, (8, 0, 0)  # eight of one code: there are fewer
    rows[0][1, 0] = 2
    best, fewest = planned(rows)
    assert (best[1], fewest[1]) == (-1, -1)
    assert fewest[0] >= 0 and fewest[2] >= 0


def test_marks_of_rows_are_all_first_actions() -> None:
    states = tasks(50, seed=13)
    first = np.zeros((50, SHAPE.n_actions), dtype=np.bool_)
    clutter, towers, heights, goal, goal_heights, fail = rows_of(states)
    batch = TaskBatch(clutter, towers, heights, goal, goal_heights, fail)
    mark_tasks(batch, new_work(8, 3, 2), first)
    for state, marks in zip(states, first, strict=True):
        assert tuple(np.flatnonzero(marks).tolist()) == solve(state, SHAPE).first


def test_a_rough_plan_has_as_many_moves_and_no_fewer_attempts() -> None:
    work, more = new_work(8, 3, 2), 0
    for state in tasks(200, seed=14):
        objects = Objects(state.clutter, state.towers, state.heights)
        wanted = Task(state.goal, np.count_nonzero(state.goal, axis=1), state.fail)
        rough, careful = plan_by_rules(objects, wanted, work), plan_state(objects, wanted, work)
        assert rough[0] == careful[0]
        assert careful[1] <= rough[1] + 1e-9
        more += careful[1] < rough[1] - 1e-9
    assert more > 0  # or looking ahead was of no use


def test_no_task_has_more_states_than_the_work_space_holds() -> None:
    for n_slots, n_colours in itertools.product((1, 2, 5), (1, 2, 3)):
        shape = SortingShape(n_slots=n_slots, n_colours=n_colours, n_sizes=1)
        p, rng = new_shortest_paths(n_slots, n_colours, 1), np.random.default_rng(15)
        for _ in range(100):
            row = rows_of([random_task(shape, rng, n_slots)])
            assert lay_out(*(part[0] for part in row[:5]), p) <= most_states(n_slots, n_colours)
