"""Everybody as a set: each block says what is true of one person, and nobody's is empty."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.people.kernels.pedestrian import VX, VY, R, X, Y
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.prediction.kernels.networks import STEP_S
from app.sim.reach.batch import VIEWS, ReachBatch, ReachSettings
from app.sim.reach.kernels.people_set import BLOCK, LOOKS, N_BLOCK, SCALE

CELL = load_cell("shared-workspace")


def batch_of(n_people: int, seed: int = 5) -> ReachBatch:
    settings = ReachSettings(observation="people-set", people=("walker",) * n_people)
    return ReachBatch(CELL, 12, seed, settings)


def blocks_of(obs: np.ndarray) -> np.ndarray:
    return obs[:, VIEWS["forecast"][1] :].reshape(-1, MAX_PEOPLE, N_BLOCK)


@pytest.mark.parametrize("n_people", [0, 1, 3, 4])
def test_there_is_a_block_for_each_person_and_none_beyond(n_people):
    found = blocks_of(batch_of(n_people).reset())
    shown = max(n_people, 1)  # where nobody is, somebody stands in the far corner
    assert (found[:, :shown, 0] == 1.0).all()
    assert (found[:, shown:] == 0.0).all()


def test_a_block_says_where_the_person_is_and_will_be():
    batch = batch_of(3)
    found = blocks_of(batch.reset())
    rows, goal = batch.state.people.walkers.rows, batch.state.goal
    tcp = batch.obs[:, 32:35]
    for p in range(3):
        at, block = rows[:, p, [X, Y]], found[:, p]
        np.testing.assert_allclose(block[:, BLOCK["minus_goal"]], at - goal[:, :2], atol=1e-6)
        np.testing.assert_allclose(block[:, BLOCK["minus_tcp"]], at - tcp[:, :2], atol=1e-6)
        np.testing.assert_allclose(block[:, BLOCK["velocity"]], rows[:, p, [VX, VY]], atol=1e-6)
        np.testing.assert_allclose(block[:, BLOCK["radius"]][:, 0], rows[:, p, R], atol=1e-6)
        ahead = block[:, BLOCK["ahead"]].reshape(-1, len(LOOKS), 3)
        path = ahead[:, :, :2] + tcp[:, None, :2] - at[:, None]
        fastest = np.hypot(*path.transpose(2, 0, 1)) / (STEP_S * np.array(LOOKS))
        assert fastest.max() < 1.2 and np.ptp(ahead[:, :, 2]) > 0.05
    near = batch.person_distances(np.arange(12))
    said = found[:, :3, BLOCK["clearance"].start] * SCALE
    np.testing.assert_allclose(said, np.minimum(near, 3.0 * SCALE), atol=1e-6)


def test_what_stands_before_is_the_forecast_view():
    seen = batch_of(2).reset()
    settings = ReachSettings(observation="forecast", people=("walker",) * 2)
    other = ReachBatch(CELL, 12, 5, settings).reset()
    np.testing.assert_array_equal(seen[:, : other.shape[1]], other)


def test_other_goals_and_single_people_are_seen_alike():
    batch = batch_of(3)
    batch.reset()
    rows, goals = np.arange(12), batch.state.goal[:, None].copy()
    np.testing.assert_array_equal(batch.observe_goals(rows, goals)[:, 0], batch.obs)
    alone = blocks_of(batch.observe_goals(rows, goals, person=1)[:, 0])
    np.testing.assert_array_equal(alone[:, 0], blocks_of(batch.obs)[:, 1])
    assert (alone[:, 1:] == 0.0).all()
