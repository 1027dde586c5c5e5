"""Random configurations of the cell: where the kernels place robot and person, how far apart.

Beside the kernels' distances stand those of plain numpy, from Pinocchio's links and the person
of ``person_reference.py``.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.collision.fcl_recheck import robot_ends, segment_distances
from app.sim.core.arrays import Vec
from app.sim.geometry.capsules import distances
from app.sim.human import model as human
from app.sim.people.kernels.people import new_people_geometry, people_clearance, place_workers
from app.sim.robot.capsules import load_robot_capsules
from app.sim.robot.kernels.arm import Arm, new_robot_pose, place_robot
from app.sim.robot.ur10 import Robot
from app.sim.scene.scene import arm_of, people_of
from tests.sim.person_reference import capsule_ends

CELL = load_cell()
N, CHUNK = 20_000, 1000
RADII = load_robot_capsules().radius


def vertical_configuration(arm: Arm, target: Vec) -> Vec:
    """Return the configuration with the tool down at ``target`` [m], shape (0 or 1, 6)."""
    q = Robot(arm.lengths.tool).ik_vertical(target, arm.limits.q_min, arm.limits.q_max)
    return np.zeros((0, 6)) if q is None else q[None]


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


def chunk(number: int) -> Iterator[Case]:
    """CHUNK random configurations: the robot within its limits, the person in its reach."""
    arm, people = arm_of(CELL), people_of(CELL)
    rng = np.random.default_rng((55, number))
    q = rng.uniform(arm.limits.q_min, arm.limits.q_max, (CHUNK, 6))
    human_q = rng.uniform(human.Q_MIN, human.Q_MAX, (CHUNK, 18))
    human_q[:, :3] = rng.uniform([-0.7, 0.0, -np.pi], [0.7, 1.7, np.pi], (CHUNK, 3))
    robot_at = np.stack(robot_ends(Robot(), load_robot_capsules(), q), axis=2)
    person_at = capsule_ends(human_q, CELL.human.size, CELL.floor_z)
    expected = segment_distances(
        robot_at[:, :, None, 0],
        robot_at[:, :, None, 1],
        person_at[:, None, :, 0],
        person_at[:, None, :, 1],
    )
    expected = expected - RADII[:, None] - human.CAPSULE_RADII
    pose, geometry = new_robot_pose(arm), new_people_geometry(people, 1, 0)
    found = np.empty((len(RADII), geometry.capsules.shape[1]))
    for k in range(CHUNK):
        place_robot(arm, q[k], pose)
        place_workers(people, human_q[k : k + 1], geometry)
        clearance = people_clearance(people, pose.capsules, geometry)
        for i, row in enumerate(found):
            distances(pose.capsules, i, geometry.capsules, row)
        d = found[:, : len(human.CAPSULE_RADII)].copy()
        yield Case(robot_at[k], person_at[k], d, expected[k], clearance)


def configurations() -> Iterator[Case]:
    """All N of them."""
    for number in range(N // CHUNK):
        yield from chunk(number)
