"""The planner's figures of many tasks are those of each."""

import numpy as np

from app.sim.sorting.batch import SortingBatch, SortingSettings
from app.sim.sorting.kernels.optimal_costs import measure_envs
from app.sim.sorting.kernels.planner import new_work
from app.sim.sorting.planner import solve
from app.sim.sorting.state import SortingShape

SHAPE = SortingShape(n_slots=8, n_colours=3)


def test_fewest_moves_and_expected_attempts_are_those_of_each_task() -> None:
    settings = SortingSettings(disturbed_share=0.5, random_map_share=1.0)
    batch = SortingBatch(SHAPE, np.zeros(8), 60, 4, settings)
    batch.reset()
    which = np.arange(1, 60, 2)
    fewest, attempts = np.zeros(30, dtype=np.int64), np.zeros(30)
    measure_envs(batch.envs, which, new_work(8, 3, 3), fewest, attempts)
    plans = [solve(batch.state_of(e), SHAPE) for e in which.tolist()]
    assert fewest.tolist() == [plan.moves for plan in plans]
    assert attempts.tolist() == [plan.attempts for plan in plans]


def test_a_goal_that_cannot_be_met_has_no_fewest_moves() -> None:
    batch = SortingBatch(SHAPE, np.zeros(8), 1, 4)
    batch.reset()
    batch.envs.clutter[:] = 0
    fewest, attempts = np.zeros(1, dtype=np.int64), np.ones(1)
    measure_envs(batch.envs, np.arange(1), new_work(8, 3, 3), fewest, attempts)
    assert (fewest[0], attempts[0]) == (-1, 0.0)
