"""The compiled kinematics against Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest

from app.sim.cells.cell import load_cell
from app.sim.robot.kernels import kinematics
from app.sim.robot.ur10 import LINK_NAMES, Robot, reach_of, urdf_path


@pytest.fixture(scope="module")
def robot() -> Robot:
    return Robot()


def postures(n: int) -> np.ndarray:
    return np.random.default_rng(31).uniform(-6.2, 6.2, (n, 6))


def test_kernel_link_poses_equal_pinocchios_to_a_nanometre(robot: Robot) -> None:
    rot, pos, tcp = np.empty((7, 3, 3)), np.empty((7, 3)), np.empty(3)
    for q in postures(500):
        kinematics.link_poses(robot.lengths(), q, rot, pos)
        kinematics.tcp_point(robot.lengths(), rot, pos, tcp)
        expected = robot.link_poses(q)
        np.testing.assert_allclose(pos, expected[:, :3, 3], atol=1e-9)
        np.testing.assert_allclose(rot, expected[:, :3, :3], atol=1e-9)
        np.testing.assert_allclose(tcp, robot.tcp_pose(q)[:3, 3], atol=1e-9)


def test_kernel_jacobian_equals_pinocchios(robot: Robot) -> None:
    rot, pos, tcp, jacobian = (
        np.empty((7, 3, 3)),
        np.empty((7, 3)),
        np.empty(3),
        np.empty((3, 6)),
    )
    for q in postures(200):
        kinematics.link_poses(robot.lengths(), q, rot, pos)
        kinematics.tcp_point(robot.lengths(), rot, pos, tcp)
        kinematics.tcp_jacobian(rot, pos, tcp, jacobian)
        np.testing.assert_allclose(jacobian, robot.jacobian(q)[:3], atol=1e-9)


def test_jacobian_is_the_derivative_of_the_tcp(robot: Robot) -> None:
    q, step = postures(1)[0], 1e-6
    for joint in range(6):
        ahead, behind = q.copy(), q.copy()
        ahead[joint] += step
        behind[joint] -= step
        slope = (robot.tcp_pose(ahead) - robot.tcp_pose(behind))[:3, 3] / (2 * step)
        np.testing.assert_allclose(robot.jacobian(q)[:3, joint], slope, atol=1e-8)


def test_tool0_at_zero_is_where_the_urdf_says(robot: Robot) -> None:
    tip = Robot(0.0).tcp_pose(np.zeros(6))
    np.testing.assert_allclose(tip[:3, 3], [1.1843, 0.2561, 0.0116], atol=1e-4)
    np.testing.assert_allclose(
        robot.tcp_pose(np.zeros(6))[:3, 3], tip[:3, 3] + 0.12 * tip[:3, 2], atol=1e-9
    )


@pytest.mark.parametrize("tool", [0.0, 0.12, 0.4])
def test_reach_is_the_largest_distance_of_the_tcp_from_the_shoulder(tool: float) -> None:
    robot = Robot(tool)
    center, radius = reach_of(robot.lengths())
    wrists = np.linspace(-np.pi, np.pi, 60)
    stretched = [np.array([0.0, 0.0, 0.0, a, b, 0.0]) for a in wrists for b in wrists]
    found = [robot.tcp_pose(q)[:3, 3] for q in [*postures(500), *stretched]]
    distances = np.linalg.norm(np.array(found) - center, axis=1)
    assert radius - 1e-3 < distances.max() <= radius + 1e-9


def test_link_names_are_frames_of_the_urdf() -> None:
    model = pin.buildModelFromUrdf(str(urdf_path()))
    assert all(model.existFrame(name) for name in LINK_NAMES)


def test_vertical_posture_points_the_tool_down_at_the_target(robot: Robot) -> None:
    mount = load_cell().robot
    limits = np.array(mount.q_min), np.array(mount.q_max)
    targets = np.random.default_rng(32).uniform([-0.9, 0.3, 0.0], [0.9, 0.9, 0.5], (300, 3))
    solutions = [(target, robot.ik_vertical(target, *limits)) for target in targets]
    solved = [(target, q) for target, q in solutions if q is not None]
    assert len(solved) > 250
    for target, q in solved:
        pose = robot.tcp_pose(q)
        np.testing.assert_allclose(pose[:3, 3], target, atol=1e-9)
        np.testing.assert_allclose(pose[:3, 2], [0, 0, -1], atol=1e-9)
        assert (q >= mount.q_min).all() and (q <= mount.q_max).all()


@pytest.mark.parametrize("target", [[0.0, 2.0, 0.1], [0.0, 0.05, 0.1], [0.0, 0.0, 0.0]])
def test_no_vertical_posture_exists_where_the_arm_cannot_reach(
    robot: Robot, target: list[float]
) -> None:
    mount = load_cell().robot
    limits = np.array(mount.q_min), np.array(mount.q_max)
    assert robot.ik_vertical(np.array(target), *limits) is None
