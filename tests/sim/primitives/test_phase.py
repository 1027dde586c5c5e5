"""Phase laws: from 0 to 1, never backward, and reading a motion through them."""

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.primitives.phase import (
    min_jerk,
    min_jerk_rate,
    monotone,
    random_phase_profile,
    read,
)

X = np.linspace(0.0, 1.0, 501)


def test_minimum_jerk_goes_from_rest_to_rest() -> None:
    np.testing.assert_allclose(
        min_jerk(np.array([-1.0, 0.0, 0.5, 1.0, 2.0])), [0, 0, 0.5, 1, 1]
    )
    np.testing.assert_allclose(min_jerk_rate(np.array([0.0, 0.5, 1.0])), [0.0, 1.875, 0.0])


def test_minimum_jerk_rate_is_the_derivative_of_the_law() -> None:
    inner, step = X[1:-1], 1e-6
    slope = (min_jerk(inner + step) - min_jerk(inner - step)) / (2 * step)
    np.testing.assert_allclose(min_jerk_rate(inner), slope, atol=1e-8)


def test_monotone_law_meets_its_knots_and_never_turns_back() -> None:
    knots, phases = np.array([0.0, 0.2, 0.7, 1.0]), np.array([0.0, 0.6, 0.6, 1.0])
    np.testing.assert_allclose(monotone(knots, knots, phases), phases, atol=1e-12)
    assert (np.diff(monotone(X, knots, phases)) >= -1e-12).all()


@pytest.mark.parametrize(
    ("knots", "phases", "field"),
    [
        ([0.0, 0.5, 1.0], [0.0, 0.6, 0.5], "phases"),
        ([0.0, 0.5, 0.5, 1.0], [0.0, 0.2, 0.4, 1.0], "knots"),
        ([0.0, 1.0], [0.0, 0.9], "phases"),
        ([0.0, np.nan, 1.0], [0.0, 0.5, 1.0], "knots"),
        ([0.0], [0.0], "phases"),
    ],
)
def test_law_that_turns_back_or_ends_short_is_named(
    knots: list[float], phases: list[float], field: str
) -> None:
    with pytest.raises(InvalidInput) as caught:
        monotone(X, np.array(knots), np.array(phases))
    assert caught.value.field == field


def test_random_laws_differ_and_none_turns_back() -> None:
    rng = np.random.default_rng(4)
    laws = np.array([random_phase_profile(X, rng) for _ in range(50)])
    assert (np.diff(laws, axis=1) >= -1e-12).all()
    np.testing.assert_allclose(laws[:, [0, -1]], [[0.0, 1.0]] * 50, atol=1e-12)
    assert laws[:, 250].std() > 0.03


def test_random_law_without_spread_is_linear() -> None:
    law = random_phase_profile(X, np.random.default_rng(0), spread=0.0)
    np.testing.assert_allclose(law, X, atol=1e-12)


def test_reading_meets_the_samples_and_stays_between_them() -> None:
    q = np.random.default_rng(2).uniform(-1.0, 1.0, (6, 3))
    np.testing.assert_allclose(read(q, np.linspace(0.0, 1.0, 6)), q, atol=1e-12)
    fine = read(q, np.linspace(0.0, 1.0, 51)).reshape(51, 3)
    for i in range(5):
        part = fine[10 * i : 10 * i + 11]
        assert (part >= q[i : i + 2].min(axis=0) - 1e-12).all()
        assert (part <= q[i : i + 2].max(axis=0) + 1e-12).all()
