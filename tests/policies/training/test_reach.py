"""Training on the reach scenario: its curve, its checkpoints, and going on with one."""

import numpy as np
import pytest
import torch

from app.errors import InvalidInput
from app.policies.algorithms.exploration import PerEnvAR1Noise
from app.policies.algorithms.vecenv import BatchVecEnv
from app.policies.configs import presets
from app.policies.inference.reach_policy import ReachPolicy
from app.policies.training.curve import play
from app.policies.training.file_store import FileFolder
from app.policies.training.memory_files import MemoryFiles
from app.policies.training.reach import (
    batch_of,
    exploration_of,
    settings_of,
    start,
    visited_states,
)
from app.sim.cells.cell import load_cell
from app.sim.envs.tasks import ArmTask
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.monitored.batch import MonitoredReachBatch
from app.state_dict import under
from tests.policies import conftest
from tests.policies.conftest import Recorder, preset_of

TINY = {**conftest.TINY, "learning.progress_episodes": 8}


@pytest.fixture(scope="module")
def preset():
    return preset_of("reach-td3", TINY)


@pytest.fixture(scope="module")
def ran(preset):
    recorder = Recorder()
    recorder.result = recorder.run(preset)
    return recorder


def test_a_point_of_the_curve_plays_its_own_episodes(ran):
    assert [point.step for point in ran.progress] == [256, 512, 768, 1024, 1280, 1536]
    for point in ran.progress:
        assert point.episodes == 8
        assert point.success + point.collision + point.timeout == pytest.approx(1.0)


def test_the_same_seed_trains_the_same_bits(preset, ran):
    again = Recorder().run(preset)
    assert again.checkpoint.tensors == ran.result.checkpoint.tensors


def test_what_was_trained_decides_as_a_policy(preset, ran):
    policy = ReachPolicy(ran.result.checkpoint)
    batch = ReachBatch(load_cell("shared-workspace"), 4, 2, settings_of(preset))
    assert np.abs(policy.acts(batch.reset())).max() <= 1.0
    ranges = policy.trained_range
    assert set(ranges) == {"q", "qd", "goal", "human"}
    assert ranges["human"]["low"][4] >= 0.2 and ranges["human"]["high"][4] <= 0.5


def test_the_monitored_preset_trains_and_is_counted_under_the_layer():
    preset = preset_of("reach-td3-monitored", TINY)
    batch = batch_of(preset, load_cell("shared-workspace"), 16, 3)
    assert isinstance(batch, MonitoredReachBatch)
    assert batch.settings.weights.c_o == preset.reward.c_o > 0.0
    assert not isinstance(
        batch_of(preset_of("reach-td3", TINY), batch.cell, 4, 3), MonitoredReachBatch
    )
    ran = Recorder().run(preset)
    assert ReachPolicy(ran.checkpoint).acts(batch.reset()).shape == (16, 6)
    assert (batch.state.clear[:, 0] >= 0.8).all()


def test_monitoring_without_people_is_refused():
    with pytest.raises(
        InvalidInput, match=r"overrides\.episode\.safety = 'ssm' needs n_people above 0"
    ):
        preset_of("reach-td3-monitored", {"people.n_people": 0})


def test_the_reward_of_what_is_played_is_that_of_the_batch(preset):
    batch = ReachBatch(load_cell("shared-workspace"), 6, 7, settings_of(preset))
    still = torch.nn.Linear(batch.obs_size, 6)
    torch.nn.init.zeros_(still.weight)
    torch.nn.init.zeros_(still.bias)
    ended, returns = play(still, batch)
    assert set(ended.tolist()) <= {2, 3}
    steps = np.rint(batch.state.elapsed / batch.arm.dt)
    collided = ended == 2
    np.testing.assert_allclose(
        returns, -preset.reward.c_step * steps - preset.reward.c_c * collided, atol=1e-4
    )


@pytest.mark.parametrize(("sees_time", "cut"), [(True, False), (False, True)])
def test_only_where_time_is_not_seen_is_a_time_out_no_true_end(sees_time, cut):
    settings = ReachSettings(time_limit_s=0.04, people=())
    batch = ReachBatch(load_cell("shared-workspace"), 2, 1, settings)
    env = BatchVecEnv(ArmTask(batch, sees_time=sees_time))
    env.reset()
    for _ in range(2):
        _, _, done, infos = env.step(np.zeros((2, 6), dtype=np.float32))
    assert done.all()
    assert [info.get("TimeLimit.truncated", False) for info in infos] == [cut, cut]
    assert "terminal_observation" in infos[0]


def test_without_people_there_is_no_range_of_them():
    settings = settings_of(preset_of("reach-td3", {**TINY, "people.n_people": 0}))
    batch = ReachBatch(load_cell("shared-workspace"), 2, 1, settings)
    batch.reset()
    assert set(visited_states(batch)) == {"q", "qd", "goal"}


@pytest.mark.parametrize(
    ("name", "alpha", "steps", "walk"),
    [
        ("reach-ddpg-thesis", 0.6, 4_000_000, "uniform"),
        ("reach-ddpg-authors", 0.0, 5_000_000, "authors"),
    ],
)
def test_the_recipes_of_the_thesis_and_of_its_authors(name, alpha, steps, walk):
    preset = presets.get(name)
    settings, learning, networks = settings_of(preset), preset.learning, preset.networks
    assert (settings.observation, settings.goals, settings.start) == ("state", "in-turn", walk)
    assert (settings.action.meaning, settings.limits) == ("speed", "authors")
    assert (networks.layers, networks.width, networks.n_critics) == (10, 400, 1)
    assert (networks.actor, networks.critic, networks.normalisation) == (
        "ddpg",
        "ddpg",
        "running",
    )
    assert learning.lr_start * learning.actor_lr_ratio == pytest.approx(1e-3)
    assert (learning.batch_size, learning.buffer_size) == (128, 200_000)
    assert learning.n_envs * learning.update_every == 60
    assert learning.alpha == alpha
    assert learning.total_steps == pytest.approx(steps, rel=1e-3)


def test_a_time_out_ends_an_episode_of_the_recipe_for_good():
    preset = preset_of("reach-ddpg-authors", {**TINY, "networks.layers": 2})
    _, monitor = start(preset, 1, load_cell("shared-workspace"))
    assert not monitor.env._task.truncates(np.array([3])).any()


def test_a_recipe_resumes_with_its_normalisation(tmp_path):
    preset = preset_of("reach-ddpg-authors", {**TINY, "networks.layers": 2})
    memory = MemoryFiles(FileFolder(tmp_path))
    recorder = Recorder(stop_at=512, memory=memory)
    stopped = recorder.run(preset)
    counted = stopped.checkpoint.arrays()["actor.norm.count"][0]
    assert counted == pytest.approx(512.01)
    run, _ = start(preset, 3, load_cell("shared-workspace"))
    run.keep_states(memory)
    run.restore(recorder.checkpoints[-1][2])
    assert run.model._norm.count.item() == pytest.approx(counted)


@pytest.mark.parametrize(
    ("overrides", "field"),
    [
        ({"episode.goals": "moon"}, "overrides.episode.goals"),
        ({"people.n_people": 5}, "overrides.people.n_people"),
        ({"learning.gamma": 1.0}, "overrides.learning.gamma"),
        ({"action.degree": 3, "action.bounds": "one-step"}, "overrides.action.bounds"),
        ({"networks.width": 1024, "networks.layers": 8}, "overrides.networks.width"),
        ({"episode.observation": "state"}, "overrides.networks.actor"),
        ({"episode.collision": "blocks"}, "overrides.episode.collision"),
        ({"reward.c_u": 0.1}, "overrides.reward.c_u"),
        ({"reward.bonus": "alone"}, "overrides.reward.bonus"),
        ({"networks.normalisation": "running"}, "overrides.networks.normalisation"),
        ({"networks.dropped_quantiles": 25}, "overrides.networks.dropped_quantiles"),
        ({"people.count": "up-to", "people.n_people": 0}, "overrides.people.count"),
        ({"people.count": "up-to", "episode.safety": "ssm"}, "overrides.people.count"),
        (
            {"learning.learning_starts": 900_000, "learning.total_steps": 512_000},
            "overrides.learning.learning_starts",
        ),
    ],
)
def test_a_bad_override_is_refused_by_name(overrides, field):
    with pytest.raises(InvalidInput) as refused:
        preset_of("reach-td3", overrides)
    assert refused.value.field == field


@pytest.mark.parametrize(
    "option",
    [
        {"networks.critic": "quantiles", "networks.n_quantiles": 8},
        {"learning.alpha": 0.5, "learning.n_steps": 3},
        {"networks.n_critics": 3, "networks.layers": 3},
        {"episode.goals": "halton", "people.n_people": 2},
        {"episode.observation": "people-set", "people.n_people": 3, "people.count": "up-to"},
    ],
)
def test_every_option_trains_and_moves_the_actor(option):
    short = {**TINY, "learning.total_steps": 1024, "learning.checkpoint_steps": 256, **option}
    recorder = Recorder()
    recorder.run(preset_of("reach-td3", short))
    before, after = recorder.checkpoints[0][1].arrays(), recorder.checkpoints[-1][1].arrays()
    assert all(np.isfinite(array).all() for array in after.values())
    assert not np.array_equal(before["actor.net.0.weight"], after["actor.net.0.weight"])
    ReachPolicy(recorder.checkpoints[-1][1])


def test_noise_scales_do_not_grow_with_the_number_of_people():
    scales = []
    for name in ("reach-td3", "reach-td3-people-set"):
        preset = preset_of(name, TINY)
        batch = batch_of(preset, load_cell("shared-workspace"), 16, 3)
        noise = exploration_of(preset.exploration, batch, 1)
        assert isinstance(noise, PerEnvAR1Noise)
        scales.append(noise._sigma[:, 0])
    one_person, mixed = scales
    assert (np.diff(one_person) > 0.0).all()
    np.testing.assert_array_equal(np.sort(mixed), one_person)
    by_number = mixed.reshape(4, 4)
    assert (np.diff(by_number) > 0.0).all()
    assert by_number[:, 0].max() < by_number[:, -1].min()


def test_averaged_actor_normalises_like_the_trained_one():
    few = {
        "learning.n_envs": 64,
        "learning.total_steps": 1024,
        "learning.checkpoint_steps": 1024,
    }
    recorder = Recorder()
    recorder.run(preset_of("reach-ddpg-authors", {**TINY, **few, "learning.ema": 0.99}))
    counted = recorder.checkpoints[-1][1].arrays()["actor.norm.count"]
    assert counted == pytest.approx(1024, rel=0.1)


def test_averaged_weights_are_what_is_shown_and_kept(tmp_path):
    preset = preset_of("reach-td3", {**TINY, "learning.ema": 0.99})
    stopped = Recorder(stop_at=768, memory=MemoryFiles(FileFolder(tmp_path)))
    stopped.run(preset)
    _, policy, state = stopped.checkpoints[-1]
    shown, networks = policy.arrays()["actor.net.0.weight"], under(state.entries(), "networks")
    assert np.array_equal(shown, networks["actor.net.0.weight"])
    assert not np.array_equal(shown, networks["actor_learned.net.0.weight"])
