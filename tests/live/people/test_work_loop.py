"""A live person's work: smooth, endless, inside the limits, at the stations."""

import numpy as np
import pytest

from app.live.people.work_loop import WorkLoop
from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body

CELL = load_cell()


@pytest.mark.parametrize("stature", [5.0, 50.0, 95.0])
def test_work_goes_on_without_a_jump_inside_the_limits(stature: float) -> None:
    cycle, dt = WorkLoop(CELL, 3, percentile_body(stature), variants=3), 0.02
    states = [cycle.at(k * dt) for k in range(9000)]
    q, qd = (np.array(rows) for rows in zip(*states, strict=True))
    assert (q >= human.Q_MIN).all() and (q <= human.Q_MAX).all()
    # Two or more scripts follow one another in these three minutes.
    assert np.abs(np.diff(q, axis=0)).max() < 0.2
    slope = (q[2:] - q[:-2]) / (2.0 * dt)
    assert np.median(np.abs(slope - qd[1:-1])) < 1e-3
    assert np.percentile(np.abs(slope - qd[1:-1]), 99.9) < 0.25  # of finite differences


def test_the_palms_come_to_cubes_and_docks() -> None:
    size = percentile_body(95.0)
    cycle, vector = WorkLoop(CELL, 4, size, variants=4), size.vector(CELL.floor_z)
    palms = []
    for k in range(2400):
        points = human.joint_points(cycle.at(0.05 * k)[0], vector)
        palms += [points["hand_r"], points["hand_l"]]
    stations = [station.position for station in CELL.stations]
    gaps = np.linalg.norm(np.array(palms)[:, None] - stations, axis=2)
    assert (gaps.min(axis=0) < 0.1).sum() >= len(CELL.stations) - 2


def test_same_seed_works_alike_and_another_seed_does_not() -> None:
    one, two, three = (WorkLoop(CELL, seed, variants=2) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.at(7.3)[0], two.at(7.3)[0])
    assert not np.array_equal(one.at(8.0)[0], three.at(8.0)[0])
