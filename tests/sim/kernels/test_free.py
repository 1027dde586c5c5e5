"""Free poses and motions: exact distances to cylinders, never late between poses."""

import fcl
import numpy as np
import pytest

from app.sim.cells import load_cell
from app.sim.kernels import arm as arm_kernel
from app.sim.kernels import free
from app.sim.kernels.arm import Arm
from app.sim.pick import arm_of

FLOOR = -3.0


@pytest.fixture(scope="module")
def arm() -> Arm:
    return arm_of(load_cell())


def some_people(rng: np.random.Generator) -> free.Around:
    """Three short capsules and a cylinder somewhere in the robot's reach."""
    start = rng.uniform([-0.8, 0.2, 0.1], [0.8, 1.0, 0.9], size=(3, 3))
    ends = np.stack([start, start + rng.uniform(-0.3, 0.3, size=(3, 3))], axis=1)
    tube = [*rng.uniform([-0.8, 0.5], [0.8, 1.0]), 0.1, rng.uniform(0.2, 0.9)]
    return free.Around(ends, np.full(3, 0.06), np.array([tube]), 0.03, 0.002)


def test_gap_to_a_cylinder_is_that_of_fcl() -> None:
    rng = np.random.default_rng(0)
    for _ in range(300):
        ends = rng.uniform(-1.0, 1.0, size=(2, 3))
        x, y, radius, top = rng.uniform([-1, -1, 0.05, -0.5], [1, 1, 0.4, 0.5])
        cylinder = np.array([x, y, radius, top])
        body = fcl.CollisionObject(
            fcl.Cylinder(radius, top - FLOOR),
            fcl.Transform(np.array([x, y, 0.5 * (top + FLOOR)])),
        )
        points = [fcl.CollisionObject(fcl.Sphere(0.02), fcl.Transform(p)) for p in sample(ends)]
        nearest = min(fcl.distance(point, body) for point in points)
        gap = free.cylinder_gap(ends, 0.02, cylinder)
        if nearest > 0.0:
            assert nearest - 0.002 <= gap <= nearest + 1e-5
        else:
            assert gap <= 1e-5


def sample(ends: np.ndarray) -> np.ndarray:
    """Points along a segment, near enough that 2 mm bound what lies between them."""
    return ends[0] + np.linspace(0.0, 1.0, 701)[:, None] * (ends[1] - ends[0])


def test_free_motions_have_slack_everywhere(arm: Arm) -> None:
    rng = np.random.default_rng(1)
    pose, verdicts = arm_kernel.new_pose(len(arm.link)), []
    for _ in range(400):
        around = some_people(rng)
        q0 = arm.home + rng.uniform(-0.5, 0.5, 6)
        qd0, c = rng.uniform(-1.0, 1.0, 6), rng.uniform(-1.0, 1.0, 6)
        verdict, _ = free.motion_free(arm, q0, qd0, c, 0.8, around, pose)
        verdicts.append(verdict)
        if verdict:
            slacks = [
                free.slack_at(arm, q0 + qd0 * x + c * x * x, around, pose)
                for x in np.linspace(0.0, 0.8, 200)
            ]
            assert min(slacks) > 0.0
    assert 40 < sum(verdicts) < 360


def test_motions_far_from_everything_take_few_poses(arm: Arm) -> None:
    nobody = free.Around(np.zeros((0, 2, 3)), np.zeros(0), np.zeros((0, 4)), 0.0, 0.0)
    pose = arm_kernel.new_pose(len(arm.link))
    up = np.array([0.0, -1.57, 0.0, -1.57, 0.0, 0.0])
    verdict, looked = free.edge_free(arm, up, up + 0.01, nobody, pose)
    assert verdict and looked <= 6


def test_first_blocked_period_is_where_the_person_stands(arm: Arm) -> None:
    turn = np.zeros((81, 6)) + arm.home
    turn[:, 0] += np.linspace(0.0, 2.0, 81)
    qd = np.zeros((81, 6))
    qd[:, 0] = (turn[1, 0] - turn[0, 0]) / arm.dt
    pose = arm_kernel.new_pose(len(arm.link))
    nobody = free.Around(np.zeros((0, 2, 3)), np.zeros(0), np.zeros((0, 4)), 0.0, 0.0)
    free.gaps_at(arm, turn[30], nobody, pose)
    tool = pose.robot[-1].copy()
    person = free.Around(tool[None], np.array([0.02]), np.zeros((0, 4)), 0.0, 0.0)
    assert free.first_blocked(arm, turn, qd, arm.dt, 0, nobody, pose) == 80
    assert 15 < free.first_blocked(arm, turn, qd, arm.dt, 0, person, pose) <= 30
    assert free.first_blocked(arm, turn, qd, arm.dt, 78, person, pose) == 80
