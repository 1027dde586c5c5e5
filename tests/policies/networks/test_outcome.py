"""The outcome head: what it predicts, and that it learns rates from episodes."""

import numpy as np
import pytest
import torch
from scipy.special import expit

from app.policies.networks.actor_critic import ResidualActor, ResidualFading
from app.policies.networks.outcome import OutcomeHead
from app.policies.training.outcome import (
    EPOCHS,
    FitStopped,
    OutcomeData,
    _widen,
    fit,
    offsets_between,
)


def test_probabilities_sum_to_one_and_times_are_not_negative() -> None:
    torch.manual_seed(1)
    found = OutcomeHead(10).predict(torch.randn(50, 10), torch.randn(50))
    np.testing.assert_allclose(found.probability.sum(axis=1), 1.0, rtol=1e-5)
    assert (found.low <= found.probability).all() and (found.time_s >= 0.0).all()
    assert (found.probability <= found.high).all()


@pytest.mark.parametrize(("n", "error"), [(20_000, 0.05), (900, 0.2)])
def test_a_fit_recovers_a_rate_that_depends_on_one_input(n: int, error: float) -> None:
    rng = np.random.default_rng(2)
    obs = rng.normal(size=(n, 4)).astype(np.float32)
    chance = 1.0 / (1.0 + np.exp(-2.0 * obs[:, 1]))
    label = np.where(rng.random(n) < chance, 0, 1)
    value = np.zeros(n, dtype=np.float32)
    time_s = np.full(n, 3.0, dtype=np.float32)
    data = OutcomeData(obs, value, label, time_s, np.arange(n))
    head = fit(data, seed=1, should_stop=lambda: False)
    probe = torch.zeros(3, 4)
    probe[:, 1] = torch.tensor([-1.0, 0.0, 1.0])
    found = head.predict(probe, torch.zeros(3))
    expected = 1.0 / (1.0 + np.exp(-2.0 * probe[:, 1].numpy()))
    np.testing.assert_allclose(found.probability[:, 0], expected, atol=error)
    assert found.probability[:, 2].max() < error
    np.testing.assert_allclose(found.time_s, 3.0, atol=0.3)


def test_times_that_are_skewed_have_their_mean_as_expected_time() -> None:
    """Most successes take 2 s, a tenth of them 12 s: the median is 2 s, the mean 3 s."""
    rng, n = np.random.default_rng(2), 20_000
    obs = rng.normal(size=(n, 4)).astype(np.float32)
    time_s = np.where(rng.random(n) < 0.1, 12.0, 2.0).astype(np.float32)
    zeros = np.zeros(n, dtype=np.float32)
    data = OutcomeData(obs, zeros, zeros.astype(np.int64), time_s, np.arange(n))
    found = fit(data, 1, lambda: False).predict(torch.zeros(1, 4), torch.zeros(1))
    np.testing.assert_allclose(found.time_s, 3.0, atol=0.3)


def test_small_errors_of_certain_outcomes_widen_no_interval() -> None:
    """Three equal members predict 99.93 %, and all succeed: the spread is 0, the error not."""
    head, n = OutcomeHead(1), 1000
    for member in head.members:
        torch.nn.init.zeros_(member[-1].weight)
        member[-1].bias.data = torch.tensor([8.0, 0.0, 0.0, 3.0])
    zero = np.zeros(n, dtype=np.float32)
    data = OutcomeData(zero[:, None], zero, np.zeros(n, dtype=np.int64), zero, np.arange(n))
    _widen(head, data, np.ones(n, dtype=bool))
    assert float(head.widen) == 1.0


def certain_head(odds: float) -> OutcomeHead:
    """Return an ensemble of equal members: success or contact, at the same odds everywhere."""
    head = OutcomeHead(1)
    for member in head.members:
        torch.nn.init.zeros_(member[-1].weight)
        member[-1].bias.data = torch.tensor([odds, 0.0, -30.0, 3.0])
    return head


def cell_with(rate: float, n: int, rng: np.random.Generator) -> OutcomeData:
    """Return n episodes of two equal observations each; a share succeeds, others touch."""
    won = np.repeat(rng.random(n) < rate, 2)
    zero, episode = np.zeros(2 * n, dtype=np.float32), np.repeat(np.arange(n), 2)
    return OutcomeData(zero[:, None], zero, np.where(won, 0, 1), zero, episode)


def test_a_further_cell_lies_between_the_offsets_of_39_in_95_of_100_cases() -> None:
    """Offsets are skewed: many cells have a little less success, few have a lot more."""
    rng, head, inside = np.random.default_rng(5), certain_head(1.5), []
    for _ in range(20):
        rates = expit(1.2 + 0.3 * rng.exponential(size=39))
        found = offsets_between(head, [cell_with(rate, 1000, rng) for rate in rates])
        head.between.copy_(torch.as_tensor(found))
        one = head.predict(torch.zeros(1, 1), torch.zeros(1))
        new = expit(1.2 + 0.3 * rng.exponential(size=1000))
        inside.append(((one.low[0, 0] <= new) & (new <= one.high[0, 0])).mean())
    assert np.mean(inside) == pytest.approx(0.95, abs=0.025)


def test_the_offset_of_a_cell_is_that_of_its_rate_and_finite_without_an_outcome() -> None:
    """Offsets to one side count as 0 to the other; without a contact there is a prior."""
    rng = np.random.default_rng(6)
    cells = [cell_with(rate, 5000, rng) for rate in (expit(0.5), expit(1.0))]
    found = offsets_between(certain_head(1.5), cells)
    np.testing.assert_allclose(found[0], (-1.0, 0.0), atol=0.1)
    np.testing.assert_allclose(found[1], (0.0, 1.0), atol=0.1)
    never = offsets_between(certain_head(1.5), [cell_with(1.0, 5000, rng)])
    assert np.isfinite(never).all() and never[1, 0] < -4.0
    unforeseen = offsets_between(certain_head(-7.0), [cell_with(0.4, 5000, rng)])
    np.testing.assert_allclose(unforeseen[0], (0.0, 6.6), atol=0.1)


def test_a_fit_stops_between_two_passes_over_the_data() -> None:
    rng, passes = np.random.default_rng(2), iter(range(100))
    obs, label = rng.normal(size=(200, 4)).astype(np.float32), rng.integers(3, size=200)
    value, time_s = np.zeros((2, 200), dtype=np.float32)
    data = OutcomeData(obs, value, label, time_s, np.arange(200))
    with pytest.raises(FitStopped):
        fit(data, seed=1, should_stop=lambda: next(passes) == EPOCHS + 1)
    assert next(passes) == EPOCHS + 2


@pytest.mark.parametrize(("distance", "share"), [(0.2, 1.0), (0.9, 0.5), (1.5, 0.0)])
def test_the_residual_fades_with_the_distance_to_people(distance: float, share: float) -> None:
    torch.manual_seed(3)
    free = ResidualActor(16, 12, n_act=2, base=4)
    torch.manual_seed(3)
    faded = ResidualActor(16, 12, n_act=2, base=4, fade=ResidualFading(7, 0.8, 1.0))
    obs = torch.randn(5, 12)
    obs[:, 4:6] = obs[:, 4:6].clamp(-0.9, 0.9)
    obs[:, 7] = distance
    expected = share * free(obs) + (1.0 - share) * obs[:, 4:6]
    torch.testing.assert_close(faded(obs), expected)
