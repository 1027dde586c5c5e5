"""The MuJoCo peer measures what the kernels measure, or the comparison means nothing."""

from collections.abc import Iterator

import numpy as np
import pytest

from app.sim.cells.cell import load_cell
from app.sim.geometry.capsules import distances, pair_distances
from app.sim.human import model as human
from app.sim.robot.kernels.arm import (
    FIRST_OVER_TABLE,
    new_robot_pose,
    place_robot,
    table_clearance,
)
from app.sim.scene.scene import arm_of, people_geometry_of, people_of
from tests.benchmarks.peers.mujoco_pick import INSTALLED, MujocoPick

pytestmark = pytest.mark.skipif(not INSTALLED, reason="MuJoCo comes with the dev extra")
CELL = load_cell()
N = 300


def postures() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(5)
    q = rng.uniform(CELL.robot.q_min, CELL.robot.q_max, (N, 6))
    human_q = rng.uniform(human.Q_MIN, human.Q_MAX, (N, 18))
    human_q[:, :3] = rng.uniform([-0.7, 0.6, -np.pi], [0.7, 1.7, np.pi], (N, 3))
    return q, human_q


def by_kernels(q: np.ndarray, human_q: np.ndarray) -> Iterator[np.ndarray]:
    """Distances in the peer's order: with the person, with itself; the table's least."""
    arm, people = arm_of(CELL), people_of(CELL)
    robot = new_robot_pose(arm)
    for robot_q, person_q in zip(q, human_q, strict=True):
        place_robot(arm, robot_q, robot)
        geometry = people_geometry_of(people, person_q[None], np.zeros((0, 3)))
        n = len(arm.link)
        found = np.empty((n, geometry.capsules.shape[1]))
        for k in range(n):
            distances(robot.capsules, k, geometry.capsules, found[k])
        pair_distances(robot.capsules, arm.first, arm.second, robot.pair)
        near = found[:, : len(human.CAPSULE_NAMES)].ravel()
        yield np.concatenate([near, robot.pair, [table_clearance(robot.capsules)[0]]])


@pytest.mark.parametrize("mode", ["distances", "sensors"])
def test_peer_measures_the_distances_that_the_kernels_measure(mode: str) -> None:
    q, human_q = postures()
    peer = MujocoPick(CELL, q, human_q, mode)
    for tick, wanted in enumerate(by_kernels(q, human_q)):
        peer.place(tick)
        found = np.array(peer.distances())
        n_table = len(arm_of(CELL).link) - FIRST_OVER_TABLE
        assert len(found) == 144 + 17 + n_table
        np.testing.assert_allclose(found[:-n_table], wanted[:-1], atol=1e-6)
        assert found[-n_table:].min() == pytest.approx(wanted[-1], abs=1e-6)


def test_peer_finds_contacts_exactly_where_the_kernels_find_overlaps() -> None:
    q, human_q = postures()
    peer, verdicts = MujocoPick(CELL, q, human_q, "contacts"), []
    for tick, wanted in enumerate(by_kernels(q, human_q)):
        peer.place(tick)
        touches = peer.touches()
        if abs(wanted.min()) > 1e-6:
            assert touches == (wanted.min() < 0.0)
        verdicts.append(touches)
    assert 0.2 < np.mean(verdicts) < 0.98


def test_peer_goes_through_the_recorded_moments_over_and_over() -> None:
    q, human_q = postures()
    peer = MujocoPick(CELL, q[:3], human_q[:3], "sensors")
    first = [peer.step() for _ in range(3)]
    assert [peer.step() for _ in range(3)] == first
    assert len(set(first)) == 3
