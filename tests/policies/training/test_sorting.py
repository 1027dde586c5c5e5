"""Training on the sorting task: learning, bits, checkpoints, going on."""

import numpy as np
import pytest

from app.errors import CheckpointMismatch, InvalidInput
from app.policies.configs import presets
from app.policies.inference.sorting_policy import SortingPolicy
from app.policies.training.reporter import Callbacks
from app.policies.training.sorting import SortingReporter, start
from app.sim.cells.cell import load_cell
from app.sim.sorting.batch import OUTCOMES, SortingSettings, batch_in
from app.sim.sorting.kernels.task import TIMEOUT
from tests.policies.conftest import Recorder, preset_of

SMALL = {
    "learning.total_steps": 12_800,
    "learning.n_envs": 64,
    "learning.buffer_size": 12_800,
    "learning.batch_size": 128,
    "learning.learning_starts": 1_280,
    "networks.width": 64,
    "learning.progress_steps": 6_400,
    "learning.checkpoint_steps": 6_400,
    "learning.progress_episodes": 100,
}
"""Overrides that make a training last seconds."""


@pytest.fixture(scope="module")
def small_run():
    recorder = Recorder()
    recorder.result = recorder.run(preset_of("sorting-e0-dqn", SMALL))
    return recorder


def test_the_curve_counts_steps_updates_and_greedy_episodes(small_run):
    assert [point.step for point in small_run.progress] == [6_400, 12_800]
    assert small_run.progress[-1].updates == (12_800 - 1_280) // 64
    for point in small_run.progress:
        assert point.episodes == 100 and point.collision is None
        assert point.success + point.timeout == pytest.approx(1.0)


def test_the_same_seed_trains_the_same_bits(small_run):
    again = Recorder().run(preset_of("sorting-e0-dqn", SMALL))
    assert again.checkpoint.tensors == small_run.result.checkpoint.tensors


def test_a_policy_gives_the_values_of_the_trained_network(small_run):
    checkpoint = small_run.result.checkpoint
    policy, again = SortingPolicy(checkpoint), SortingPolicy(checkpoint)
    obs = batch_in(load_cell("sorting-e0"), 20, 7).reset()
    assert np.array_equal(policy.values(obs), again.values(obs))
    assert (policy.cell, policy.shape.n_actions) == ("sorting-e0", 44)
    assert (
        len(policy.checkpoint) == 64
        and policy.title == "Sorting e0 with expert labels (DQN), 0.01 M steps"
    )
    with pytest.raises(InvalidInput, match="shape"):
        policy.values(obs[:, :-1])


def test_a_policy_that_moves_is_no_policy_that_sorts(tiny_run):
    with pytest.raises(CheckpointMismatch, match="purpose is .choosing tasks."):
        SortingPolicy(tiny_run.result.checkpoint)


@pytest.mark.parametrize(("name", "n_t"), [("e0", 2_000_000), ("e1", 8_000_000)])
def test_the_thesis_presets_have_the_defaults_of_its_library(name, n_t):
    preset = presets.get(f"sorting-{name}-thesis")
    learning, exploration = preset.learning, preset.exploration
    assert learning.gradient_steps == learning.n_envs
    assert (learning.target_update_interval, learning.learning_starts) == (500, 1_000)
    assert learning.total_steps * exploration.eps_share == n_t
    assert preset.episode.localisation_rate > 0.0
    assert preset.networks.kind == "printed"
    halfway, end = preset.settings(0.5), preset.settings(1.0)
    assert (halfway.solved_episodes, halfway.solved_share) == pytest.approx((0.25, 0.4))
    assert (end.solved_episodes, end.solved_share) == (0.0, 0.0)


@pytest.mark.parametrize(("name", "ends"), [("e0-thesis", True), ("e0-dqn", False)])
def test_a_time_out_ends_a_task_in_the_library_of_the_thesis_alone(name, ends):
    _, model = start(presets.get(f"sorting-{name}"), 1, load_cell("sorting-e0"))
    env, truncated = model.get_env(), []
    env.reset()
    while len(truncated) < 20:
        _, _, done, infos = env.step(np.zeros(env.num_envs, dtype=np.int64))
        late = done & (env.ended == TIMEOUT)
        truncated += [infos[i]["TimeLimit.truncated"] for i in np.flatnonzero(late)]
    assert set(truncated) == {not ends}


def test_the_curriculum_of_the_thesis_has_faded_at_n_t():
    small = {
        "learning.total_steps": 8_000,
        "learning.progress_steps": 4_000,
        "learning.checkpoint_steps": 8_000,
        "learning.progress_episodes": 10,
        "learning.gradient_steps": 1,
    }
    run, model = start(preset_of("sorting-e0-thesis", small), 1, load_cell("sorting-e0"))
    shares = []
    calls = Callbacks(lambda _: None, lambda *_: None, lambda: False)
    reporter = SortingReporter(run, calls, model)
    for step in (2_560, 5_120):
        model.num_timesteps = reporter.num_timesteps = step
        reporter.watch(np.zeros(40))
        shares.append(model.tasks.settings.solved_episodes)
    assert shares == pytest.approx([0.5 * (1.0 - 2_560 / 4_000), 0.0])


@pytest.mark.parametrize("name", ["sorting-e0-thesis", "sorting-e1-dqn"])
def test_other_presets_train_too(name):
    steps = {
        "learning.total_steps": 8_000,
        "learning.progress_steps": 8_000,
        "learning.checkpoint_steps": 8_000,
    }
    small = {
        **steps,
        "learning.learning_starts": 7_600,
        "learning.gradient_steps": 1,
        "learning.n_envs": 40,
        "learning.progress_episodes": 20,
    }
    result = Recorder().run(preset_of(name, small))
    arrays = result.checkpoint.arrays()
    assert all(np.isfinite(array).all() for array in arrays.values())
    assert SortingPolicy(result.checkpoint).values(
        batch_in(load_cell(result.checkpoint.manifest["cell"]), 2, 1).reset()
    ).shape == (2, result.checkpoint.manifest["act_size"])


def greedy_success(policy: SortingPolicy, n_objects: int, n_goal: int) -> float:
    """Return the share of 200 clean episodes of one size that end at the goal."""
    settings = SortingSettings(n_objects=n_objects, n_goal=n_goal)
    batch = batch_in(load_cell(policy.cell), 200, 21, settings)
    obs = batch.reset()
    for _ in range(batch.horizon):
        obs = batch.step(policy.values(obs).argmax(axis=1), auto_reset=False).obs
    return float((batch.envs.outcome == OUTCOMES.index("success")).mean())


@pytest.mark.slow
def test_a_minute_of_training_sorts_ten_objects():
    """Reproduces the learning curve of sorting-e0-dqn: above 0.99 by 256,000 steps."""
    short = {
        "learning.total_steps": 256_000,
        "learning.progress_steps": 51_200,
        "learning.checkpoint_steps": 256_000,
    }
    result = Recorder().run(preset_of("sorting-e0-dqn", short))
    policy = SortingPolicy(result.checkpoint)
    assert greedy_success(policy, 10, 10) > 0.99
    assert greedy_success(policy, 10, 3) > 0.99


def test_learning_raises_the_return_within_seconds(small_run):
    first, last = small_run.progress
    assert last.reward > first.reward
