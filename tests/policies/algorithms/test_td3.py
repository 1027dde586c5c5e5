"""What this project adds to Stable-Baselines3's TD3."""

import numpy as np
import pytest
import torch

from app.policies.algorithms.exploration import OptionExploration, OUNoise, PerEnvAR1Noise
from app.policies.algorithms.prioritized_replay import PrioritisedReplay
from app.policies.algorithms.td3 import BatchTD3, critics_of
from app.policies.configs.reach import ReachExploration
from app.policies.configs.td3 import NoiseExploration
from app.policies.networks.actor_critic import Critics, PlainActor, QNetwork, ResidualActor
from app.policies.training import pick as pick_training
from app.policies.training import reach as reach_training
from app.policies.training.run import TrainingRun
from app.sim.cells.cell import Cell, load_cell
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.pick.kernels.observation_layout import LAYOUT, N_FEATURES, N_PICK
from tests.policies.conftest import preset_of


def model_of(run: TrainingRun) -> BatchTD3:
    assert isinstance(run.model, BatchTD3)
    return run.model


@pytest.fixture
def model(tiny_preset):
    cell = load_cell("pick-and-place")
    run, _ = pick_training.start(tiny_preset, 5, cell)
    return model_of(run)


def test_the_untrained_actor_follows_the_base_motion():
    torch.manual_seed(0)
    obs = torch.zeros(3, N_FEATURES)
    obs[:, LAYOUT["base"]] = torch.tensor([0.5, -1.0, 0.0, 0.2, 1.0])
    act = ResidualActor(32)(obs)
    assert torch.allclose(act, 0.9 * obs[:, LAYOUT["base"]], atol=0.05)


def test_the_least_of_both_critics_is_the_value():
    torch.manual_seed(1)
    critic = Critics(QNetwork(16, N_FEATURES, 5), QNetwork(16, N_FEATURES, 5))
    obs, act = torch.randn(7, N_FEATURES), torch.zeros(7, 5)
    q1, q2 = critic(obs, act)
    assert torch.equal(critic.least(obs, act), torch.minimum(q1, q2).squeeze(1))


def test_the_actor_stays_frozen_while_the_critics_learn(model, tiny_preset):
    learning = tiny_preset.learning
    actor = [p.clone() for p in model.actor.parameters()]
    target = [p.clone() for p in model.critic_target.parameters()]
    steps = learning.learning_starts + 16 * (learning.actor_frozen_updates - 1)
    model.learn(steps)
    assert 0 < model._n_updates < learning.actor_frozen_updates
    assert all(torch.equal(a, b) for a, b in zip(actor, model.actor.parameters(), strict=True))
    moved = zip(target, model.critic_target.parameters(), strict=True)
    assert any(not torch.equal(a, b) for a, b in moved)


def test_stable_baselines_trains_the_same_modules_that_decide(model):
    obs = torch.randn(4, N_PICK)
    act = model.actor(obs)
    assert torch.equal(act, model.actor.mu(obs))
    assert torch.equal(model.critic(obs, act)[0], critics_of(model.critic)(obs, act)[0])


def test_greedy_rows_explore_nothing_and_noise_grows_with_the_row(model):
    exploration = model.exploration
    act = np.zeros((model.n_envs, 5), dtype=np.float32)
    taken = np.stack([exploration.apply(act) for _ in range(200)])
    spread = taken.std(axis=(0, 2))
    assert np.all(spread[: exploration.n_greedy] == 0.0)
    assert spread[-1] > 2.0 * spread[exploration.n_greedy + 1] > 0.0


@pytest.mark.parametrize("n_envs", [2, 3, 9])
def test_noise_of_the_last_row_has_the_largest_scale(n_envs):
    config = NoiseExploration(sigma_max=0.4)
    noise = PerEnvAR1Noise((n_envs, 5), 0.05, config, np.random.default_rng(1))
    assert noise._sigma[noise.n_greedy - 1 :: n_envs - 1].tolist() == [[0.0], [0.4]]


def test_critics_learn_the_value_of_an_episode_that_ends_at_once(model):
    """With done = 1 everywhere the value is the reward, whatever the networks say."""
    obs = np.random.default_rng(0).normal(size=(16, N_PICK)).astype(np.float32)
    act, reward = np.zeros((16, 5), dtype=np.float32), np.full(16, 2.5, dtype=np.float32)
    for _ in range(40):
        model.replay_buffer.add(obs, obs, act, reward, np.ones(16), [{} for _ in range(16)])
    model._setup_learn(10_000)
    for _ in range(900):
        model.train(1, 64)
    quantiles, _ = model.critic(torch.as_tensor(obs), torch.as_tensor(act))
    assert quantiles.shape == (16, 25)
    assert quantiles.detach().mean(dim=1).numpy() == pytest.approx(2.5, abs=0.1)


@pytest.fixture(scope="module")
def ddpg() -> BatchTD3:
    """The thesis recipe with small networks."""
    small = {
        "learning.total_steps": 6000,
        "learning.progress_steps": 3000,
        "learning.progress_episodes": 4,
        "learning.checkpoint_steps": 3000,
        "learning.buffer_size": 2000,
        "networks.width": 16,
        "learning.batch_size": 16,
    }
    preset = preset_of("reach-ddpg-thesis", small)
    run, _ = reach_training.start(preset, 3, load_cell("shared-workspace"))
    return model_of(run)


def test_ddpg_is_td3_with_one_critic_and_updates_every_sixty_steps(ddpg):
    ddpg.learn(720)
    assert ddpg._n_updates == (720 - 120) // 60
    assert len(list(critics_of(ddpg.critic).children())) == 1
    linear = [m for m in ddpg.actor.mu.modules() if isinstance(m, torch.nn.Linear)]
    assert len(linear) == 11
    critic = ddpg.critic.optimizer.param_groups[0]["lr"]
    assert ddpg.actor.optimizer.param_groups[0]["lr"] == pytest.approx(10.0 * critic)


def test_all_networks_of_ddpg_share_the_counted_observations(ddpg):
    norm = ddpg._norm
    shared = [ddpg.actor.mu.norm, ddpg.actor_target.mu.norm]
    shared += [critics_of(one).q1.norm for one in (ddpg.critic, ddpg.critic_target)]
    assert all(one is norm for one in shared)
    assert norm.count.item() == pytest.approx(720.01)


def test_prioritised_replay_learns_where_the_errors_are(ddpg):
    assert isinstance(ddpg.replay_buffer, PrioritisedReplay)
    before = ddpg.replay_buffer._tree[1]
    ddpg.train(1, 16)
    ddpg.num_timesteps = 780
    ddpg.train(1, 16)
    assert ddpg.replay_buffer._tree[1] != before


def test_the_plain_actor_sees_the_first_numbers_and_holds_still_at_first():
    torch.manual_seed(0)
    actor, obs = PlainActor(32, 7, 6), torch.randn(50, 9)
    act = actor(obs)
    assert act.shape == (50, 6) and act.abs().max() < 0.1
    assert torch.equal(act, actor(obs[:, :7]))


def options_of(cell: Cell, rate: float) -> tuple[PickBatch, OptionExploration]:
    """Return 16 environments of a cell, and their exploration by options without noise."""
    batch = PickBatch(cell, 16, 1, PickSettings())
    batch.reset()
    rng, silent = np.random.default_rng(3), NoiseExploration(sigma_max=0.0)
    noise = PerEnvAR1Noise((16, 5), batch.arm.dt, silent, rng)
    return batch, OptionExploration(noise, batch, batch.world.station_q, rate, rng)


def test_options_take_over_in_every_second_noisy_row():
    batch, explorer = options_of(load_cell("pick-and-place"), 0.5)
    still = np.zeros((16, 5), dtype=np.float32)
    changed = np.zeros(16, dtype=bool)
    for _ in range(200):
        taken = explorer.apply(still)
        assert np.abs(taken).max() <= 1.0
        changed |= taken.any(axis=1)
        batch.step(taken)
    assert changed.tolist() == [row >= explorer.n_greedy and row % 2 == 0 for row in range(16)]


def test_options_move_joints_with_other_speed_limits_straight():
    cell = load_cell("pick-and-place")
    limits = np.array([0.5, 1.0, 0.25, 2.0, 3.2])
    robot = cell.robot.model_copy(update={"qd_max": (*limits, 3.2)})
    batch, explorer = options_of(cell.model_copy(update={"robot": robot}), 1.0)
    acts = explorer.apply(np.zeros((16, 5), dtype=np.float32))
    for act, goal, q in zip(acts, explorer._goal, batch.state.q[:, :5], strict=True):
        if act.any():
            motion = (goal - q) / limits
            np.testing.assert_allclose(act / act[0], motion / motion[0], rtol=1e-5)
    assert acts.any()


def test_ornstein_uhlenbeck_noise_pulls_and_pushes_by_its_time_step():
    """theta 0.3, sigma 0.15, dt 0.01: a pull of 0.003 and a push of 0.015 per period."""
    started, config = np.ones(2, dtype=bool), ReachExploration()
    noise = OUNoise((2, 6), config, lambda: started, np.random.default_rng(2))
    still, drawn = np.zeros((2, 6), dtype=np.float32), np.random.default_rng(2)
    first = 0.015 * drawn.standard_normal((2, 6))
    assert noise.apply(still) == pytest.approx(first, rel=1e-5)
    started[:] = [False, True]
    second = 0.015 * drawn.standard_normal((2, 6))
    second[0] += (1.0 - 0.003) * first[0]
    assert noise.apply(still) == pytest.approx(second, rel=1e-5)
