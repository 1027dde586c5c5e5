"""Training on the pick scenario: collision cost, curriculum, layer, recipe of the thesis."""

import numpy as np
import pytest
import torch

from app.policies.configs.pick import MONITORED, REACH_ONLY, THESIS, PickNetworks, PickPreset
from app.policies.inference.value_networks import ValueNetworks
from app.policies.networks.pick import actor_of, critics_for
from app.policies.training.outcome import collect
from app.policies.training.pick import (
    batch_of,
    collision_cost,
    curve_batch,
    people_of_cells,
    settings_of,
    start,
    start_range,
)
from app.sim.cells.cell import load_cell
from app.sim.pick.batch import DEFAULT_WEIGHTS, PickBatch
from app.sim.pick.curriculum_batch import CurriculumPickBatch
from app.sim.pick.kernels.observation_layout import SCALARS, TIME_SCALE
from app.sim.pick.monitored_batch import MonitoredPickBatch
from app.sim.scenario.kernels.episode import COLLISION, TIMEOUT
from tests.policies.conftest import Recorder, preset_of
from tests.sim.driven_batches import drive

CELL = load_cell("pick-and-place")


def test_the_collision_cost_grows_linearly_and_then_stays():
    preset = PickPreset()
    total = preset.learning.total_steps
    costs = [collision_cost(preset, step) for step in (0, total // 2, total, 2 * total)]
    assert costs == pytest.approx([5.0, 7.5, 10.0, 10.0])
    assert collision_cost(REACH_ONLY, 1_000_000) == REACH_ONLY.reward.c_c


def test_rewards_contain_the_cost_that_was_set():
    batch = PickBatch(CELL, 64, 3, settings_of(PickPreset()))
    batch.reset()
    batch.set_collision_cost(100.0)
    act, costs = np.ones((64, 5), dtype=np.float32), []
    for _ in range(120):
        result = batch.step(act)
        costs += result.rew[result.ended == COLLISION].tolist()
    assert costs and max(costs) < -95.0


def test_outcomes_are_learned_from_episodes_of_any_length():
    """Half of the episodes are shortened, and their labels obey the time they were given."""
    preset = PickPreset()
    batch = batch_of(preset, CELL, 32, 3)
    networks = (make(preset, batch.obs_size) for make in (actor_of, critics_for))
    data = collect(batch, *networks, n_steps=420, seed=3, should_stop=lambda: False)
    first = np.unique(data.episode, return_index=True)[1]
    seen = TIME_SCALE * data.obs[:, SCALARS + 3]
    left = seen[first]
    usual = np.isin(left.round(2), (preset.episode.short_limit_s, preset.episode.time_limit_s))
    assert 0.3 < usual.mean() < 0.7
    assert left.min() < 2.0
    assert (data.time_s <= seen + 1e-3).all()
    timeout = data.label[first] == 2
    assert data.time_s[first][timeout] == pytest.approx(left[timeout], abs=1e-3)


def test_every_episode_that_begins_within_the_steps_is_learned_to_its_end():
    preset = PickPreset()
    batch = batch_of(preset, CELL, 24, 3)
    networks = [make(preset, batch.obs_size) for make in (actor_of, critics_for)]
    data = collect(batch, *networks, n_steps=1, seed=3, should_stop=lambda: False)
    assert np.unique(data.episode).tolist() == list(range(24))
    assert data.time_s.min() > 0.0 and data.time_s.max() > 1.0
    none = collect(batch, *networks, n_steps=0, seed=3, should_stop=lambda: False)
    assert len(none.obs) == 0


def test_people_of_a_cell_are_of_one_kind_and_cells_are_drawn_as_episodes_are():
    people = PickPreset().people
    cells = people_of_cells(people, 2000, seed=3)
    paces = np.array([one.human_pace for one in cells])
    assert all(one.human_pace == one.human_pace_max and not one.human_absent for one in cells)
    assert 0.6 <= paces.min() < 0.65 and 1.9 < paces.max() <= 2.0
    assert paces.mean() == pytest.approx(0.6 + 1.4 / 3.0, abs=0.04)
    for field, share in (("human_off_task", 0.3), ("human_at_rest", 0.25)):
        drawn = [getattr(one, field) for one in cells]
        assert set(drawn) == {0.0, 1.0} and np.mean(drawn) == pytest.approx(share, abs=0.04)
    two = np.mean([one.n_people == 2 for one in cells])
    assert two == pytest.approx(0.65**2, abs=0.04)
    assert people_of_cells(people, 5, seed=3) == cells[:5]


def test_monitored_preset_steps_under_the_layer_with_the_settings_of_the_cell():
    preset = MONITORED
    batch = batch_of(preset, CELL, 16, 3)
    assert isinstance(batch, MonitoredPickBatch)
    assert batch.safety.protective_distance == CELL.safety.protective_distance == 0.0
    assert settings_of(preset) == settings_of(PickPreset())
    drive(batch, 100, seed=0)
    assert batch.episode.sum() > 0
    runs = batch.runs()
    ended = batch.episode > 0
    assert (runs.override[ended] <= 1.0 + 1e-9).all()
    assert not isinstance(batch_of(PickPreset(), CELL, 2, 3), MonitoredPickBatch)


def test_curve_is_measured_in_uniform_episodes_under_the_layer_of_the_training():
    monitored = MONITORED.model_copy(
        update={"learning": MONITORED.learning.model_copy(update={"progress_episodes": 4})}
    )
    assert isinstance(curve_batch(monitored, CELL), MonitoredPickBatch)
    batch = curve_batch(THESIS, CELL)
    assert type(batch) is PickBatch and batch.n_envs == THESIS.learning.progress_episodes


def test_plain_actors_have_glorot_initialised_critics_of_either_kind():
    for kind in ("mean", "quantiles"):
        networks = PickNetworks(actor="plain", critic=kind, width=16)
        critics = critics_for(THESIS.model_copy(update={"networks": networks}), 45)
        biases = [
            layer.bias for layer in critics.modules() if isinstance(layer, torch.nn.Linear)
        ]
        assert biases and all((bias == 0.0).all() for bias in biases)


def test_the_recipe_is_tables_5_1_and_5_2():
    learning, settings = THESIS.learning, settings_of(THESIS)
    assert (learning.total_steps, learning.buffer_size) == (4_000_000, 500_000)
    assert (learning.batch_size, learning.policy_delay) == (64, 3)
    assert (learning.lr_start, learning.lr_end, learning.actor_lr_ratio) == (1e-4, 1e-4, 1.0)
    assert (learning.gamma, learning.tau, learning.n_steps) == (0.99, 0.001, 1)
    assert learning.gradient_steps == learning.n_envs  # one update per environment step
    assert learning.alpha == 0.0  # table 5.2 has no priorities
    assert (learning.progress_steps, learning.progress_episodes) == (50_000, 200)
    assert THESIS.exploration.parameter_sigma == 0.5
    assert (settings.time_limit_s, settings.observation) == (20.0, "state")
    assert settings.action.meaning == "coefficient"
    assert settings.weights == DEFAULT_WEIGHTS
    assert (settings.target_jitter_m, settings.anywhere_share, settings.short_share) == (0,) * 3
    assert settings.grasp.depth == 0.0
    assert collision_cost(THESIS, 0) == collision_cost(THESIS, 4_000_000) == 1.0


@pytest.mark.parametrize(
    ("step", "low", "mode"),
    [
        (0, 0.05, 0.05),
        (250_000, 0.05, 0.525),
        (500_000, 0.05, 1.0),
        (750_000, 0.525, 1.0),
        (1_000_000, 1.0, 1.0),
        (4_000_000, 1.0, 1.0),
    ],
)
def test_the_mode_of_the_starts_moves_first_and_then_their_lower_limit(step, low, mode):
    assert start_range(THESIS, step) == pytest.approx((low, mode))


TINY_RECIPE = {
    "learning.total_steps": 1200,
    "learning.buffer_size": 2000,
    "learning.progress_steps": 400,
    "learning.progress_episodes": 8,
    "learning.checkpoint_steps": 400,
    "episode.curriculum_steps": 400,
    "episode.time_limit_s": 2.0,
    "episode.short_limit_s": 2.0,
}


def test_a_training_of_the_recipe_updates_once_per_step_and_moves_its_starts():
    preset = preset_of("pick-td3-thesis", TINY_RECIPE)
    run, monitor = start(preset, 1, CELL)
    assert isinstance(monitor.env.batch, CurriculumPickBatch)
    assert monitor.env._task.truncates(np.array([TIMEOUT])).tolist() == [False]
    recorder = Recorder()
    result = recorder.run(preset)
    assert [one.step for one in recorder.progress] == [400, 800, 1200]
    assert [one.updates for one in recorder.progress] == [300, 700, 1100]
    assert all(one.episodes == 8 for one in recorder.progress)
    act, value, outcomes = ValueNetworks(result.checkpoint).evaluate(
        PickBatch(CELL, 3, 1, settings_of(REACH_ONLY)).reset()
    )
    assert (act.shape, value.shape, outcomes) == ((3, 5), (3,), None)
