"""Off-task motion: endless variety inside limits and paces, and a share of the people do it."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.human.anthropometry import MEDIAN
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.people.off_task_motion import BACK, DEEPEST, TRACK_S, off_task_motions
from app.sim.pick.batch import PickBatch, PickSettings

CELL = load_cell()
SIZE = MEDIAN.vector(CELL.floor_z)


def test_they_stay_inside_limits_area_and_paces() -> None:
    area = CELL.human
    for motion in off_task_motions(CELL, MEDIAN, 7, 3):
        q, dt = motion.q, float(motion.times[1])
        assert motion.times[-1] == pytest.approx(TRACK_S, abs=0.1)
        assert (q >= human.Q_MIN).all() and (q <= human.Q_MAX).all()
        assert (q[:, 0] >= area.x_min).all() and (q[:, 0] <= area.x_max).all()
        assert (q[:, 1] >= area.y_min).all() and (q[:, 1] <= area.y_max + BACK).all()
        palms = np.array([human.joint_points(row, SIZE)["hand_r"] for row in q[::5]])
        speed = np.linalg.norm(np.diff(palms, axis=0), axis=1) / (5 * dt)
        # Minimum jerk peaks at 15/8 of the mean pace; walking and turning add to it.
        assert 0.3 < speed.max() < 5.0
        assert (speed < 0.02).mean() > 0.15


def test_hands_come_over_the_whole_reach_of_the_table() -> None:
    table, found = CELL.table, []
    for motion in off_task_motions(CELL, MEDIAN, 8, 4):
        for row in motion.q[::25]:
            found.extend(human.palms(row, SIZE))
    palms = np.array(found)
    over = palms[(palms[:, 1] < table.y_max) & (palms[:, 2] > 0.0)]
    assert len(over) > 0.15 * len(palms)
    assert over[:, 1].min() < table.y_max - 0.6 * DEEPEST
    assert np.ptp(over[:, 0]) > 1.0 and np.ptp(over[:, 2]) > 0.3


def test_same_seed_moves_alike_and_another_does_not() -> None:
    one, two, other = (off_task_motions(CELL, MEDIAN, seed, 1)[0].q for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, two)
    assert one.shape != other.shape or not np.array_equal(one, other)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_the_asked_share_of_people_is_off_task(share: float) -> None:
    batch = PickBatch(CELL, 400, 5, PickSettings(work=HumanMotionConfig(off_task=share)))
    batch.reset()
    found = (batch.state.people.track >= 0).mean()
    assert abs(found - share) < 4.0 * np.sqrt(share * (1.0 - share) / 400) + 1e-9
    sizes = batch.state.people.size[batch.state.people.track >= 0]
    assert share == 0.0 or len(np.unique(sizes.round(6), axis=0)) > 1


def test_a_share_that_is_none_is_refused() -> None:
    with pytest.raises(InvalidInput, match="off_task"):
        HumanMotionConfig(off_task=1.5)
