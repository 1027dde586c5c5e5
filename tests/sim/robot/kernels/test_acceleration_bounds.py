"""Intervals of degree 2 by hand, by brute force, and as the thesis prints them."""

import numpy as np
import pytest

from app.sim.robot.kernels import acceleration_bounds as polynomial
from app.sim.robot.kernels.joints import AxisLimits

Q_MIN, Q_MAX, V, A, DT = -2.0, 2.0, 1.0, 5.0, 0.02
LIMITS = AxisLimits(Q_MIN, Q_MAX, V, A, np.inf, DT)
SLOW = AxisLimits(-1.0, 1.0, 0.5, 3.0, np.inf, 0.05)


def random_states(n: int, seed: int) -> np.ndarray:
    """Positions and speeds, half of them close to a limit, as rows (q, qd)."""
    rng = np.random.default_rng(seed)
    near = rng.choice([Q_MIN, Q_MAX], n) + rng.uniform(-0.05, 0.05, n)
    q = np.where(rng.random(n) < 0.5, rng.uniform(Q_MIN, Q_MAX, n), near.clip(Q_MIN, Q_MAX))
    return np.column_stack([q, rng.uniform(-V, V, n)])


def keeps_limits(q: float, qd: float, c: np.ndarray) -> np.ndarray:
    """Whether coefficients keep every limit in this period, by 401 samples of it."""
    x = np.linspace(0, DT, 401)[:, None]
    at, speed, slack = q + qd * x + c * x**2, qd + 2 * c * x, 1e-9
    return (
        (at <= Q_MAX + slack).all(0)
        & (at >= Q_MIN - slack).all(0)
        & (abs(speed) <= V + slack).all(0)
        & (2 * abs(c) <= A + slack)
    )


def test_free_joint_is_bound_by_acceleration_and_speed_alone() -> None:
    for interval in (
        polynomial.coefficient_interval,
        polynomial.one_step_interval,
    ):
        assert interval(0.0, 0.0, LIMITS) == (-2.5, 2.5)
        assert interval(0.0, 0.96, LIMITS) == pytest.approx((-2.5, 1.0))
        assert interval(0.0, -0.96, LIMITS) == pytest.approx((-1.0, 2.5))


def test_viable_end_is_the_greatest_speed_from_which_full_braking_stops_in_time() -> None:
    # by hand: v' with v'^2/(2A) + v' dt/2 = clearance left after the period
    q, qd = 1.95, 0.6
    c = polynomial.coefficient_interval(q, qd, LIMITS)[1]
    v, clearance = qd + 2 * c * DT, Q_MAX - (q + qd * DT + c * DT**2)
    assert v**2 / (2 * A) + v * DT / 2 == pytest.approx(clearance, abs=1e-15)
    assert -2.5 < c < 2.5


def test_one_step_bounds_by_hand() -> None:
    bound = polynomial.one_step_position_bound
    assert bound(0.03, 1.0, DT) == pytest.approx((0.03 - 0.02) / 0.0004)  # at the end
    assert bound(0.01, 1.0, DT) == pytest.approx(-25.0)  # where both bounds meet
    assert bound(0.005, 1.0, DT) == pytest.approx(-50.0)  # at the turning point
    assert bound(0.0, 1.0, DT) == -np.inf  # at the limit only standing or leaving
    assert bound(0.0, 0.0, DT) == 0.0


def test_one_step_interval_is_all_that_brute_force_admits() -> None:
    c = np.linspace(-A / 2, A / 2, 2001)
    checked = empty = 0
    for q, qd in random_states(400, 11):
        low, high = polynomial.one_step_interval(q, qd, LIMITS)
        kept = keeps_limits(q, qd, c)
        clear = (abs(c - low) > 1e-3) & (abs(c - high) > 1e-3)
        np.testing.assert_array_equal(kept[clear], ((c > low) & (c < high))[clear])
        checked, empty = checked + kept.any(), empty + (low > high)
    assert checked > 300
    assert empty > 10


def test_viable_interval_lies_within_the_one_step_interval() -> None:
    n_viable = 0
    for q, qd in random_states(5_000, 12):
        clearance = Q_MAX - q if qd > 0 else q - Q_MIN
        if qd**2 / (2 * A) + abs(qd) * DT / 2 <= clearance:
            n_viable += 1
            low, high = polynomial.coefficient_interval(q, qd, LIMITS)
            assert low <= high + 1e-9
            low1, high1 = polynomial.one_step_interval(q, qd, LIMITS)
            assert low1 <= low + 1e-9
            assert high <= high1 + 1e-9
    assert n_viable > 3_000


def test_swapped_max_and_min_as_printed_exceed_limits() -> None:
    """(4.21) and (4.22): the greatest upper and the least lower bound of 20,000 states."""
    rng, exceeded, mended, n_empty = np.random.default_rng(13), 0, 0, 0
    for q, qd in rng.uniform((Q_MIN, -V), (Q_MAX, V), (20_000, 2)):
        upper = np.array([(Q_MAX - qd * DT - q) / DT**2, (V - qd) / (2 * DT), A / 2])
        lower = np.array([(Q_MIN - qd * DT - q) / DT**2, (-V - qd) / (2 * DT), -A / 2])
        share = rng.random()
        printed = lower.min() + share * (upper.max() - lower.min())
        exceeded += abs(qd + 2 * printed * DT) > V + 1e-9 or 2 * abs(printed) > A + 1e-9
        low, high = lower.max(), upper.min()
        if low > high:
            n_empty += 1
            continue
        ours = low + share * (high - low)
        mended += abs(qd + 2 * ours * DT) > V + 1e-9 or 2 * abs(ours) > A + 1e-9
    assert exceeded > 0.999 * 20_000
    assert mended == 0
    assert 0 < n_empty < 400


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_turning_point_as_printed_exceeds_the_position_limit(side: float) -> None:
    """(4.17) and (4.21) with ``q^2 - 2 qd^2`` in place of ``qd^2``."""
    q, qd, clearance = 0.0, 0.1, 0.0006  # clearance < qd dt/2 = 0.001
    printed = -(q**2 - 2 * qd**2) / (4 * clearance)
    mended = polynomial.one_step_position_bound(clearance, qd, DT)
    highest = {}
    for name, c in (("printed", min(A / 2, printed)), ("mended", mended)):
        x = np.linspace(0, DT, 10_001)
        highest[name] = (q + qd * x + c * x**2).max()
    assert highest["printed"] > clearance + 1e-3
    assert highest["mended"] == pytest.approx(clearance, abs=1e-9)
    low, high = polynomial.one_step_interval(
        q, side * qd, AxisLimits(-clearance, clearance, V, 100.0, np.inf, DT)
    )
    assert (high if side > 0 else -low) == pytest.approx(mended)


def test_wanted_speed_is_met_exactly_where_it_is_admissible() -> None:
    c = polynomial.coefficient_for_speed(0.0, 0.1, 0.2, SLOW)
    assert 0.1 + 2 * c * 0.05 == pytest.approx(0.2, abs=1e-15)


def test_wanted_speed_is_clipped_into_the_interval_or_brakes_where_that_is_empty() -> None:
    rng = np.random.default_rng(14)
    for q, qd in random_states(5_000, 14):
        q, qd, target = q + rng.choice([0.0, 0.01, -0.01]), 1.2 * qd, rng.uniform(-V, V)
        low, high = polynomial.coefficient_interval(q, qd, LIMITS)
        wanted = (target - qd) / (2 * DT)
        expected = min(high, max(low, wanted)) if low <= high else polynomial.brake(qd, A, DT)
        c = polynomial.coefficient_for_speed(q, qd, target, LIMITS)
        assert c == pytest.approx(expected, abs=1e-11), (q, qd, target)


def test_joint_beyond_its_limit_brakes_as_hard_as_it_may() -> None:
    c = polynomial.coefficient_for_speed(1.2, 0.5, 0.5, SLOW)
    assert c == pytest.approx(-1.5)
    c = polynomial.coefficient_for_speed(1.2, 0.03, 0.5, SLOW)
    assert 0.03 + 2 * c * 0.05 == pytest.approx(0.0, abs=1e-15)


def test_an_action_maps_onto_the_interval() -> None:
    for act, c in ((-1.0, -1.0), (0.0, 1.0), (0.5, 2.0), (1.0, 3.0)):
        assert polynomial.coefficient_of(act, -1.0, 3.0) == c
