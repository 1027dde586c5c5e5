"""Batches that are moved at random, and what holds in both scenarios whatever is done."""

from typing import TypeVar

import numpy as np

from app.sim.pick.batch import PickBatch
from app.sim.reach.batch import ReachBatch
from app.sim.robot.kernels.kinematics import ik_vertical_batch

Batch = TypeVar("Batch", PickBatch, ReachBatch)


def drive(batch: Batch, n_steps: int, seed: int, *, auto_reset: bool = True) -> Batch:
    """Start the episodes of a batch, move all robots at random, and return the batch."""
    batch.reset()
    rng = np.random.default_rng(seed)
    for _ in range(n_steps):
        act = rng.uniform(-1, 1, (batch.n_envs, batch.n_act)).astype(np.float32)
        batch.step(act, auto_reset=auto_reset)
    return batch


def random_actions(n_steps: int, batch: PickBatch | ReachBatch) -> np.ndarray:
    """Actions held for 10 or 20 cycles each, so that the robot gets about."""
    hold = 20 if isinstance(batch, PickBatch) else 10
    rng = np.random.default_rng(81)
    held = rng.uniform(-1, 1, (n_steps // hold + 1, batch.n_envs, batch.n_act))
    return np.repeat(held, hold, axis=0)[:n_steps].astype(np.float32)


def straight(batch: ReachBatch) -> np.ndarray:
    """Joint moves toward a posture at the goal."""
    posture, _ = ik_vertical_batch(batch.arm.lengths, batch.arm.limits, batch.state.goal)
    return np.clip(3.0 * (posture - batch.state.q), -1, 1).astype(np.float32)


def check_rows(few: Batch, many: Batch, rows: slice, n_steps: int) -> None:
    """Check that the environments of a small batch equal some of a large one, bit for bit."""
    np.testing.assert_array_equal(few.reset(), many.reset()[rows])
    for act in random_actions(n_steps, many):
        one, two = few.step(act[rows]), many.step(act)
        np.testing.assert_array_equal(one.obs, two.obs[rows])
        np.testing.assert_array_equal(one.rew, two.rew[rows])
        np.testing.assert_array_equal(one.ended, two.ended[rows])
    assert few.state.episode.sum() > 3


def check_limits(batch: PickBatch | ReachBatch, n_steps: int) -> None:
    """Check that joints keep position, speed and acceleration limits in whole episodes."""
    batch.reset()
    mount, qd0 = batch.cell.robot, batch.state.qd.copy()
    for act in random_actions(n_steps, batch):
        result = batch.step(np.sign(act).astype(np.float32))
        q, qd = batch.state.q, batch.state.qd
        assert (q >= np.array(mount.q_min) - 1e-9).all()
        assert (q <= np.array(mount.q_max) + 1e-9).all()
        assert (np.abs(qd) <= np.array(mount.qd_max) + 1e-9).all()
        acc = np.abs(qd - qd0)[result.ended == 0] / mount.dt
        assert (acc <= np.array(mount.qdd_max) + 1e-9).all()
        qd0 = qd.copy()
