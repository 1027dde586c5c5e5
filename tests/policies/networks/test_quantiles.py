"""Distributional critics: which quantiles targets keep, and what they learn."""

import numpy as np
import pytest
import torch

from app.policies.networks.actor_critic import QNetwork
from app.policies.networks.quantiles import QuantileCritics, quantile_loss


def test_targets_leave_out_the_highest_quantiles_of_all_critics():
    torch.manual_seed(0)
    critics = QuantileCritics(*(QNetwork(16, 4, 2, n_values=5) for _ in range(3)), dropped=2)
    obs, act = torch.randn(7, 4), torch.randn(7, 2)
    with torch.no_grad():
        everything = torch.cat(critics(obs, act), dim=1)
        kept = critics.targets(obs, act)
    assert everything.shape == (7, 15) and kept.shape == (7, 9)
    assert torch.equal(kept.sort(dim=1).values, everything.sort(dim=1).values[:, :9])
    assert torch.allclose(critics.first(obs, act).detach()[:, 0], everything.mean(dim=1))
    means = everything.reshape(7, 3, 5).mean(dim=2)
    assert torch.allclose(critics.least(obs, act).detach(), means.amin(dim=1))


def test_quantiles_of_a_known_distribution_are_learned():
    torch.manual_seed(1)
    critics = QuantileCritics(QNetwork(32, 1, 1, n_values=9), dropped=0)
    adam = torch.optim.Adam(critics.parameters(), 3e-3)
    obs, act = torch.zeros(256, 1), torch.zeros(256, 1)
    for _ in range(600):
        target = 30.0 * torch.rand(256, 1)
        loss, errors = critics.loss(obs, act, target, None)
        adam.zero_grad()
        loss.backward()
        adam.step()
    assert errors.shape == (256,)
    with torch.no_grad():
        found = critics(obs[:1], act[:1])[0][0].numpy()
    np.testing.assert_allclose(found, 30.0 * (np.arange(9) + 0.5) / 9, atol=2.0)


def test_weights_scale_the_loss_of_their_rows():
    torch.manual_seed(2)
    critics = QuantileCritics(*(QNetwork(8, 2, 1, n_values=25) for _ in range(2)), dropped=2)
    obs, act, target = torch.randn(6, 2), torch.randn(6, 1), torch.randn(6, 3)
    even, _ = critics.loss(obs, act, target, torch.ones(6, 1))
    plain, _ = critics.loss(obs, act, target, None)
    first, _ = critics.loss(obs, act, target, torch.eye(6)[:, :1])
    alone, _ = critics.loss(obs[:1], act[:1], target[:1], None)
    assert even.item() == pytest.approx(plain.item(), rel=1e-6)
    assert first.item() == pytest.approx(alone.item() / 6.0, rel=1e-5)


def test_loss_and_gradient_are_those_of_the_printed_formula():
    torch.manual_seed(3)
    predicted = (3.0 * torch.randn(40, 7)).requires_grad_()
    target, shares = 3.0 * torch.randn(40, 11), torch.rand(40)
    levels = (torch.arange(7) + 0.5) / 7
    error = target[:, None, :] - predicted[:, :, None]
    huber = torch.where(error.abs() > 1.0, error.abs() - 0.5, 0.5 * error**2)
    tilted = (levels[None, :, None] - (error < 0.0).float()).abs() * huber
    printed = (shares * tilted.mean(dim=(1, 2))).sum()
    expected = torch.autograd.grad(printed, predicted)[0]
    loss = quantile_loss(predicted, target, shares)
    found = torch.autograd.grad(loss, predicted)[0]
    assert loss.item() == pytest.approx(printed.item(), rel=1e-5)
    torch.testing.assert_close(found, expected, rtol=1e-4, atol=1e-6)
