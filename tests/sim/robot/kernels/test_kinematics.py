"""The compiled UR10 against Pinocchio on example-robot-data's model."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.collision.fcl_recheck import robot_ends
from app.sim.geometry.capsules import ends_of
from app.sim.robot.capsules import load_robot_capsules
from app.sim.robot.kernels import kinematics
from app.sim.robot.kernels.arm import new_robot_pose, place_robot
from app.sim.robot.ur10 import Robot
from app.sim.scene.scene import arm_of

N = 20_000
EXACT = 1e-9


def test_links_tcp_and_capsules_are_where_pinocchio_places_them() -> None:
    cell, robot, capsules = load_cell(), Robot(), load_robot_capsules()
    arm = arm_of(cell)
    pose, worst = new_robot_pose(arm), np.zeros(4)
    q = np.random.default_rng(52).uniform(arm.limits.q_min, arm.limits.q_max, (N, 6))
    p0, p1 = robot_ends(robot, capsules, q)
    for row, start, end in zip(q, p0, p1, strict=True):
        place_robot(arm, row, pose)
        links = robot.link_poses(row)
        ends = ends_of(pose.capsules, len(capsules.name))
        found = (
            np.abs(pose.rot - links[:, :3, :3]).max(),
            np.abs(pose.pos - links[:, :3, 3]).max(),
            np.abs(pose.tcp - robot.tcp_pose(row)[:3, 3]).max(),
            max(np.abs(ends[:, 0] - start).max(), np.abs(ends[:, 1] - end).max()),
        )
        worst = np.maximum(worst, found)
    assert worst.max() < EXACT


def test_jacobian_is_pinocchios() -> None:
    robot, arm = Robot(), arm_of(load_cell())
    pose = new_robot_pose(arm)
    for q in np.random.default_rng(53).uniform(arm.limits.q_min, arm.limits.q_max, (2000, 6)):
        place_robot(arm, q, pose)
        kinematics.tcp_jacobian(pose.rot, pose.pos, pose.tcp, pose.jacobian)
        assert np.abs(pose.jacobian - robot.jacobian(q)[:3]).max() < EXACT


def test_posture_with_the_tool_down_brings_pinocchios_tcp_to_the_target() -> None:
    robot, arm = Robot(), arm_of(load_cell())
    targets = np.random.default_rng(54).uniform([-1, -1, 0], [1, 1, 0.8], (4000, 3))
    postures, reached = kinematics.ik_vertical_batch(arm.lengths, arm.limits, targets)
    for target, q in zip(targets[reached], postures[reached], strict=True):
        pose = robot.tcp_pose(q)
        assert pose[:3, 3] == pytest.approx(target, abs=EXACT)
        assert pose[2, 2] == pytest.approx(-1.0, abs=EXACT)
        assert (q >= arm.limits.q_min).all() and (q <= arm.limits.q_max).all()
    assert 0.4 < reached.mean() < 0.95
