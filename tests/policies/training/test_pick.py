"""Training on the pick scenario: the collision cost that grows, the layer."""

import numpy as np
import pytest

from app.policies.configs.pick import MONITORED, REACH_ONLY, PickPreset
from app.policies.training.pick import batch_of, collision_cost, settings_of
from app.sim.cells.cell import load_cell
from app.sim.pick.batch import PickBatch
from app.sim.pick.monitored_batch import MonitoredPickBatch
from app.sim.scenario.kernels.episode import COLLISION

CELL = load_cell("pick-and-place")


def test_the_collision_cost_grows_linearly_and_then_stays():
    preset = PickPreset()
    total = preset.learning.total_steps
    costs = [collision_cost(preset, step) for step in (0, total // 2, total, 2 * total)]
    assert costs == pytest.approx([5.0, 7.5, 10.0, 10.0])
    assert collision_cost(REACH_ONLY, 1_000_000) == REACH_ONLY.reward.c_c


def test_rewards_contain_the_cost_that_was_set():
    batch = PickBatch(CELL, 64, 3, settings_of(PickPreset()))
    batch.reset()
    batch.set_collision_cost(100.0)
    act, costs = np.ones((64, 5), dtype=np.float32), []
    for _ in range(120):
        result = batch.step(act)
        costs += result.rew[result.ended == COLLISION].tolist()
    assert costs and max(costs) < -95.0


def test_monitored_preset_steps_under_the_layer_with_the_settings_of_the_cell():
    preset = MONITORED
    batch = batch_of(preset, CELL, 16, 3)
    assert isinstance(batch, MonitoredPickBatch)
    assert batch.safety.protective_distance == CELL.safety.protective_distance == 0.0
    assert settings_of(preset) == settings_of(PickPreset())
    batch.reset()
    rng = np.random.default_rng(0)
    for _ in range(100):
        batch.step(rng.uniform(-1.0, 1.0, (16, 5)).astype(np.float32))
    assert batch.episode.sum() > 0
    runs = batch.runs()
    ended = batch.episode > 0
    assert (runs.override[ended] <= 1.0 + 1e-9).all()
    assert not isinstance(batch_of(PickPreset(), CELL, 2, 3), MonitoredPickBatch)
