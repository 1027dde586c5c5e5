"""What this project adds to Stable-Baselines3's DQN."""

import numpy as np
import pytest
import torch

from app.policies.algorithms.dqn import SortingDQN, large_margin_loss
from app.policies.algorithms.vecenv import BatchVecEnv
from app.policies.configs import presets
from app.policies.configs.fields import entries
from app.policies.networks.sorting_q import NEVER
from app.policies.training.sorting import expert_of
from app.sim.cells.cell import load_cell
from app.sim.envs.sorting import SortingTask
from app.sim.sorting.batch import SortingSettings, batch_in
from app.sim.sorting.planner import solve
from tests.policies.conftest import preset_of

SMALL = {
    "learning.n_envs": 16,
    "learning.buffer_size": 2_000,
    "learning.batch_size": 64,
    "learning.learning_starts": 64,
    "networks.width": 32,
}


def model_of(name: str = "sorting-e0-dqn", **overrides) -> SortingDQN:
    paths = {one.path.split(".")[1]: one.path for one in entries(presets.get(name))}
    overrides = {paths[key]: value for key, value in overrides.items()}
    small = {**SMALL, "learning.total_steps": 51_200, **overrides}
    preset = preset_of(name, small)
    cell = load_cell(preset.cell)
    batch = batch_in(cell, preset.learning.n_envs, 1, preset.settings(0.0))
    env = BatchVecEnv(SortingTask(cell, batch))
    expert = expert_of(batch.shape) if preset.expert.share else None
    return SortingDQN(preset, env, batch, 1, expert)


def test_random_and_greedy_moves_are_valid_moves():
    model = model_of(eps_start=0.5, eps_end=0.5)
    env = model.tasks
    model._setup_learn(51_200)
    for _ in range(60):
        valid = env.masks().copy()
        actions, _ = model._sample_action(0, n_envs=16)
        assert valid[np.arange(16), actions].all()
        model._last_obs = env.step(actions).obs.copy()


def test_the_double_target_takes_the_online_networks_move():
    model = model_of(n_steps=1, gamma=0.5, alpha=0.0)
    model.learn(640)
    drawn = model.memory.draw(32, 0.4)
    with torch.no_grad():
        online = model.q_net(drawn.next_observations)
        target = model.q_net_target(drawn.next_observations)
    moves = online.argmax(dim=1)
    wanted = drawn.rewards + drawn.discounts * target[torch.arange(32), moves]
    assert set(drawn.discounts.tolist()) <= {0.0, 0.5}
    assert torch.isfinite(wanted).all() and (wanted > NEVER / 2).all()
    # The two networks differ by now, or the test would say nothing.
    assert (target.argmax(dim=1) != moves).any() or not torch.equal(online, target)


def test_a_small_share_labels_a_state_of_each_minibatch():
    model = model_of(share=0.001)
    expert, labelled = model._expert, []

    def counting(obs):
        labelled.append(len(obs))
        return expert(obs)

    model._expert = counting
    model.learn(64 + 16 * 3)
    assert len(labelled) == model._n_updates > 0
    assert set(labelled) == {1}


def test_the_target_network_is_copied_every_so_many_updates():
    model = model_of(target_update_interval=7)
    model.learn(64 + 16 * 6)
    before = model.q_net_target.state_dict()["q_net.value.bias"].clone()
    model.train(7 - model._n_updates % 7, 64)
    after = model.q_net_target.state_dict()["q_net.value.bias"]
    assert model._n_updates % 7 == 0
    assert torch.equal(after, model.q_net.state_dict()["q_net.value.bias"])
    assert not torch.equal(before, after)


def test_advice_marks_all_moves_that_begin_a_shortest_plan():
    settings = SortingSettings(disturbed_share=0.6, random_map_share=0.5)
    batch = batch_in(load_cell("sorting-e1"), 40, 3, settings)
    marks = expert_of(batch.shape)(batch.reset())
    for e in range(40):
        assert tuple(np.flatnonzero(marks[e])) == solve(batch.state_of(e), batch.shape).first


@pytest.mark.parametrize(
    ("values", "short"),
    [([1.0, 0.5, 0.2], 0.0), ([1.0, 0.98, 0.2], 0.08), ([0.2, 0.9, 0.1], 0.8)],
)
def test_the_margin_asks_one_best_move_to_be_worth_more(values, short):
    best = torch.tensor([[True, False, False]])
    assert float(large_margin_loss(torch.tensor([values]), best, 0.1)) == pytest.approx(short)


def test_several_best_moves_need_no_margin_between_them():
    best = torch.tensor([[True, True, False]])
    values = torch.tensor([[0.1, 1.0, 0.5]])
    assert float(large_margin_loss(values, best, 0.1)) == 0.0


def test_advice_makes_best_moves_likelier():
    settings = SortingSettings(disturbed_share=0.5)
    obs = batch_in(load_cell("sorting-e0"), 400, 9, settings).reset()
    marks = expert_of(model_of().tasks.shape)(obs)
    shares = []
    for share in (0.0, 1.0):
        model = model_of(share=share)
        model.learn(64 + 16 * 150)
        with torch.no_grad():
            moves = model.q_net(torch.as_tensor(obs)).argmax(dim=1).numpy()
        shares.append(marks[np.arange(400), moves].mean())
    assert shares[1] > shares[0] + 0.1
