"""The outcome head: what it predicts, and that it learns rates from episodes."""

import numpy as np
import pytest
import torch

from app.policies.networks.actor_critic import ResidualActor, ResidualFading
from app.policies.networks.outcome import OutcomeHead
from app.policies.training.outcome import EPOCHS, FitStopped, OutcomeData, _widen, fit


def test_probabilities_sum_to_one_and_times_are_not_negative() -> None:
    torch.manual_seed(1)
    found = OutcomeHead(10).predict(torch.randn(50, 10), torch.randn(50))
    np.testing.assert_allclose(found.probability.sum(axis=1), 1.0, rtol=1e-5)
    assert (found.spread >= 0.0).all() and (found.time_s >= 0.0).all()


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
