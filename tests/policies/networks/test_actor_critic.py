"""Value functions and the values of targets."""

import torch

from app.policies.configs.pick import REACH_ONLY, PickPreset
from app.policies.networks.actor_critic import Critics, MeanCritics
from app.policies.networks.pick import critics_for


def test_targets_are_the_least_or_the_mean_of_the_values():
    obs, act = torch.randn(7, 4), torch.randn(7, 2)
    for kind, pooled in ((Critics, torch.amin), (MeanCritics, torch.mean)):
        critics = kind(16, 4, 2, n_critics=3)
        values = torch.cat(critics(obs, act), dim=1)
        assert torch.allclose(critics.targets(obs, act), pooled(values, dim=1, keepdim=True))


def test_the_preset_says_which():
    assert type(critics_for(PickPreset(), 12)) is MeanCritics
    assert type(critics_for(REACH_ONLY, 12)) is Critics
