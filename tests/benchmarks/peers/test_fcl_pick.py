import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.collision.contact import clearance
from app.sim.human import model as human
from app.sim.pick.batch import step_robot
from app.sim.scene.scene import NO_CYLINDERS, arm_of, people_of
from tests.benchmarks.peers.fcl_pick import FclPick

CELL = load_cell()
PERSON = human.rest_posture(*CELL.human.home)


def make_env() -> FclPick:
    return FclPick(CELL, PERSON[None], np.array(CELL.stations[0].position))


def test_peer_measures_the_distances_that_the_kernels_measure() -> None:
    env, arm, rng = make_env(), arm_of(CELL), np.random.default_rng(1)
    people = people_of(CELL)
    for _ in range(100):
        q = np.array(CELL.robot.home_q) + rng.uniform(-0.5, 0.5, 6)
        env.place(q)
        free = clearance(arm, people, q, PERSON[None], NO_CYLINDERS)
        to_person, _, to_self = env.clearances()
        assert abs(to_person - max(free.people_m, 0.0)) < 1e-4
        assert abs(to_self - max(free.self_m, 0.0)) < 1e-4


def test_peer_moves_as_the_kernels_move() -> None:
    env, arm, rng = make_env(), arm_of(CELL), np.random.default_rng(2)
    q, qd = np.array(CELL.robot.home_q), np.zeros(6)
    for _ in range(20):
        act = rng.uniform(-1.0, 1.0, 5).astype(np.float32)
        obs, _, ended = env.step(act)
        segment = step_robot(arm, q, qd, np.zeros(6), act)
        q, qd = segment.q, segment.qd
        assert not ended
        np.testing.assert_allclose(obs[:12], np.concatenate([q, qd]), atol=1e-9)
