"""The best policy of the sorting reward takes the fewest moves and the safest duplicate.

By value iteration over all states of small tasks, with transitions and rewards of the batch.
"""

import numpy as np
import pytest

from app.sim.sorting.kernels.reward import SortingWeights
from app.sim.sorting.planner import solve
from app.sim.sorting.state import SortingShape, SortingState
from tests.sim.sorting.sorting_search import random_task
from tests.sim.sorting.sorting_values import judged, model_of, moves_to_go, values

GAMMAS = (0.92, 0.95, 0.99)


def tasks(shape: SortingShape, n: int, seed: int, n_objects: int) -> list[SortingState]:
    """Tasks with duplicates, junk and goals of any towers, none of them solved."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < n:
        task = random_task(shape, rng, n_objects)
        if not task.solved:
            found.append(task)
    return found


@pytest.mark.parametrize("gamma", GAMMAS)
def test_best_policy_takes_fewest_moves_and_the_safest_duplicate(gamma: float) -> None:
    shape = SortingShape(n_slots=3, n_colours=2, n_sizes=2)
    for task in tasks(shape, 6, 31, 3):
        verdict = judged(model_of(task, shape, SortingWeights()), shape, task.fail, gamma)
        assert verdict.fewest == verdict.safest_duplicate == verdict.n > 50


def test_planner_and_best_policy_agree_on_the_moves_to_begin_with() -> None:
    shape = SortingShape(n_slots=3, n_colours=2, n_sizes=2)
    for task in tasks(shape, 6, 32, 3):
        model, plan = model_of(task, shape, SortingWeights()), solve(task, shape)
        assert moves_to_go(model)[0] == plan.moves
        assert int(values(model, 0.95)[0].argmax()) in plan.first


def test_a_reward_that_pays_too_much_for_distance_is_found_out() -> None:
    shape = SortingShape(n_slots=4, n_colours=2, n_sizes=2)
    greedy = SortingWeights(distance=4.0)
    verdicts = [
        judged(model_of(task, shape, greedy), shape, task.fail, 0.92)
        for task in tasks(shape, 3, 33, 4)
    ]
    assert any(verdict.fewest < verdict.n for verdict in verdicts)


@pytest.mark.slow
@pytest.mark.parametrize("gamma", GAMMAS)
@pytest.mark.parametrize(
    "shape",
    [
        SortingShape(n_slots=4, n_colours=2, n_sizes=2),
        SortingShape(n_slots=4, n_colours=2, n_sizes=3),
        SortingShape(n_slots=4, n_colours=3, n_sizes=1),
        SortingShape(n_slots=5, n_colours=2, n_sizes=2),
    ],
)
def test_best_policy_takes_fewest_moves_in_every_state_of_larger_tasks(
    shape: SortingShape, gamma: float
) -> None:
    for task in tasks(shape, 10, 34, shape.n_slots):
        verdict = judged(model_of(task, shape, SortingWeights()), shape, task.fail, gamma)
        assert verdict.fewest == verdict.safest_duplicate == verdict.n
        assert verdict.worst_attempts < 1.05


def test_a_cost_of_parking_as_high_as_a_move_is_found_out() -> None:
    shape = SortingShape(n_slots=4, n_colours=2, n_sizes=2)
    shy = SortingWeights(fail=0.05, back=0.05, distance=0.1)
    verdicts = [
        judged(model_of(task, shape, shy), shape, task.fail, 0.95)
        for task in tasks(shape, 10, 34, 4)
    ]
    assert any(verdict.fewest < verdict.n for verdict in verdicts)
