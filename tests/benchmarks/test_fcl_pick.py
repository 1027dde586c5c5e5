import numpy as np

from app.sim import human
from app.sim.cells import load_cell
from app.sim.kernels import arm as kernel
from app.sim.pick import arm_of, step_robot
from tests.benchmarks.fcl_pick import FclPick

CELL = load_cell()
PERSON = human.rest_posture(*CELL.human.home)


def make_env() -> FclPick:
    return FclPick(CELL, PERSON[None], np.array(CELL.stations[0].position))


def test_peer_measures_the_distances_that_the_kernels_measure() -> None:
    env, arm, rng = make_env(), arm_of(CELL), np.random.default_rng(1)
    pose = kernel.new_pose(len(arm.link))
    for _ in range(100):
        q = np.array(CELL.robot.home_q) + rng.uniform(-0.5, 0.5, 6)
        env.place(q)
        kernel.place(arm, q, PERSON, pose)
        to_person, _, to_self = env.clearances()
        assert abs(to_person - max(kernel.human_clearance(arm, pose)[0], 0.0)) < 1e-4
        assert abs(to_self - max(kernel.self_clearance(arm, pose)[0], 0.0)) < 1e-4


def test_peer_moves_as_the_kernels_move() -> None:
    env, arm, rng = make_env(), arm_of(CELL), np.random.default_rng(2)
    q, qd = np.array(CELL.robot.home_q), np.zeros(6)
    for _ in range(20):
        act = rng.uniform(-1.0, 1.0, 5)
        obs, _, ended = env.step(act)
        q, qd, _ = step_robot(arm, q, qd, act)
        assert not ended
        np.testing.assert_allclose(obs[:12], np.concatenate([q, qd]), atol=1e-9)
