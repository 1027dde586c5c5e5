"""Cells with different numbers of people, stepped together as if they were alone."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.mixed_batch import MixedReachBatch

CELL = load_cell("shared-workspace")
SETTINGS = ReachSettings(observation="people-set", people=("walker",) * 3)


def test_each_share_of_the_cells_is_a_batch_of_its_own():
    mix = MixedReachBatch(CELL, 8, 4, SETTINGS)
    assert [part.n_envs for part in mix.parts] == [2, 3, 3]
    assert [part.n_people for part in mix.parts] == [1, 2, 3]
    first = mix.reset()
    assert first.shape == (8, mix.obs_size)
    two = replace(SETTINGS, people=("walker",) * 2)
    alone = ReachBatch(CELL, 3, 4, two, first_env=2)
    np.testing.assert_array_equal(first[2:5], alone.reset())
    act = np.random.default_rng(1).uniform(-1.0, 1.0, (8, 6)).astype(np.float32)
    for _ in range(100):
        found, expected = mix.step(act), alone.step(act[2:5])
        np.testing.assert_array_equal(found.obs[2:5], expected.obs)
        np.testing.assert_array_equal(found.rew[2:5], expected.rew)
        np.testing.assert_array_equal(found.ended[2:5], expected.ended)


@pytest.mark.parametrize("people", [(), ("walker",) * 4])
def test_no_people_or_more_parts_than_environments_are_refused(people):
    with pytest.raises(InvalidInput, match="people"):
        MixedReachBatch(CELL, 3, 1, replace(SETTINGS, people=people))
