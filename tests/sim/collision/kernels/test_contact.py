"""The contact test may be early, never late: compared with FCL on the raw meshes."""

import numpy as np
import pytest

from app.sim.cells.cell import Cell, load_cell
from app.sim.collision.contact import clearance, contact
from app.sim.collision.fcl_recheck import Recheck, Trajectory
from app.sim.human import model as human
from app.sim.robot.kernels.joints import JointPath
from app.sim.robot.ur10 import Robot
from app.sim.scene.scene import NO_CYLINDERS, arm_of, people_of, with_people
from tests.sim.mesh_reference import MeshReference

SUBSTEPS = 50
"""Rows per period of 50 ms: the referee looks every millisecond."""
EARLY = 0.03
"""How far a reported contact may be from the meshes [m]: what capsules add to them."""


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell()


@pytest.fixture(scope="module")
def recheck(cell: Cell) -> Recheck:
    return Recheck(cell)


class Period:
    """One control period: robot state and coefficients, person before and after."""

    def __init__(
        self, cell: Cell, rng: np.random.Generator, robot: Robot, hurry: float
    ) -> None:
        mount = cell.robot
        limits = np.array(mount.q_min), np.array(mount.q_max)
        speed, dt = np.array(mount.qd_max), mount.dt
        target = rng.uniform([-0.7, 0.4, 0.05], [0.7, 0.85, 0.4])
        q = robot.ik_vertical(target, *limits)
        assert q is not None
        self.q = np.clip(q + rng.normal(0.0, 0.15, 6), *limits)
        self.qd = rng.uniform(-speed, speed)
        first, last = rng.uniform(-1, 1, (2, 6)) * mount.qdd_max
        self.c, self.d, self.dt = first / 2.0, (last - first) / (6.0 * dt), dt
        rest = human.rest_posture(rng.uniform(-0.5, 0.5), rng.uniform(1.12, 1.3), -1.57)
        hand, near = rng.choice(["r", "l"]), robot.tcp_pose(self.q)[:3, 3]
        target = near + rng.normal(0.0, 0.15, 3)
        self.human0 = human.reach(hand, target, rest, cell.body).q
        step = rng.normal(size=18) * hurry * dt
        self.human1 = np.clip(self.human0 + step, human.Q_MIN, human.Q_MAX)

    @property
    def path(self) -> JointPath:
        """The robot's path."""
        return JointPath(self.q, self.qd, self.c, self.d)

    def pose_at(self, x: float | np.ndarray) -> np.ndarray:
        """The robot's joints at a time of the period, or at several in a column."""
        return np.asarray(self.q + x * (self.qd + x * (self.c + x * self.d)))

    def rows(self, n: int) -> Trajectory:
        """The period as the robot and the person really move, n + 1 rows."""
        x = np.linspace(0.0, self.dt, n + 1)[:, None]
        return Trajectory(
            q_robot=self.pose_at(x),
            q_human=self.human0 + (self.human1 - self.human0) * x / self.dt,
        )


@pytest.mark.parametrize("hurry", [1.0, 3.0, 10.0])
def test_sweep_is_never_later_than_the_meshes_at_millisecond_substeps(
    cell: Cell, recheck: Recheck, hurry: float
) -> None:
    rng, robot, arm = np.random.default_rng(61), Robot(), arm_of(cell)
    people, verdicts = people_of(cell), []
    for _ in range(250):
        period = Period(cell, rng, robot, hurry)
        human_q = period.human0[None], period.human1[None]
        found = contact(arm, people, period.path, human_q)
        touches = recheck.first_contact(period.rows(SUBSTEPS)) is not None
        assert not (touches and found.kind == "none")
        verdicts.append((found.kind != "none", touches))
    reported, touching = np.mean(verdicts, axis=0)
    assert 0.1 < touching <= reported < touching + 0.2


def test_pose_test_reports_every_contact_of_the_meshes_in_random_postures(cell: Cell) -> None:
    rng, arm, reference = np.random.default_rng(62), arm_of(cell), MeshReference(cell)
    people, kinds = people_of(cell), {"human": 0, "cell": 0, "self": 0}
    for _ in range(1500):
        q = rng.uniform(arm.limits.q_min, arm.limits.q_max)
        human_q = rng.uniform(human.Q_MIN, human.Q_MAX)
        human_q[:3] = rng.uniform([-0.7, 0.6, -np.pi], [0.7, 1.7, np.pi])
        free = clearance(arm, people, q, human_q[None], NO_CYLINDERS)
        below = {
            "human": free.people_m <= 0.0,
            "cell": free.cell_m <= 0.0,
            "self": free.self_m <= 0.0,
        }
        for touch in reference.contacts(q, human_q):
            kinds[touch.kind] += 1
            assert below[touch.kind], touch
    assert min(kinds.values()) > 50


def test_clearance_is_that_of_hulls_less_what_capsules_add(cell: Cell) -> None:
    rng, robot, arm = np.random.default_rng(63), Robot(), arm_of(cell)
    reference, people, gaps = MeshReference(cell, "hull"), people_of(cell), []
    for _ in range(150):
        period = Period(cell, rng, robot, 1.0)
        free = clearance(arm, people, period.q, period.human0[None], NO_CYLINDERS).people_m
        if free > 0.0:
            gaps.append(reference.distance(period.q, period.human0) - free)
    assert len(gaps) > 50
    assert min(gaps) > -0.02
    assert np.mean(gaps) < EARLY


def test_standing_still_at_home_reports_no_contact_and_the_distance(cell: Cell) -> None:
    arm, people, zero = arm_of(cell), people_of(cell), np.zeros(6)
    human_q = human.rest_posture(*cell.human.home)[None]
    found = contact(arm, people, JointPath(arm.home, zero, zero, zero), (human_q, human_q))
    assert found.kind == "none"
    hull = MeshReference(cell, "hull").distance(arm.home, human_q[0])
    assert found.clearance_m <= hull < found.clearance_m + EARLY


def test_sweep_beside_walkers_is_never_later_than_poses_every_millisecond(cell: Cell) -> None:
    cell = with_people(cell, ("walker", "walker"))
    rng, robot, arm, people = np.random.default_rng(66), Robot(), arm_of(cell), people_of(cell)
    no_worker, verdicts = np.zeros((0, 18)), []
    for _ in range(300):
        period = Period(cell, rng, robot, 1.0)
        at = np.column_stack([rng.uniform(-0.9, 0.9, 2), rng.uniform(0.5, 1.6, 2)])
        before = np.column_stack([at, rng.uniform(0.2, 0.5, 2)])
        after = before + rng.uniform(-1.0, 1.0, (2, 3)) * [0.1, 0.1, 0.03]
        found = contact(arm, people, period.path, (no_worker, no_worker), (before, after))
        touches = False
        parts = np.linspace(0.0, 1.0, SUBSTEPS + 1)
        for part, q in zip(parts, period.rows(SUBSTEPS).q_robot, strict=True):
            free = clearance(arm, people, q, no_worker, before + part * (after - before))
            touches = touches or min(free.people_m, free.cell_m, free.self_m) <= 0.0
        assert not (touches and found.kind == "none")
        cylinders = before + found.time_s / period.dt * (after - before)
        there = clearance(arm, people, period.pose_at(found.time_s), no_worker, cylinders)
        assert found.clearance_m == pytest.approx(there.people_m, abs=1e-9)
        verdicts.append((found.kind != "none", touches))
    reported, touching = np.mean(verdicts, axis=0)
    assert 0.1 < touching <= reported < touching + 0.02
