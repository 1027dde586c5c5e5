"""Value functions, the values of targets, and the networks of the recipe of chapter 5."""

import math

import pytest
import torch
from torch import nn

from app.policies.configs.pick import PICK, REACH_ONLY, THESIS, PickPreset
from app.policies.networks.actor_critic import Critics, MeanCritics, PlainActor, QNetwork
from app.policies.networks.pick import actor_of, critics_for
from app.policies.networks.quantiles import QuantileCritics


def test_targets_are_the_least_or_the_mean_of_the_values():
    obs, act = torch.randn(7, 4), torch.randn(7, 2)
    for kind, pooled in ((Critics, torch.amin), (MeanCritics, torch.mean)):
        critics = kind(*(QNetwork(16, 4, 2) for _ in range(3)))
        values = torch.cat(critics(obs, act), dim=1)
        assert torch.allclose(critics.targets(obs, act), pooled(values, dim=1, keepdim=True))


def test_the_preset_says_which():
    assert type(critics_for(PICK, 12)) is QuantileCritics
    assert type(critics_for(PickPreset(), 12)) is MeanCritics
    assert type(critics_for(REACH_ONLY, 12)) is Critics


def test_networks_of_the_recipe_are_glorot_uniform_and_normalised():
    torch.manual_seed(0)
    actor, critics = actor_of(THESIS, 51), critics_for(THESIS, 51)
    assert type(actor) is PlainActor and type(critics) is Critics
    for net, n_in, n_out in ((actor.net, 51, 5), (critics.q1, 56, 1), (critics.q2, 56, 1)):
        kinds = [type(layer) for layer in net]
        hidden = [nn.Linear, nn.LayerNorm, nn.ReLU]
        assert kinds == [*hidden, *hidden, nn.Linear]
        layers = [net[0], net[3], net[6]]
        sizes = [(one.in_features, one.out_features) for one in layers]
        assert sizes == [(n_in, 64), (64, 64), (64, n_out)]
        for one in layers:
            bound = math.sqrt(6.0 / (one.in_features + one.out_features))
            assert one.weight.abs().max() <= bound
            assert one.weight.std().item() == pytest.approx(bound / math.sqrt(3.0), rel=0.2)
            assert not one.bias.any()
