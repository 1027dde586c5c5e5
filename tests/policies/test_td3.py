"""What this project adds to Stable-Baselines3's TD3."""

import numpy as np
import pytest
import torch

from app.policies.networks import ResidualActor, TwinCritic
from app.policies.pick_training import settings_of
from app.policies.td3 import PickTD3, twin_of
from app.policies.vecenv import PickVecEnv
from app.sim.cells import load_cell
from app.sim.kernels.features import LAYOUT, N_FEATURES
from app.sim.pick import PickBatch


@pytest.fixture
def model(tiny_preset):
    cell = load_cell("pick-and-place")
    batch = PickBatch(cell, tiny_preset.n_envs, 5, settings_of(tiny_preset))
    return PickTD3(tiny_preset, PickVecEnv(batch), 5)


def test_the_untrained_actor_follows_the_base_motion():
    torch.manual_seed(0)
    obs = torch.zeros(3, N_FEATURES)
    obs[:, LAYOUT["base"]] = torch.tensor([0.5, -1.0, 0.0, 0.2, 1.0])
    act = ResidualActor(32)(obs)
    assert torch.allclose(act, 0.9 * obs[:, LAYOUT["base"]], atol=0.05)


def test_the_least_of_both_critics_is_the_value():
    torch.manual_seed(1)
    critic, obs, act = TwinCritic(16), torch.randn(7, N_FEATURES), torch.zeros(7, 5)
    q1, q2 = critic(obs, act)
    assert torch.equal(critic.least(obs, act), torch.minimum(q1, q2).squeeze(1))


def test_the_actor_stays_frozen_while_the_critics_learn(model, tiny_preset):
    actor = [p.clone() for p in model.actor.parameters()]
    target = [p.clone() for p in model.critic_target.parameters()]
    steps = tiny_preset.learning_starts + 16 * (tiny_preset.actor_frozen_updates - 1)
    model.learn(steps)
    assert 0 < model._n_updates < tiny_preset.actor_frozen_updates
    assert all(torch.equal(a, b) for a, b in zip(actor, model.actor.parameters(), strict=True))
    moved = zip(target, model.critic_target.parameters(), strict=True)
    assert any(not torch.equal(a, b) for a, b in moved)


def test_stable_baselines_trains_the_same_modules_that_decide(model):
    obs = torch.randn(4, N_FEATURES)
    act = model.actor(obs)
    assert torch.equal(act, model.actor.mu(obs))
    assert torch.equal(model.critic(obs, act)[0], twin_of(model.critic)(obs, act)[0])


def test_greedy_rows_explore_nothing_and_noise_grows_with_the_row(model):
    exploration = model.exploration
    act = np.zeros((model.preset.n_envs, 5), dtype=np.float32)
    taken = np.stack([exploration.apply(act) for _ in range(200)])
    spread = taken.std(axis=(0, 2))
    assert np.all(spread[: exploration.n_greedy] == 0.0)
    assert spread[-1] > 2.0 * spread[exploration.n_greedy + 1] > 0.0


def test_critics_learn_the_value_of_an_episode_that_ends_at_once(model):
    """With done = 1 everywhere the value is the reward, whatever the networks say."""
    obs = np.random.default_rng(0).normal(size=(16, N_FEATURES)).astype(np.float32)
    act, reward = np.zeros((16, 5), dtype=np.float32), np.full(16, 2.5, dtype=np.float32)
    for _ in range(40):
        model.replay_buffer.add(obs, obs, act, reward, np.ones(16), [{} for _ in range(16)])
    model._setup_learn(10_000)
    for _ in range(300):
        model.train(1, 64)
    q1, _ = model.critic(torch.as_tensor(obs), torch.as_tensor(act))
    assert q1.detach().numpy() == pytest.approx(2.5, abs=0.2)
