"""Bounds and clearances of the robot in its cell, against finite differences."""

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.geometry.capsules import ends_of
from app.sim.robot.kernels import arm as kernel
from app.sim.robot.kernels.joints import JointPath
from app.sim.robot.ur10 import Robot
from app.sim.scene.scene import arm_of


@pytest.mark.parametrize("degree", [2, 3])
def test_speed_bound_holds_for_every_point_of_the_robot(degree: int) -> None:
    rng, arm = np.random.default_rng(64), arm_of(load_cell())
    before, after = kernel.new_robot_pose(arm), kernel.new_robot_pose(arm)
    now, soon, tick = kernel.new_robot_pose(arm), kernel.new_robot_pose(arm), 1e-5
    for _ in range(300):
        q, qd = (
            rng.uniform(arm.limits.q_min, arm.limits.q_max),
            rng.uniform(-arm.limits.qd_max, arm.limits.qd_max),
        )
        c = rng.uniform(-0.5, 0.5, 6) * arm.limits.qdd_max
        d = rng.uniform(-1, 1, 6) * arm.limits.jerk_max / 6.0 * (degree == 3)

        def at(x: float) -> np.ndarray:
            return q + x * (qd + x * (c + x * d))  # noqa: B023

        kernel.place_robot(arm, q, before)
        kernel.place_robot(arm, at(arm.dt), after)
        bound = kernel.robot_speed_bound(
            arm, JointPath(q, qd, c, d), before.capsules, after.capsules
        )
        for x in np.linspace(0.0, arm.dt, 9):
            kernel.place_robot(arm, at(x), now)
            kernel.place_robot(arm, at(x + tick), soon)
            moved = ends_of(soon.capsules, 12) - ends_of(now.capsules, 12)
            assert np.linalg.norm(moved, axis=2).max() / tick <= bound + 1e-4


def test_tool_speed_and_tilt_are_those_of_pinocchio() -> None:
    rng, arm, robot = np.random.default_rng(65), arm_of(load_cell()), Robot()
    pose = kernel.new_robot_pose(arm)
    for _ in range(50):
        q, qd = rng.uniform(-3, 3, 6), rng.uniform(-1, 1, 6)
        kernel.place_robot(arm, q, pose)
        speed = np.linalg.norm((robot.jacobian(q) @ qd)[:3])
        assert kernel.tcp_speed(pose, qd) == pytest.approx(speed, abs=1e-6)
        down = -robot.tcp_pose(q)[2, 2]
        assert np.cos(kernel.robot_tilt(pose)) == pytest.approx(down, abs=1e-6)
