"""Training on the pick scenario: the collision cost that grows."""

import numpy as np
import pytest

from app.policies.configs.pick import REACH_ONLY, PickPreset
from app.policies.training.pick import collision_cost, settings_of
from app.sim.cells.cell import load_cell
from app.sim.pick.batch import PickBatch
from app.sim.scenario.kernels.episode import COLLISION


def test_the_collision_cost_grows_linearly_and_then_stays():
    preset = PickPreset()
    total = preset.learning.total_steps
    costs = [collision_cost(preset, step) for step in (0, total // 2, total, 2 * total)]
    assert costs == pytest.approx([5.0, 7.5, 10.0, 10.0])
    assert collision_cost(REACH_ONLY, 1_000_000) == REACH_ONLY.reward.c_c


def test_rewards_contain_the_cost_that_was_set():
    batch = PickBatch(load_cell("pick-and-place"), 64, 3, settings_of(PickPreset()))
    batch.reset()
    batch.set_collision_cost(100.0)
    act, costs = np.ones((64, 5), dtype=np.float32), []
    for _ in range(120):
        result = batch.step(act)
        costs += result.rew[result.ended == COLLISION].tolist()
    assert costs and max(costs) < -95.0
