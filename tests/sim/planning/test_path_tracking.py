"""Following is exact when nobody interferes, and stays near the path when somebody does."""

from collections.abc import Callable

import numpy as np

from app.sim.cells.cell import load_cell
from app.sim.core.arrays import Vec
from app.sim.planning.path_tracking import PathFollower, straight_stop
from app.sim.planning.time_parameterization import time_path
from app.sim.robot.kernels import acceleration_bounds
from app.sim.robot.kernels.joints import JointState
from app.sim.scene.scene import arm_of

ARM = arm_of(load_cell())


def move(q: Vec, qd: Vec, wanted: Vec) -> tuple[Vec, Vec, Vec]:
    """One period of the bounded actions: coefficients, positions, speeds."""
    c, end = np.empty(6), JointState(*np.empty((3, 6)))
    start = JointState(q, qd, np.zeros(6))
    acceleration_bounds.advance_to_speeds(ARM.limits, ARM.dt, start, wanted, c, end)
    return c, end.q, end.qd


def some_path(seed: int) -> Vec:
    rng = np.random.default_rng(seed)
    return ARM.home + np.cumsum(np.vstack([np.zeros(6), rng.normal(size=(4, 6)) * 0.2]), axis=0)


def follow(
    seed: int, scale: Callable[[int], float], n_periods: int = 1000
) -> tuple[PathFollower, list[float], Vec]:
    """Follow a path while somebody scales the wanted speeds; the limits are asserted."""
    path_follower, errors = PathFollower(time_path(some_path(seed), ARM), ARM), []
    q, qd = path_follower.timed.q[0].copy(), np.zeros(6)
    for k in range(n_periods):
        path_follower.locate(q)
        errors.append(path_follower.error_rad)
        if path_follower.remaining <= 0.0 and np.abs(qd).max() < 1e-4:
            break
        c, q, qd = move(q, qd, scale(k) * path_follower.target_speeds(q, qd))
        assert np.all(np.abs(qd) <= ARM.limits.qd_max + 1e-9)
        assert np.all(np.abs(2.0 * c) <= ARM.limits.qdd_max + 1e-9)
    return path_follower, errors, q


def test_undisturbed_the_motion_is_the_timed_path() -> None:
    for seed in range(10):
        path_follower, errors, q = follow(seed, lambda _: 1.0)
        assert max(errors) < 1e-12
        assert len(errors) == path_follower.timed.n_periods + 1
        np.testing.assert_allclose(q, path_follower.timed.q[-1], atol=1e-12)


def test_slowed_down_and_stopped_it_stays_within_five_milliradians_and_arrives() -> None:
    def halt(k: int) -> float:
        return 0.0 if 20 <= k < 35 else 0.5 if k < 50 else 1.0

    for seed in range(10):
        _, errors, q = follow(seed, halt)
        assert max(errors) < 5e-3
        assert errors[-1] < 1e-3
        np.testing.assert_allclose(q, some_path(seed)[-1], atol=1e-3)


def test_erratic_scaling_stays_within_ten_milliradians_and_arrives() -> None:
    for seed in range(10):
        rng = np.random.default_rng(seed)
        scales = rng.uniform(0.0, 1.0, 1000)
        _, errors, q = follow(seed, lambda k, scales=scales: float(scales[k]))
        assert max(errors) < 1e-2
        np.testing.assert_allclose(q, some_path(seed)[-1], atol=1e-3)


def test_braking_rests_on_the_path_and_goes_on_from_there() -> None:
    for seed in range(5):
        path_follower = PathFollower(time_path(some_path(seed), ARM), ARM)
        q, qd = path_follower.timed.q[0].copy(), np.zeros(6)
        for k in range(1000):
            path_follower.locate(q)
            if 30 <= k < 60 and k >= 38:
                assert np.abs(qd).max() < 1e-2
            _, q, qd = move(q, qd, path_follower.target_speeds(q, qd, brake=30 <= k < 60))
            assert path_follower.error_rad < 5e-3
        np.testing.assert_allclose(q, some_path(seed)[-1], atol=1e-3)


def test_a_straight_stop_keeps_the_direction_and_the_limits() -> None:
    rng = np.random.default_rng(0)
    for _ in range(100):
        qd = rng.uniform(-1.0, 1.0, 6) * ARM.limits.qd_max
        track = qd / np.linalg.norm(qd)
        for _ in range(4):
            after = straight_stop(qd, ARM)
            assert np.all(np.abs(after - qd) <= ARM.limits.qdd_max * ARM.dt + 1e-12)
            np.testing.assert_allclose(after, (after @ track) * track, atol=1e-12)
            qd = after
        np.testing.assert_array_equal(qd, np.zeros(6))
