"""The filter of points: follows, forgets, refuses."""

import numpy as np
import pytest

from app.sim.perception import kalman_filter
from app.sim.perception.kalman_filter import PointFilter

DT = 1.0 / 30.0


def run(points: np.ndarray) -> PointFilter:
    found = PointFilter(points.shape[1])
    for k, frame in enumerate(points):
        found.update(k * DT, frame, np.ones(len(frame)))
    return found


def test_filter_of_a_noisy_point_at_rest_is_nearer_than_the_measurement() -> None:
    noise = 0.02 * np.random.default_rng(7).standard_normal((60, 200, 3))
    p, v = run(noise).at(59 * DT)
    assert np.sqrt((p**2).mean()) < 0.6 * 0.02
    assert np.sqrt((v**2).mean()) < 0.12


def test_even_motion_is_followed_with_its_speed() -> None:
    t = np.arange(90)[:, None, None] * DT
    p, v = run(t * np.array([[0.5, -0.3, 0.1]])).at(89 * DT)
    np.testing.assert_allclose(p[0], 89 * DT * np.array([0.5, -0.3, 0.1]), atol=0.015)
    np.testing.assert_allclose(v[0], [0.5, -0.3, 0.1], atol=0.12)


@pytest.mark.parametrize(
    ("rate_hz", "share", "late_ms"), [(5, 0.90, 4), (30, 0.76, 15), (120, 0.74, 19)]
)
def test_steady_speed_is_estimated_too_low_by_the_documented_share(
    rate_hz: int, share: float, late_ms: float
) -> None:
    found, n = PointFilter(1), 3 * rate_hz
    for k in range(n + 1):
        found.update(k / rate_hz, np.array([[1.6 * k / rate_hz, 0.0, 0.0]]), np.ones(1))
    p, v = found.at(n / rate_hz)
    assert v[0, 0] / 1.6 == pytest.approx(share, abs=0.005)
    assert 1e3 * (n / rate_hz - p[0, 0] / 1.6) == pytest.approx(late_ms, abs=0.5)


def test_unseen_point_comes_to_rest_and_is_then_unknown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(kalman_filter, "HOLD_S", 2.0)
    monkeypatch.setattr(kalman_filter, "MEMORY_S", 0.2)
    t = np.arange(60)[:, None, None] * DT
    found = run(t * np.array([[1.0, 0.0, 0.0]]))
    now = 59 * DT
    (early, _), (late, speed) = found.at(now + 1.0), found.at(now + 1.9)
    assert abs(early[0, 0] - late[0, 0]) < 0.005 and abs(speed[0, 0]) < 0.01
    assert found.known(now + 2.0).all() and not found.known(now + 2.1).any()
    assert np.isnan(found.at(now + 2.1)[0]).all()


def test_prediction_in_one_step_or_many_is_the_same() -> None:
    t = np.arange(30)[:, None, None] * DT
    found, other = (run(t * np.array([[0.4, 0.2, 0.0]])) for _ in range(2))
    now, nothing = 29 * DT, np.full((1, 3), np.nan)
    for k in range(1, 6):
        other.update(now + k * DT, nothing, np.zeros(1))
    for one, many in zip(found.at(now + 5 * DT), other.at(now + 5 * DT), strict=True):
        np.testing.assert_allclose(one, many, atol=1e-12)


def test_what_no_person_can_do_is_refused_until_the_hold_time_is_over() -> None:
    found = run(np.zeros((30, 1, 3)))
    far, now = np.array([[0.6, 0.0, 0.0]]), 30 * DT
    assert not found.gate(now, 0.4 * far).any()
    for k in range(30, 44):
        assert found.gate(k * DT, far).all()
    assert not found.gate(now + 0.6, far).any()


def test_an_unseen_point_may_have_moved_the_farther_the_longer() -> None:
    far, now = np.array([[0.6, 0.0, 0.0]]), 30 * DT
    assert not run(np.zeros((30, 1, 3))).gate(now + 0.1, far).any()


def test_less_trust_moves_less() -> None:
    moved = []
    for trust in (1.0, 0.3):
        found = run(np.zeros((30, 1, 3)))
        found.update(30 * DT, np.array([[0.1, 0.0, 0.0]]), np.array([trust]))
        moved.append(found.at(30 * DT)[0][0, 0])
    assert 0.0 < 2.0 * moved[1] < moved[0]
