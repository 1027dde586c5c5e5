"""Distances of robot and person in 20,000 random configurations of the cell.

Every one of the 144 pairs is held against plain numpy. python-fcl is asked about all of them in
the first 1000 configurations and about the nearest one in all; the slow test asks it about all
of them in all. FCL's search for distances ends early on round bodies; ``fcl_capsules.py`` says
what is asked instead there.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pytest

from app.sim import human
from app.sim.cells import load_cell
from app.sim.collision import make_capsule
from app.sim.kernels.arm import new_robot_pose, place_robot
from app.sim.kernels.columns import distances
from app.sim.kernels.people import new_crowd, people_clearance, place_workers
from app.sim.recheck import robot_ends, segment_distances
from app.sim.robot import Robot
from app.sim.scene import arm_of, people_of
from app.sim.shapes import load_robot_capsules
from tests.sim.fcl_capsules import check_against_fcl
from tests.sim.person_reference import capsule_ends

CELL = load_cell()
N, CHUNK = 20_000, 1000
EXACT = 1e-6


class Case(NamedTuple):
    """One configuration: ends of all capsules and the kernels' distances."""

    robot: np.ndarray
    """Ends by Pinocchio [m], shape (12, 2, 3)."""
    person: np.ndarray
    """Ends by plain numpy [m], shape (12, 2, 3)."""
    d: np.ndarray
    """Distances by the kernels [m], shape (12, 12)."""
    expected: np.ndarray
    """Distances by plain numpy [m], shape (12, 12)."""
    clearance: float
    """What the kernels report as least [m]."""


RADII = load_robot_capsules().radius


def chunk(number: int) -> Iterator[Case]:
    """CHUNK random configurations: the robot within its limits, the person in its reach."""
    arm, people = arm_of(CELL), people_of(CELL)
    rng = np.random.default_rng((55, number))
    q = rng.uniform(arm.q_min, arm.q_max, (CHUNK, 6))
    human_q = rng.uniform(human.Q_MIN, human.Q_MAX, (CHUNK, 18))
    human_q[:, :3] = rng.uniform([-0.7, 0.0, -np.pi], [0.7, 1.7, np.pi], (CHUNK, 3))
    robot_at = np.stack(robot_ends(Robot(), load_robot_capsules(), q), axis=2)
    person_at = capsule_ends(human_q, CELL.pelvis_z, CELL.floor_z)
    expected = segment_distances(
        robot_at[:, :, None, 0],
        robot_at[:, :, None, 1],
        person_at[:, None, :, 0],
        person_at[:, None, :, 1],
    )
    expected = expected - RADII[:, None] - human.CAPSULE_RADII
    pose, crowd = new_robot_pose(arm), new_crowd(people, 1, 0)
    found = np.empty((len(RADII), crowd.columns.shape[1]))
    for k in range(CHUNK):
        place_robot(arm, q[k], pose)
        place_workers(people, human_q[k : k + 1], crowd)
        clearance = people_clearance(people, pose.columns, crowd)
        for i, row in enumerate(found):
            distances(pose.columns, i, crowd.columns, row)
        d = found[:, : len(human.CAPSULE_RADII)].copy()
        yield Case(robot_at[k], person_at[k], d, expected[k], clearance)


def configurations() -> Iterator[Case]:
    """All N of them."""
    for number in range(N // CHUNK):
        yield from chunk(number)


def ask_fcl(case: Case, i: int, j: int) -> None:
    """Hold the distance of one pair against FCL: value where apart, verdict where not."""
    radius = float(human.CAPSULE_RADII[j])
    body = make_capsule(radius, *case.person[j])
    check_against_fcl(case.robot[i], float(RADII[i]), body, float(case.d[i, j]))


def test_all_pairs_are_as_far_apart_as_plain_numpy_says_and_the_least_is_reported() -> None:
    worst, n_overlap = 0.0, 0
    for case in configurations():
        worst = max(worst, np.abs(case.d - case.expected).max())
        assert case.clearance == pytest.approx(case.d.min(), abs=1e-12)
        n_overlap += case.clearance < 0.0
    assert worst < EXACT
    assert 0.1 * N < n_overlap < 0.5 * N


def test_all_pairs_of_the_first_configurations_are_as_fcl_says() -> None:
    for case in chunk(0):
        for i, j in np.ndindex(case.d.shape):
            ask_fcl(case, i, j)


@pytest.mark.slow
def test_all_pairs_of_all_configurations_are_as_fcl_says() -> None:
    for case in configurations():
        for i, j in np.ndindex(case.d.shape):
            ask_fcl(case, i, j)


def test_nearest_pair_of_every_configuration_is_as_fcl_says() -> None:
    for case in configurations():
        i, j = np.unravel_index(case.d.argmin(), case.d.shape)
        ask_fcl(case, int(i), int(j))
