"""Movement primitives: formulas, derivatives, and an independent implementation."""

import math
from dataclasses import replace

import numpy as np
import pytest

from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.primitives.promp import (
    ProMP,
    basis,
    draw_like,
    fit,
    gain,
    gain_of_ends,
    moments,
    observe,
    of_weights,
    positions,
    usual_width,
)
from tests.sim import make_promp_reference as reference
from tests.sim.demonstrations import reaches

Z = np.linspace(0.0, 1.0, 41)


@pytest.fixture(scope="module")
def promp() -> ProMP:
    return fit(*reaches())


@pytest.fixture(scope="module")
def peer() -> dict[str, Vec]:
    """What the package movement_primitives gives for the same primitive."""
    with np.load(reference.FILE, allow_pickle=False) as file:
        return dict(file)


def draw_weights(promp: ProMP, n: int, rng: np.random.Generator) -> Vec:
    """Draw weights without regard to joint limits, shape (n, n_joints, n_basis)."""
    sizes, directions = np.linalg.eigh(promp.cov)
    root = directions * np.sqrt(np.clip(sizes, 0.0, None))
    away = rng.standard_normal((n, len(root))) @ root.T
    return np.asarray(promp.mean + away.reshape(n, promp.n_joints, promp.n_basis))


def test_basis_sums_to_one_and_peaks_at_its_centres() -> None:
    phi = basis(np.linspace(0.0, 1.0, 12), 12, usual_width(12))
    np.testing.assert_allclose(phi.sum(axis=1), 1.0, atol=1e-14)
    assert (phi.argmax(axis=1) == np.arange(12)).all()


def test_ridge_regression_is_that_of_its_formula() -> None:
    motion = np.random.default_rng(3).normal(size=(30, 2))
    found = fit([motion], [1.0], n_basis=5, ridge=0.01).mean
    phi = basis(np.linspace(0.0, 1.0, 30), 5, usual_width(5))
    stacked = np.vstack([phi, math.sqrt(0.01 * 30) * np.eye(5)])
    expected = np.linalg.lstsq(stacked, np.vstack([motion, np.zeros((5, 2))]), rcond=None)[0]
    np.testing.assert_allclose(found, expected.T, atol=1e-10)


def test_fit_follows_twenty_demonstrations_within_a_milliradian(promp: ProMP) -> None:
    assert promp.mean.shape == (18, 12)
    assert promp.residual.max() < 1e-3
    ends = np.array([[motion[0], motion[-1]] for motion in reaches()[0]])
    mean, cov = moments(promp, np.array([0.0, 1.0]))
    np.testing.assert_allclose(mean, ends.mean(axis=0), atol=2e-3)
    spread = np.sqrt(np.diagonal(cov, axis1=1, axis2=2))
    np.testing.assert_allclose(spread, np.hypot(ends.std(axis=0, ddof=1), 0.01), atol=3e-3)


def test_weights_of_known_spread_are_found_again() -> None:
    rng = np.random.default_rng(8)
    template = fit(*reaches(4))
    true = replace(template, cov=template.cov * 4.0)
    weights = draw_weights(true, 4000, rng)
    motions = positions(true, weights, np.linspace(0.0, 1.0, 40))
    found = fit(list(motions), np.ones(4000), floor=0.0)
    np.testing.assert_allclose(found.mean, true.mean, atol=0.03)
    np.testing.assert_allclose(moments(found, Z)[1], moments(true, Z)[1], atol=0.012)


def test_moments_are_those_of_many_draws(promp: ProMP) -> None:
    weights = draw_weights(promp, 20000, np.random.default_rng(6))
    drawn = positions(promp, weights, np.array([0.3]))[:, 0]
    mean, cov = moments(promp, np.array([0.3]))
    scale = np.sqrt(np.diag(cov[0]))
    np.testing.assert_allclose((drawn.mean(axis=0) - mean[0]) / scale, 0.0, atol=0.04)
    off = (np.cov(drawn.T) - cov[0]) / np.outer(scale, scale)
    np.testing.assert_allclose(off, 0.0, atol=0.06)


def test_moments_agree_with_the_package_movement_primitives(peer: dict[str, Vec]) -> None:
    promp, phases = reference.primitive(), reference.Z
    mean, cov = moments(promp, phases)
    np.testing.assert_allclose(mean, peer["mean"], atol=1e-9)
    np.testing.assert_allclose(cov, peer["cov"], atol=1e-9)


@pytest.mark.parametrize("k", range(len(reference.VARIANCES)))
def test_conditioning_agrees_with_the_package_movement_primitives(
    peer: dict[str, Vec], k: int
) -> None:
    start = promp = reference.primitive()
    noise = reference.VARIANCES[k] * np.eye(18)
    for phase, target in reference.via_points(start):
        rows = np.kron(np.eye(18), basis(np.array([phase]), reference.N_BASIS, promp.width))
        promp = observe(promp, rows, target, noise)
    mean, cov = moments(promp, reference.Z)
    np.testing.assert_allclose(mean, peer[f"mean_{k}"], atol=1e-6)
    np.testing.assert_allclose(cov, peer[f"cov_{k}"], atol=1e-8)


def test_observations_together_and_one_by_one_are_the_same(promp: ProMP) -> None:
    rng = np.random.default_rng(9)
    rows, values = rng.normal(size=(6, 216)), rng.normal(size=6)
    noise = np.diag(rng.uniform(0.01, 0.1, 6))
    together, singly = observe(promp, rows, values, noise), promp
    for i in range(6):
        singly = observe(
            singly, rows[i : i + 1], values[i : i + 1], noise[i : i + 1, i : i + 1]
        )
    np.testing.assert_allclose(together.mean, singly.mean, atol=1e-8)
    np.testing.assert_allclose(together.cov, singly.cov, atol=1e-9)


def test_draws_like_demonstrations_are_draws_from_their_primitive() -> None:
    rng = np.random.default_rng(4)
    weights = rng.normal(0.0, 0.2, (7, 2, 4))
    known = of_weights(weights, np.ones(7), floor=0.1)
    drawn = draw_like(weights, 40_000, rng, floor=0.1).reshape(-1, 8)
    np.testing.assert_allclose(drawn.mean(axis=0), known.mean.ravel(), atol=5e-3)
    np.testing.assert_allclose(np.cov(drawn.T), known.cov, atol=3e-3)


def test_gain_of_both_ends_is_the_gain_of_the_whole_covariance() -> None:
    weights = np.random.default_rng(5).normal(0.0, 0.3, (9, 3, 12))
    known = of_weights(weights, np.ones(9), floor=0.03)
    phi = basis(np.array([0.0, 1.0]), 12, known.width)
    rows = np.concatenate([np.kron(np.eye(3), row) for row in phi])
    expected = gain(known, rows, np.zeros((6, 6)))
    np.testing.assert_allclose(gain_of_ends(weights, 0.03), expected, atol=1e-9)


@pytest.mark.parametrize(
    ("spoil", "field"),
    [
        (lambda d, t: ([], []), "demonstrations"),
        (lambda d, t: (d, t[:-1]), "demonstrations"),
        (lambda d, t: ([d[0], d[1][:5]], t[:2]), "demonstrations[1].shape"),
        (lambda d, t: ([d[0], d[1][:, :17]], t[:2]), "demonstrations[1].shape"),
        (lambda d, t: ([np.where(d[0] == d[0][7], np.nan, d[0])], t[:1]), "demonstrations[0]["),
        (lambda d, t: (d[:1], [0.0]), "durations[0]"),
        (lambda d, t: (d[:1], [np.nan]), "durations[0]"),
    ],
)
def test_broken_demonstration_is_named(spoil, field: str) -> None:
    with pytest.raises(InvalidInput) as caught:
        fit(*spoil(*reaches(3)))
    assert caught.value.field.startswith(field)


def test_primitive_cannot_be_written_to(promp: ProMP) -> None:
    with pytest.raises(ValueError, match="read-only"):
        promp.mean[0, 0] = 1.0
