"""Networks of DDPG: initialisation, normalisation and the place of the action."""

import math

import pytest
import torch
from torch import nn

from app.policies.networks.actor_critic import Critics
from app.policies.networks.ddpg import DDPGActor, LateActionQ, RunningNormalisation


def linear_layers(module: nn.Module) -> list[nn.Linear]:
    return [layer for layer in module.modules() if isinstance(layer, nn.Linear)]


def test_hidden_weights_are_glorot_uniform_and_last_ones_small():
    torch.manual_seed(0)
    layers = linear_layers(DDPGActor(400, 20, 6, 10, None))
    assert [(one.in_features, one.out_features) for one in layers] == [
        (20, 400),
        *[(400, 400)] * 9,
        (400, 6),
    ]
    for one in layers[:-1]:
        bound = math.sqrt(6.0 / (one.in_features + one.out_features))
        assert one.weight.abs().max() <= bound
        assert one.weight.std().item() == pytest.approx(bound / math.sqrt(3.0), rel=0.02)
    assert 2.9e-3 < layers[-1].weight.abs().max() <= 3e-3
    assert all(not one.bias.any() for one in layers)


def test_the_action_enters_after_the_first_layer_of_the_critic():
    torch.manual_seed(1)
    layers = linear_layers(LateActionQ(8, 4, 2, 3, None))
    sizes = [(one.in_features, one.out_features) for one in layers]
    assert sizes == [(4, 8), (10, 8), (8, 8), (8, 1)]
    value = LateActionQ(1, 1, 1, 2, None)
    with torch.no_grad():
        for one, weight in zip(
            linear_layers(value), ([[2.0]], [[3.0, 5.0]], [[7.0]]), strict=True
        ):
            one.weight.copy_(torch.tensor(weight))
    assert value(torch.tensor([[1.5, 0.5]])).item() == pytest.approx(7 * (3 * 3.0 + 5 * 0.5))


def test_observations_are_normalised_by_their_running_moments_and_clipped():
    norm = RunningNormalisation(2)
    norm.update(torch.tensor([[1.0, 0.0], [3.0, 0.0]]))
    norm.update(torch.tensor([[8.0, 0.0]]))
    count = 3.01
    mean = 12.0 / count
    deviation = math.sqrt((74.0 + 0.01) / count - mean**2)
    seen = norm(torch.tensor([[6.0, 0.2], [900.0, -0.9]]))
    assert seen[0].tolist() == pytest.approx([(6.0 - mean) / deviation, 2.0], rel=1e-5)
    assert seen[1].tolist() == [5.0, -5.0]


def test_networks_share_one_normalisation_and_checkpoints_keep_it():
    norm = RunningNormalisation(3)
    actor, critics = DDPGActor(8, 3, 2, 2, norm), Critics(LateActionQ(8, 3, 2, 2, norm))
    obs, act = torch.randn(50, 3) * 4.0 + 1.0, torch.zeros(50, 2)
    before = critics.least(obs, act)
    norm.update(obs)
    assert not torch.equal(critics.least(obs, act), before)
    other = DDPGActor(8, 3, 2, 2, RunningNormalisation(3))
    other.load_state_dict(actor.state_dict())
    assert torch.equal(other(obs), actor(obs))
    assert not list(norm.parameters())
