"""What is forecast of a walker: the networks in the kernel, and simple people."""

import numpy as np
import pytest

from app.sim.people.kernels.pedestrian import N_PAST
from app.sim.prediction.kernels.networks import (
    N_TIMES,
    RADIUS_MIDDLE,
    RADIUS_SCALE,
    SPEED_MIDDLE,
    SPEED_SCALE,
    STEP_S,
    layer,
    predict_pedestrian,
)
from app.sim.prediction.weights import new_motion_predictor

TIMES = STEP_S * np.arange(1, N_TIMES + 1)


def predicted(
    r: float, growth: float, speed: float, age: float, radii: np.ndarray, speeds: np.ndarray
) -> np.ndarray:
    out = np.full((N_TIMES, 2), np.nan)
    predict_pedestrian(new_motion_predictor(), r, growth, speed, age, radii, speeds, out)
    return out


def test_the_kernel_computes_the_networks() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        radii, speeds = rng.uniform(0.2, 0.5, N_PAST), rng.uniform(0.0, 1.0, N_PAST)
        r, growth, speed, age = 0.3, 0.7, 0.8, 0.04
        net = new_motion_predictor()
        seen = np.r_[(r - RADIUS_MIDDLE) / RADIUS_SCALE, growth, age / 0.1]
        seen = np.r_[seen, (radii - RADIUS_MIDDLE) / RADIUS_SCALE]
        radius = r + RADIUS_SCALE * _said(net.radius, seen)
        seen = np.r_[(speed - SPEED_MIDDLE) / SPEED_SCALE, 0.0, age / 0.1]
        seen = np.r_[seen, (speeds - SPEED_MIDDLE) / SPEED_SCALE]
        path = np.maximum(0.0, TIMES * (speed + SPEED_SCALE * _said(net.path, seen)))
        found = predicted(r, growth, speed, age, radii, speeds)
        np.testing.assert_allclose(found, np.stack([radius, path], axis=1), atol=2e-5)


def _said(net, seen: np.ndarray) -> np.ndarray:
    hidden = np.maximum(seen.astype(np.float32) @ net.w1 + net.b1, 0.0)
    return np.maximum(hidden @ net.w2 + net.b2, 0.0) @ net.w3 + net.b3


@pytest.mark.parametrize("n_nonzero", [0, 1, 3, 4, 5, 7, 11])
@pytest.mark.parametrize("rectified", [True, False])
def test_a_layer_leaves_out_no_input_but_zeros(n_nonzero: int, rectified: bool) -> None:
    rng = np.random.default_rng(n_nonzero)
    x, nonzero = np.zeros(11, dtype=np.float32), np.zeros(11, dtype=np.int64)
    x[rng.permutation(11)[:n_nonzero]] = 1.0 + rng.random(n_nonzero)
    w, b = rng.normal(size=(11, 20)).astype(np.float32), rng.normal(size=20).astype(np.float32)
    out = np.full(20, np.nan, dtype=np.float32)
    layer(x, w, b, rectified, nonzero, out)
    expected = x @ w + b
    np.testing.assert_allclose(
        out, np.maximum(expected, 0.0) if rectified else expected, atol=1e-5
    )


@pytest.mark.parametrize("r", [0.22, 0.35, 0.48])
def test_who_was_always_the_same_stays_about_so(r: float) -> None:
    found = predicted(r, 0.0, 0.6, 0.0, np.full(N_PAST, r), np.full(N_PAST, 0.6))
    assert np.abs(found[:12, 0] - r).max() < 0.06
    assert np.abs(found[:12, 1] - 0.6 * TIMES[:12]).max() < 0.08


def test_who_stands_and_stood_goes_nowhere() -> None:
    found = predicted(0.3, 0.0, 0.0, 0.0, np.full(N_PAST, 0.3), np.zeros(N_PAST))
    assert found[:, 1].max() < 0.06


def test_a_wave_is_recognised() -> None:
    """A radius that went up and down twice in the last second will be wide when it was."""
    t = -0.1 * np.arange(N_PAST)
    wave = lambda s: 0.35 + 0.1 * np.sin(2.0 * np.pi * 0.5 * s + 0.3)  # noqa: E731
    growth = 0.1 * np.pi * np.cos(0.3)
    found = predicted(wave(0.0), growth, 0.6, 0.0, wave(t), np.full(N_PAST, 0.6))
    assert np.abs(found[:, 0] - wave(TIMES)).mean() < 0.06
    assert np.abs(found[:, 0] - wave(TIMES)).mean() < np.abs(wave(0.0) - wave(TIMES)).mean()
