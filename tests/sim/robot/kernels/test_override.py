"""Scaled motions and stops: on the commanded path, inside every limit."""

import numpy as np
import pytest

from app.sim.robot.kernels import override
from app.sim.robot.kernels.joints import JointLimits, JointPath

DT = 0.05
Q_MIN, Q_MAX = np.full(6, -2.0), np.full(6, 2.0)
QDD_MAX = np.array([3.0, 3.0, 2.0, 3.0, 4.0, 3.0])
LIMITS = JointLimits(Q_MIN, Q_MAX, np.full(6, 0.5), QDD_MAX, np.full(6, np.inf))


def paths(n, seed, cubic=True):
    """Random paths that keep position, speed and acceleration limits."""
    rng = np.random.default_rng(seed)
    while n:
        q, qd = rng.uniform(-1.5, 1.5, 6), rng.uniform(-0.5, 0.5, 6)
        c = 0.5 * rng.uniform(-1.0, 1.0, 6) * QDD_MAX
        d = rng.uniform(-8.0, 8.0, 6) if cubic else np.zeros(6)
        path = JointPath(q, qd, c, d)
        if override.keeps_limits(path, LIMITS, DT):
            n -= 1
            yield path


def at(path, deceleration, t):
    q, qd = np.empty(6), np.empty(6)
    override.motion_at(JointPath(*path), deceleration, t, q, qd)
    return q, qd


def test_a_scaled_motion_stays_on_the_commanded_curve():
    for q, qd, c, d in paths(200, 1):
        qd[0] = abs(qd[0]) + 0.01
        c[0], d[0] = abs(c[0]), 0.0  # the position of the first joint determines s
        for part in (0.2, 0.5, 0.9, 1.0):
            there, _ = at((q, qd, c, d), (1.0 - 0.3) / DT, part * DT)
            s = max(np.roots([c[0], qd[0], q[0] - there[0]]).real)
            assert np.abs(q + s * (qd + s * (c + s * d)) - there).max() < 1e-9
            assert 0.0 < s <= DT


def test_the_peak_of_acceleration_is_that_of_a_finely_sampled_motion():
    for path in paths(100, 2):
        deceleration, x, h = 0.6 / DT, np.linspace(0.0, DT, 401), 1e-6
        speeds = np.array([[at(path, deceleration, t + e)[1] for t in x] for e in (-h, h)])
        sampled = np.abs((speeds[1] - speeds[0]) / (2.0 * h)).max(axis=0)
        s_end = 0.5 * 1.4 * DT
        joints = zip(*path[1:], strict=True)
        exact = [override.acceleration_peak(*row, deceleration, s_end) for row in joints]
        assert sampled == pytest.approx(exact, abs=2e-3)


def test_the_least_override_keeps_limits_and_less_does_not():
    for path in paths(300, 3):
        low = override.lowest_override(path, QDD_MAX, DT)
        assert override.keeps_acceleration(path, QDD_MAX, low, DT)
        if override.LEAST_OVERRIDE < low:
            assert not override.keeps_acceleration(path, QDD_MAX, low - 0.001, DT)


def test_a_stop_is_straight_and_brakes_no_harder_than_it_may():
    for q, qd, _, _ in paths(100, 4):
        time, none = override.stop_time(qd, QDD_MAX), np.zeros(6)
        assert time == pytest.approx(np.max(np.abs(qd) / QDD_MAX))
        rest, still = at((q, qd, none, none), 1.0 / time, time)
        assert rest == pytest.approx(q + 0.5 * time * qd, abs=1e-12)
        assert np.abs(still).max() == pytest.approx(0.0, abs=1e-12)
        assert (np.abs(qd) / time <= QDD_MAX + 1e-12).all()


def test_the_rest_of_a_stop_is_the_stop_from_there():
    for q, qd, _, _ in paths(100, 5):
        none, time = np.zeros(6), override.stop_time(qd, QDD_MAX)
        later, speeds = at((q, qd, none, none), 1.0 / time, 0.4 * time)
        again = override.stop_time(speeds, QDD_MAX)
        assert again == pytest.approx(0.6 * time)
        first, _ = at((q, qd, none, none), 1.0 / time, 0.7 * time)
        second, _ = at((later, speeds, none, none), 1.0 / again, 0.3 * time)
        assert first == pytest.approx(second, abs=1e-12)


def test_a_path_is_refused_exactly_where_a_sample_of_it_leaves_the_limits():
    rng, x = np.random.default_rng(6), np.linspace(0.0, DT, 2001)
    verdicts = []
    for k in range(6000):
        q, qd = rng.uniform(1.97, 2.0), rng.uniform(-0.5, 0.5)
        if k % 2:  # at the limit of the speed, where the joint may turn back
            q, qd = 0.0, rng.choice([-1.0, 1.0]) * rng.uniform(0.48, 0.5)
        c, d = rng.uniform(-2.0, 2.0), rng.choice([0.0, rng.uniform(-20.0, 20.0)])
        at_x = q + x * (qd + x * (c + x * d))
        speed, bend = qd + x * (2.0 * c + 3.0 * x * d), 2.0 * c + 6.0 * x * d
        excess = max(at_x.max() - 2.0, np.abs(speed).max() - 0.5, np.abs(bend).max() - 3.0)
        if abs(excess) > 1e-5:
            path = JointPath(*(np.full(6, one) for one in (q, qd, c, d)))
            kept = override.joint_keeps_limits(0, path, LIMITS, DT)
            assert kept == (excess < 0.0)
            verdicts.append(kept)
    assert 0.2 < np.mean(verdicts) < 0.8
