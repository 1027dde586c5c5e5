"""Clearances of several configurations at once, compared with configurations placed alone."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.core.arrays import Vec
from app.sim.core.jit import FAR
from app.sim.geometry.cylinder import cylinder_clearance
from app.sim.reach.kernels.observation_workspace import N_ASIDE, N_LOOKS
from app.sim.robot.kernels import configuration_lanes as kernel
from app.sim.robot.kernels.arm import new_robot_pose, place_robot
from app.sim.scene.scene import arm_of

ARM = arm_of(load_cell("shared-workspace"))
N = kernel.N_LANES


def alone(q: Vec, cylinders: Vec, top: float) -> Vec:
    """Return the clearance of each configuration, placed alone [m], shape (n,)."""
    pose, found = new_robot_pose(ARM), []
    for joints, (x, y, r) in zip(q, cylinders, strict=True):
        place_robot(ARM, joints, pose)
        found.append(cylinder_clearance(pose.capsules, 0, x, y, r, top)[0])
    return np.array(found)


def drawn(seed: int, n: int) -> tuple[Vec, Vec]:
    """Return configurations, shape (n, 6), and cylinders about the robot, shape (n, 3)."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(ARM.limits.q_min, ARM.limits.q_max, (n, 6))
    return q, rng.uniform([-1.5, -1.5, 0.2], [1.5, 1.5, 0.5], (n, 3))


def put(cylinders: Vec, lanes: Vec) -> None:
    for row, place in enumerate((kernel.AXIS_X, kernel.AXIS_Y, kernel.AXIS_R)):
        lanes[place : place + len(cylinders)] = cylinders[:, row]


def placed(q: Vec) -> Vec:
    """Return placed lanes."""
    lanes = kernel.new_lanes()
    for j in range(6):
        lanes[kernel.JOINTS + j * N :][: len(q)] = q[:, j]
    kernel.place_lanes(ARM.lengths, len(q), lanes)
    return lanes


def lowered(lanes: Vec, cylinders: Vec, top: float, within: float = FAR) -> Vec:
    put(cylinders, lanes)
    n = len(cylinders)
    kernel.measure_lanes(ARM, top, n, within, np.zeros(6), new_robot_pose(ARM), lanes)
    return lanes[kernel.CLEARANCE : kernel.CLEARANCE + n].copy()


@pytest.mark.parametrize("n", [1, 3, 8, N])
@pytest.mark.parametrize("top", [2.0, 1.3, 0.4])
def test_clearances_are_those_of_configurations_placed_alone(n: int, top: float) -> None:
    for seed in range(20):
        q, cylinders = drawn(seed, n)
        found = lowered(placed(q), cylinders, top)
        np.testing.assert_allclose(found, alone(q, cylinders, top), rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("within", [0.2, 0.4])
def test_clearances_beyond_a_limit_stay_beyond_it_and_others_are_exact(within: float) -> None:
    left_out = 0
    for seed in range(20):
        q, cylinders = drawn(seed, N)
        found, exact = lowered(placed(q), cylinders, 0.4, within), alone(q, cylinders, 0.4)
        np.testing.assert_allclose(
            found.clip(max=within), exact.clip(max=within), rtol=0.0, atol=1e-14
        )
        left_out += np.sum(exact > found + 1e-6)
    assert left_out > 0


def test_the_nearest_of_several_cylinders_counts() -> None:
    (q, first), (_, second) = drawn(1, N), drawn(2, N)
    lanes = placed(q)
    lowered(lanes, first, 1.3)
    nearest = np.minimum(alone(q, first, 1.3), alone(q, second, 1.3))
    np.testing.assert_allclose(lowered(lanes, second, 1.3), nearest, rtol=0.0, atol=1e-14)


def test_an_upright_segment_counts_from_its_lower_end() -> None:
    q = np.tile(ARM.home, (N, 1))
    q[:, 1:5] = np.linspace(-0.5 * np.pi, 0.5 * np.pi, N)[:, None]
    cylinders = np.tile([0.6, 0.4, 0.3], (N, 1))
    found = lowered(placed(q), cylinders, 1.3)
    np.testing.assert_allclose(found, alone(q, cylinders, 1.3), rtol=0.0, atol=1e-14)


def test_there_are_lanes_for_all_options_of_an_observation() -> None:
    assert N_ASIDE * N_LOOKS <= N


@pytest.mark.parametrize("within", [0.2, 0.4])
def test_clearances_above_a_limit_stay_above_it_and_others_are_exact(within: float) -> None:
    beyond = 0
    for seed in range(20):
        q, cylinders = drawn(seed, N)
        found, exact = lowered(placed(q), cylinders, 0.4, within), alone(q, cylinders, 0.4)
        np.testing.assert_allclose(found.clip(max=within), exact.clip(max=within), atol=1e-9)
        beyond += np.sum(exact - found > 1e-6)
    assert beyond > 0  # distances over the top that were left out
