"""Goal postures reach their target, inside the limits, and differ."""

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.planning.goal_configurations import APART, goal_configurations
from app.sim.robot.ur10 import Robot
from app.sim.scene.scene import arm_of
from tests.sim.configurations import vertical_configuration

CELL = load_cell()
ARM = arm_of(CELL)
TARGET = np.array(CELL.station("cube2").position)


def test_postures_reach_the_target_inside_the_limits_and_differ() -> None:
    robot = Robot(ARM.lengths.tool)
    postures = goal_configurations(ARM, TARGET, np.random.default_rng(0))
    assert len(postures) >= 4
    assert np.all((postures >= ARM.limits.q_min) & (postures <= ARM.limits.q_max))
    for k, q in enumerate(postures):
        assert np.linalg.norm(robot.tcp_pose(q)[:3, 3] - TARGET) <= 1e-4
        assert all(np.abs(q - other).max() > APART for other in postures[:k])


def test_a_spread_stays_within_its_radius_and_is_used() -> None:
    robot = Robot(ARM.lengths.tool)
    postures = goal_configurations(ARM, TARGET, np.random.default_rng(0), spread=0.05)
    misses = [np.linalg.norm(robot.tcp_pose(q)[:3, 3] - TARGET) for q in postures]
    assert max(misses) <= 0.0502
    assert np.mean(misses) > 0.02


def test_ranges_beyond_half_a_turn_are_searched() -> None:
    low, high = ARM.limits.q_min.copy(), ARM.limits.q_max.copy()
    low[3], high[3] = 3.3, 6.28
    home = np.array(ARM.home)
    home[3] = 5.0
    turned = ARM._replace(limits=ARM.limits._replace(q_min=low, q_max=high), home=home)
    found = goal_configurations(turned, TARGET, np.random.default_rng(0))
    assert len(found) and ((found >= low) & (found <= high)).all()


def test_out_of_reach_gives_no_posture() -> None:
    far = np.array([0.0, 2.5, 0.3])
    assert goal_configurations(ARM, far, np.random.default_rng(0)).shape == (0, 6)
    assert vertical_configuration(ARM, far).shape == (0, 6)


def test_the_vertical_posture_points_down() -> None:
    (q,) = vertical_configuration(ARM, TARGET)
    assert Robot(ARM.lengths.tool).tcp_pose(q)[2, 2] < -1.0 + 1e-9
