"""The exact planner against brute force: fewest moves, all best next moves, whole plans."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.sorting_planner import attempts_of, follow, solve
from app.sim.sorting_state import Move, SortingShape, SortingState
from tests.sim.sorting_search import first_moves, random_task


def task(
    clutter: list[int], towers: list[list[int]], goal: list[list[int]], fail: float = 0.0
) -> tuple[SortingState, SortingShape]:
    """A task from lists; every pick from the clutter fails with the same probability."""
    shape = SortingShape(n_cells=len(clutter), n_colours=len(towers), n_sizes=3)
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


def random_tasks(n: int, seed: int, most: int) -> list[tuple[SortingState, SortingShape]]:
    """Tasks of up to ``most`` cells, 1 to 3 colours, 1 to 2 sizes, with junk on towers."""
    rng = np.random.default_rng(seed)
    tasks = []
    for _ in range(n):
        shape = SortingShape(
            n_cells=int(rng.integers(2, most + 1)),
            n_colours=int(rng.integers(1, 4)),
            n_sizes=int(rng.integers(1, 3)),
        )
        n_objects = int(rng.integers(1, shape.n_cells + 1))
        tasks.append(
            (random_task(shape, rng, n_objects, float(rng.choice([0, 0.5, 0.9]))), shape)
        )
    return tasks


def test_fewest_moves_and_all_first_moves_are_those_of_brute_force() -> None:
    for state, shape in random_tasks(150, seed=1, most=4):
        plan = solve(state, shape)
        assert (plan.moves, plan.first) == first_moves(state, shape)
