"""Starts between the target and the sampled start (thesis 5.3.4)."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.pick.curriculum_batch import CurriculumPickBatch, StartRange

CELL = load_cell("pick-and-place")
SETTINGS = PickSettings(observation="state")


@pytest.mark.parametrize(
    ("low", "mode", "u", "fraction"),
    [
        (0.0, 0.0, 0.19, 0.1),  # 1 - (1 - x)^2
        (0.0, 1.0, 0.25, 0.5),  # x^2
        (0.0, 0.5, 0.125, 0.25),  # 2 x^2 up to the mode
        (0.0, 0.5, 0.875, 0.75),  # 1 - 2 (1 - x)^2 beyond it
        (0.5, 1.0, 0.25, 0.75),  # (2 x - 1)^2
        (1.0, 1.0, 0.7, 1.0),
    ],
)
def test_the_fraction_follows_the_triangular_distribution(
    low: float, mode: float, u: float, fraction: float
) -> None:
    assert StartRange(low, mode).fraction(u) == pytest.approx(fraction)


@pytest.fixture
def batches() -> tuple[PickBatch, CurriculumPickBatch]:
    return PickBatch(CELL, 64, 7, SETTINGS), CurriculumPickBatch(CELL, 64, 7, SETTINGS)


def test_robots_start_on_the_path_to_the_target(batches) -> None:
    usual, near = batches
    usual.reset()
    near.starts = StartRange(0.2, 0.6)
    obs = near.reset().copy()
    far, goal, q = (one[:, :5] for one in (usual.state.q, near.state.q_goal, near.state.q))
    part = np.linalg.norm(q - goal, axis=1) / np.linalg.norm(far - goal, axis=1)
    np.testing.assert_allclose(q, goal + part[:, None] * (far - goal), atol=1e-12)
    assert (part > 0.2).all()
    assert 0.5 < part.mean() < 0.7  # (0.2 + 0.6 + 1) / 3 = 0.6
    assert (near.state.clear[:, 0] >= 0.05).all() and (near.state.clear[:, 1:] > 0.0).all()
    np.testing.assert_array_equal(obs[:, :6], near.state.q.astype(np.float32))
    for one, other in zip(near.state.people, usual.state.people, strict=True):
        if isinstance(one, np.ndarray):
            np.testing.assert_array_equal(one, other)


def test_measures_of_a_start_are_those_of_the_moved_robot(batches) -> None:
    usual, near = batches
    near.starts = StartRange(0.05, 0.05)
    near.reset()
    usual.reset()
    usual.set_starts(near.state.q.copy())
    for name in ("distance", "tilt", "clear", "robot", "time_left", "elapsed"):
        moved, expected = getattr(near.state, name), getattr(usual.state, name)
        np.testing.assert_array_equal(moved, expected)


def test_at_the_end_robots_start_as_without_a_curriculum(batches) -> None:
    usual, near = batches
    near.starts = StartRange(1.0, 1.0)
    np.testing.assert_array_equal(near.reset(), usual.reset())
    np.testing.assert_array_equal(near.state.clear, usual.state.clear)
