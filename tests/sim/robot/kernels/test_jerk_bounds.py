"""The jerk-limited stop by hand and by simulation, and the interval by brute force."""

import numpy as np
import pytest

from app.sim.robot.kernels import jerk_bounds as jerk
from app.sim.robot.kernels.joints import AxisLimits, AxisState

CHAPTER_4 = AxisLimits(-2.0, 2.0, 1.0, 5.0, 50.0, 0.02)
SETS = (
    CHAPTER_4,
    AxisLimits(-0.3, 0.2, 0.5, 3.0, 50.0, 0.05),
    AxisLimits(-0.5, 0.5, 1.0, 2.0, 9.3, 0.033),
    AxisLimits(-1.0, 1.0, 1.0, 1.0, 0.7, 0.1),
    AxisLimits(-0.2, 0.2, 2.0, 5.0, 500.0, 0.05),
)


def simulate_stop(qd: float, qdd: float, to: AxisLimits) -> np.ndarray:
    """Displacement and speed of the stop at 200 times a period, until rest, shape (2, n)."""
    x, q, parts = np.linspace(0, to.dt, 201), 0.0, []
    for _ in range(5_000):
        j = jerk.settling_jerk(qd, qdd, to.qdd_max, to.jerk_max, to.dt)
        parts.append(
            np.array([q + x * (qd + x * (qdd / 2 + x * j / 6)), qd + x * (qdd + x * j / 2)])
        )
        (q, qd), qdd = parts[-1][:, -1], qdd + j * to.dt
        if abs(qd) < 1e-13 and abs(qdd) < 1e-12:
            return np.hstack(parts)
    raise AssertionError("never at rest")


def random_motion(to: AxisLimits, rng: np.random.Generator) -> tuple[float, float]:
    """Speed and acceleration, of any size up to the limits."""
    size = rng.choice([1.0, 0.1, 0.01], 2)
    qd, qdd = rng.uniform(-1, 1, 2) * size * (to.qd_max, to.qdd_max)
    return float(qd), float(qdd)


def viable_states(to: AxisLimits, n: int, seed: int):
    """States on the way of a joint that is pushed about at random."""
    rng = np.random.default_rng(seed)
    q, qd, qdd = rng.uniform(to.q_min, to.q_max), 0.0, 0.0
    for k in range(n):
        if k % 11 == 0:
            target = rng.choice([-1, 1]) * to.qd_max
        yield q, qd, qdd
        j, empty = jerk.jerk_for_speed(AxisState(q, qd, qdd), target, to)
        assert not empty
        q += to.dt * (qd + to.dt * (qdd / 2 + to.dt * j / 6))
        qd, qdd = qd + to.dt * (qdd + to.dt * j / 2), qdd + to.dt * j


def test_stop_from_full_speed_by_hand() -> None:
    # 0.1 s to -5 rad/s^2, 0.1 s there, 0.1 s back: 0.3 s, and by symmetry half of 1 rad/s
    low, high, slowest, fastest = jerk.manoeuvre_extremes(1.0, 0.0, 5.0, 50.0, 0.02)
    assert (low, high, slowest, fastest) == pytest.approx((0.0, 0.15, 0.0, 1.0), abs=1e-12)


def test_stop_counts_the_acceleration_left_over() -> None:
    # 5 rad/s^2 left at 0.5 rad/s: ramped down in 0.1 s, it adds 0.25 rad/s
    _, high, _, fastest = jerk.manoeuvre_extremes(0.5, 5.0, 5.0, 50.0, 0.02)
    assert fastest == pytest.approx(0.75)
    assert high > 0.5**2 / (2 * 5.0) + 0.1 * 0.5


@pytest.mark.parametrize("to", SETS)
def test_extremes_in_closed_form_are_those_of_the_simulated_stop(to: AxisLimits) -> None:
    rng = np.random.default_rng(31)
    for _ in range(60):
        qd, qdd = random_motion(to, rng)
        q, speed = simulate_stop(qd, qdd, to)
        closed = jerk.manoeuvre_extremes(qd, qdd, to.qdd_max, to.jerk_max, to.dt)
        seen = (q.min(), q.max(), min(speed.min(), 0), max(speed.max(), 0))
        np.testing.assert_allclose(closed, seen, rtol=0, atol=2e-5 * to.qd_max)


@pytest.mark.parametrize("to", SETS)
def test_extremes_inside_a_period_are_those_of_its_samples(to: AxisLimits) -> None:
    rng, x = np.random.default_rng(32), np.linspace(0, to.dt, 2_001)
    for _ in range(300):
        qd, qdd = random_motion(to, rng)
        j = rng.uniform(-to.jerk_max, to.jerk_max)
        q, speed = x * (qd + x * (qdd / 2 + x * j / 6)), qd + x * (qdd + x * j / 2)
        seen = (q.min(), q.max(), speed.min(), speed.max())
        low, high, slowest, fastest = jerk.period_extremes(qd, qdd, j, to.dt)
        closed = (min(low, 0.0), max(high, 0.0), min(slowest, qd), max(fastest, qd))
        np.testing.assert_allclose(closed, seen, rtol=0, atol=1e-6)


@pytest.mark.parametrize("to", SETS)
def test_interval_ends_where_brute_force_finds_the_last_admissible_jerk(to: AxisLimits) -> None:
    def holds(q: float, qd: float, qdd: float, j: float) -> bool:
        x = np.linspace(0, to.dt, 201)
        at, speed = q + x * (qd + x * (qdd / 2 + x * j / 6)), qd + x * (qdd + x * j / 2)
        later = simulate_stop(speed[-1], qdd + j * to.dt, to)
        at, speed = np.append(at, at[-1] + later[0]), np.append(speed, later[1])
        inside = at.min() >= to.q_min - 1e-7 and at.max() <= to.q_max + 1e-7
        return bool(inside and abs(speed).max() <= to.qd_max + 1e-7)

    n_bound, step = 0, 1e-3 * to.jerk_max
    for q, qd, qdd in list(viable_states(to, 400, 33))[::8]:
        low, high, empty = jerk.jerk_interval(AxisState(q, qd, qdd), to)
        assert not empty
        assert holds(q, qd, qdd, low)
        assert holds(q, qd, qdd, high)
        for end, outward in ((low, -step), (high, step)):
            after = qdd + (end + outward) * to.dt
            if abs(end + outward) <= to.jerk_max and abs(after) <= to.qdd_max:
                n_bound += 1
                shift = max(1.0, 1e-5 / (to.dt**2 * step))  # far enough to be seen
                assert not holds(q, qd, qdd, end + shift * outward)
    assert n_bound > 5


@pytest.mark.parametrize("to", SETS)
def test_a_greater_jerk_goes_no_less_far_up_and_no_farther_down(to: AxisLimits) -> None:
    jerks = np.linspace(-to.jerk_max, to.jerk_max, 101)
    for q, qd, qdd in viable_states(to, 60, 34):
        below, above = np.array([jerk.excesses(j, AxisState(q, qd, qdd), to) for j in jerks]).T
        assert (np.diff(above) >= -1e-12).all()
        assert (np.diff(below) <= 1e-12).all()


@pytest.mark.parametrize("to", SETS)
def test_holding_a_target_speed_settles_without_overshoot(to: AxisLimits) -> None:
    free = to._replace(q_min=-1e3, q_max=1e3)
    for target in (1.0, 0.37, -0.8, 0.01):
        q, qd, qdd, seen = 0.0, 0.0, 0.0, []
        for _ in range(200):
            j, _ = jerk.jerk_for_speed(AxisState(q, qd, qdd), target * to.qd_max, free)
            q += to.dt * (qd + to.dt * (qdd / 2 + to.dt * j / 6))
            qd, qdd = qd + to.dt * (qdd + to.dt * j / 2), qdd + to.dt * j
            seen.append(qd / (target * to.qd_max))
        assert (np.diff(seen) >= -1e-9).all()
        assert max(seen) <= 1 + 1e-9
        np.testing.assert_allclose(seen[-50:], 1.0, rtol=0, atol=1e-9)


@pytest.mark.parametrize("to", SETS)
def test_a_joint_at_rest_on_its_limit_stays_and_can_leave(to: AxisLimits) -> None:
    for side, limit in ((1, to.q_max), (-1, to.q_min)):
        low, high, empty = jerk.jerk_interval(AxisState(limit, 0.0, 0.0), to)
        assert not empty
        assert (high if side > 0 else -low) == pytest.approx(0.0, abs=1e-6 * to.jerk_max)
        assert (low if side > 0 else -high) < -0.1 * min(
            to.jerk_max, to.qdd_max / to.dt, to.qd_max / to.dt**2, to.q_max / to.dt**3
        )
        outward, _ = jerk.jerk_for_speed(AxisState(limit, 0.0, 0.0), side * to.qd_max, to)
        assert outward == pytest.approx(0.0, abs=1e-6 * to.jerk_max)


@pytest.mark.parametrize(
    "state", [(2.1, 0.0, 0.0), (1.9, 0.9, 0.0), (0.0, 1.2, 0.0), (0.0, 0.9, 4.0), (0, 0, 5.5)]
)
def test_a_state_that_cannot_be_kept_has_an_empty_interval_and_brakes(state) -> None:
    q, qd, qdd = (float(v) for v in state)
    braking = jerk.settling_jerk(qd, qdd, 5.0, 50.0, 0.02)
    assert jerk.jerk_interval(AxisState(q, qd, qdd), CHAPTER_4) == (braking, braking, True)
    assert jerk.jerk_for_speed(AxisState(q, qd, qdd), 1.0, CHAPTER_4) == (braking, True)
