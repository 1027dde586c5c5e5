"""Targets of the greatest value (thesis section 5.2)."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.pick.batch import PickBatch, PickSettings, tool_state
from app.sim.pick.valued_targets import ValuedTargetBatch

CELL = load_cell("pick-and-place")
SETTINGS = PickSettings(observation="state")
GOAL = slice(48, 51)
"""Target in the raw state [m]."""
LEFT_DOCK = 7


def leftness(obs: np.ndarray) -> np.ndarray:
    """Return values that prefer targets with a small x."""
    return -obs[:, GOAL.start]


@pytest.fixture
def batches() -> tuple[PickBatch, ValuedTargetBatch]:
    return PickBatch(CELL, 64, 7, SETTINGS), ValuedTargetBatch(CELL, 64, 7, SETTINGS)


def test_without_values_the_drawn_target_stays(batches) -> None:
    usual, valued = batches
    np.testing.assert_array_equal(valued.reset(), usual.reset())


def test_the_station_of_the_greatest_value_is_the_target(batches) -> None:
    usual, valued = batches
    usual.reset()
    valued.values = leftness
    obs = valued.reset().copy()
    stations, q = valued.world.stations, valued.world.station_q
    at_dock = (valued.state.q == q[LEFT_DOCK]).all(axis=1)
    assert 0 < at_dock.sum() < 32
    expected = np.where(at_dock, 0, LEFT_DOCK)  # cube0 is next to the left
    np.testing.assert_array_equal(valued.state.candidates[:, 0], expected)
    np.testing.assert_array_equal(valued.state.goal, stations[expected])
    np.testing.assert_array_equal(obs[:, GOAL], stations[expected].astype(np.float32))
    np.testing.assert_array_equal(valued.state.q, usual.state.q)  # the starts stay
    away = [
        tool_state(valued.arm, q, np.zeros(6), goal)[0]
        for q, goal in zip(valued.state.q, valued.state.goal, strict=True)
    ]
    np.testing.assert_allclose(valued.state.distance, away)


def test_an_episode_that_ends_is_followed_by_a_chosen_target(batches) -> None:
    _, valued = batches
    valued.values = leftness
    valued.reset()
    valued.state.time_left[:] = 0.01
    result = valued.step(np.zeros((64, valued.n_act), dtype=np.float32))
    assert (result.ended > 0).all()
    assert set(valued.state.candidates[:, 0]) == {0, LEFT_DOCK}
    np.testing.assert_array_equal(result.obs[:, GOAL], valued.state.goal.astype(np.float32))


def test_a_station_at_which_the_robot_stands_has_no_value(batches) -> None:
    _, valued = batches
    valued.reset()
    values = valued.station_values(np.arange(64), lambda obs: obs[:, GOAL.start])
    stands = np.isneginf(values)
    assert (stands.sum(axis=1) <= 1).all() and stands.any() and not stands.all(axis=0).any()
    expected = np.tile(valued.world.stations[:, 0], (64, 1))
    np.testing.assert_allclose(values[~stands], expected[~stands])
