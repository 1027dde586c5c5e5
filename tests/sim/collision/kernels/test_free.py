"""Free poses and motions: never late between poses."""

from dataclasses import replace

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.collision.checker import Shapes, capsule_shapes, no_people
from app.sim.collision.kernels import free
from app.sim.geometry.capsules import ends_of
from app.sim.robot.kernels import arm as arm_kernel
from app.sim.robot.kernels.arm import Arm
from app.sim.scene.scene import arm_of


@pytest.fixture(scope="module")
def arm() -> Arm:
    return arm_of(load_cell())


def around(people: Shapes, margin: float = 0.0, cell_margin: float = 0.0) -> free.Obstacles:
    gap, work = np.empty(people.capsules.shape[1]), np.empty((3, 6))
    return free.Obstacles(people.capsules, gap, people.cylinders, margin, cell_margin, *work)


def some_people(rng: np.random.Generator) -> free.Obstacles:
    """Three short capsules and a cylinder somewhere in the robot's reach."""
    start = rng.uniform([-0.8, 0.2, 0.1], [0.8, 1.0, 0.9], size=(3, 3))
    ends = np.stack([start, start + rng.uniform(-0.3, 0.3, size=(3, 3))], axis=1)
    tube = [*rng.uniform([-0.8, 0.5], [0.8, 1.0]), 0.1, rng.uniform(0.2, 0.9)]
    people = replace(capsule_shapes(ends, np.full(3, 0.06)), cylinders=np.array([tube]))
    return around(people, 0.03, 0.002)


def test_free_motions_have_slack_everywhere(arm: Arm) -> None:
    rng = np.random.default_rng(1)
    pose, verdicts = arm_kernel.new_robot_pose(arm), []
    for _ in range(400):
        people = some_people(rng)
        q0 = arm.home + rng.uniform(-0.5, 0.5, 6)
        qd0, c = rng.uniform(-1.0, 1.0, 6), rng.uniform(-1.0, 1.0, 6)
        verdict, _ = free.motion_free(arm, q0, qd0, c, 0.8, people, pose)
        verdicts.append(verdict)
        if verdict:
            slacks = [
                free.spare_clearance(arm, q0 + qd0 * x + c * x * x, people, pose)
                for x in np.linspace(0.0, 0.8, 200)
            ]
            assert min(slacks) > 0.0
    assert 40 < sum(verdicts) < 360


def test_motions_far_from_everything_take_few_poses(arm: Arm) -> None:
    no_one = around(no_people())
    pose = arm_kernel.new_robot_pose(arm)
    up = np.array([0.0, -1.57, 0.0, -1.57, 0.0, 0.0])
    verdict, looked = free.edge_free(arm, up, up + 0.01, no_one, pose)
    assert verdict and looked <= 6


def test_first_blocked_period_is_where_the_person_stands(arm: Arm) -> None:
    turn = np.zeros((81, 6)) + arm.home
    turn[:, 0] += np.linspace(0.0, 2.0, 81)
    qd = np.zeros((81, 6))
    qd[:, 0] = (turn[1, 0] - turn[0, 0]) / arm.dt
    pose = arm_kernel.new_robot_pose(arm)
    no_one = around(no_people())
    free.clearances_at(arm, turn[30], no_one, pose)
    tool = ends_of(pose.capsules[:, -1:], 1)
    person = around(capsule_shapes(tool, np.array([0.02])))
    assert free.first_blocked(arm, turn, qd, arm.dt, 0, no_one, pose) == 80
    assert 15 < free.first_blocked(arm, turn, qd, arm.dt, 0, person, pose) <= 30
    assert free.first_blocked(arm, turn, qd, arm.dt, 78, person, pose) == 80
