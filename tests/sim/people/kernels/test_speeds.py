"""Speeds of a worker's capsules: hand-computed motions, and differences of the kinematics."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.scene.scene import capsule_speeds_of, people_geometry_of, people_of

CELL = load_cell()
SHARED = people_of(CELL)
NO_CYLINDERS = np.zeros((0, 3))


def speeds(q: np.ndarray, qd: np.ndarray) -> np.ndarray:
    """Speeds of the twelve capsules of one worker of the cell's size [m/s]."""
    placed = people_geometry_of(SHARED, q[None], NO_CYLINDERS)
    return capsule_speeds_of(SHARED, placed, q[None], qd[None])[:12]


def test_a_walking_person_moves_all_capsules_alike() -> None:
    qd = np.zeros(18)
    qd[:2] = 0.6, -0.8
    assert speeds(human.rest_posture(0.3, 1.4, -1.2), qd) == pytest.approx(1.0)


def test_a_turning_person_s_capsules_are_as_fast_as_their_farther_end() -> None:
    q, qd = human.rest_posture(0.3, 1.4, -1.2), np.zeros(18)
    qd[2] = 2.0
    ends = human.capsules(q, CELL.body, CELL.floor_z)
    radius = np.hypot(ends[..., 0] - q[0], ends[..., 1] - q[1]).max(axis=1)
    assert speeds(q, qd) == pytest.approx(2.0 * radius, rel=1e-5, abs=1e-9)


def test_speeds_are_differences_of_the_kinematics_and_bound_all_points() -> None:
    rng, step = np.random.default_rng(4), 1e-6
    for _ in range(200):
        q = rng.uniform(human.Q_MIN, human.Q_MAX)
        qd = rng.uniform(-50.0, 50.0, 18)
        before, after = (
            human.capsules(q + at * qd, CELL.body, CELL.floor_z) for at in (-step, step)
        )
        found = speeds(q, qd)
        ends = np.linalg.norm(after - before, axis=2).max(axis=1) / (2.0 * step)
        assert found == pytest.approx(ends, rel=3e-3, abs=0.01)
        for part in np.linspace(0.0, 1.0, 5):
            point = [a[:, 0] + part * (a[:, 1] - a[:, 0]) for a in (before, after)]
            speed = np.linalg.norm(point[1] - point[0], axis=1) / (2.0 * step)
            assert (speed <= ends + 1e-6).all()
