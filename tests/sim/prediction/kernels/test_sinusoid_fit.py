"""The functions behind what is remembered of walkers: found exactly, or not claimed."""

import numpy as np
import pytest

from app.sim.people.kernels.pedestrian import N_PAST
from app.sim.prediction.kernels.networks import RADIUS_MIDDLE, RADIUS_SCALE, STEP_S
from app.sim.prediction.kernels.sinusoid_fit import Limits, find_function, new_fit, value_at
from tools.train_motion_predictor import watched

RADIUS = Limits(0.2, 0.5, 0.5)
SPEED = Limits(0.3, 1.0, 1.0)
MIDDLE = 0.35


def seen(constants: np.ndarray, limits: Limits, age: float = 0.04) -> tuple[float, np.ndarray]:
    """What is seen of a radius now and in the past."""
    middle = 0.5 * (limits.low + limits.high)
    t = -(age + 0.1 * np.arange(N_PAST))
    cut = lambda s: np.clip(value_at(constants, middle, s), limits.low, limits.high)  # noqa: E731
    return float(cut(0.0)), np.array([cut(s) for s in t])


@pytest.mark.parametrize("frequency", [0.08, 0.21, 0.33, 0.47])
def test_a_function_is_found(frequency: float) -> None:
    constants, found = np.array([frequency, 0.21, 0.3, 2.0, -1.0]), np.zeros(5)
    now, past = seen(constants, RADIUS)
    assert find_function(new_fit(), now, 0.04, past, RADIUS, False, 0.02, found)
    later = STEP_S * np.arange(1, 19)
    true = np.clip([value_at(constants, MIDDLE, t) for t in later], 0.2, 0.5)
    told = np.clip([value_at(found, MIDDLE, t) for t in later], 0.2, 0.5)
    assert np.abs(told - true).max() < 0.01


def test_most_radii_are_known_to_millimetres_and_none_is_claimed_falsely() -> None:
    moments, fit, off = watched(1500, 31), new_fit(), []
    for row, said in zip(moments.radius_seen.astype(float), moments.radius, strict=True):
        values = np.round(RADIUS_MIDDLE + RADIUS_SCALE * row[[0, *range(3, len(row))]], 7)
        found = np.zeros(5)
        if find_function(fit, values[0], 0.1 * row[2], values[1:], RADIUS, False, 0.0, found):
            t = STEP_S * 9
            told = min(0.5, max(0.2, value_at(found, MIDDLE, t)))
            off.append(told - (values[0] + RADIUS_SCALE * said[8]))
    assert len(off) > 0.7 * 1500
    assert np.median(np.abs(off)) < 0.002
    assert np.sqrt(np.mean(np.square(off))) < 0.015


def test_noise_is_no_function() -> None:
    rng, claimed = np.random.default_rng(3), 0
    for _ in range(50):
        past = rng.uniform(0.25, 0.45, N_PAST)
        claimed += find_function(new_fit(), past[0], 0.0, past, RADIUS, False, 0.0, np.zeros(5))
    assert claimed == 0


def test_a_radius_seen_through_noise_is_left_to_the_networks() -> None:
    rng, claimed = np.random.default_rng(4), 0
    for phase in rng.uniform(0.0, 6.0, 30):
        now, past = seen(np.array([0.3, 0.2, phase, 1.0, 2.0]), RADIUS)
        noisy = past + 0.02 * rng.standard_normal(N_PAST)
        claimed += find_function(new_fit(), now, 0.04, noisy, RADIUS, False, 0.0, np.zeros(5))
    assert claimed <= 3


def test_a_function_stays_known_while_it_is_beyond_a_limit() -> None:
    constants, found, fit = np.array([0.05, 0.48, 1.54, -1.12, -0.83]), np.zeros(5), new_fit()
    at_limit = 0
    for k in range(200):
        age = 0.02 * (k % 5)
        now, past = seen(constants, RADIUS, age)
        assert find_function(fit, now, age, past, RADIUS, False, 0.02, found), k
        at_limit += now == RADIUS.high == past.min()
        constants[2:] += 2.0 * np.pi * np.array([1.0, 3.0, 4.0]) * constants[0] * 0.02
    assert at_limit > 10, "all that is remembered was beyond"


def test_what_was_at_a_limit_all_the_time_says_nothing() -> None:
    found = np.zeros(5)
    assert not find_function(
        new_fit(), 0.5, 0.0, np.full(N_PAST, 0.5), RADIUS, False, 0.0, found
    )
    assert not find_function(new_fit(), 0.0, 0.0, np.zeros(N_PAST), SPEED, True, 0.0, found)


def test_what_was_found_is_kept_a_period_later() -> None:
    constants = np.array([0.3, 0.2, 0.4, 1.5, -0.7])
    found, fit = np.zeros(5), new_fit()
    now, past = seen(constants, RADIUS)
    assert find_function(fit, now, 0.04, past, RADIUS, False, 0.02, found)
    kept = found.copy()
    later = constants.copy()
    later[2:] += 2.0 * np.pi * constants[0] * 0.02 * np.array([1.0, 3.0, 4.0])
    now, past = seen(later, RADIUS, age=0.06)
    assert find_function(fit, now, 0.06, past, RADIUS, False, 0.02, found)
    np.testing.assert_array_equal(found[:2], kept[:2])
