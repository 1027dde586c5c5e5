"""One training path: its curve, its checkpoints, and going on after an interruption."""

import dataclasses

import numpy as np
import pytest

from app.errors import CheckpointMismatch, InvalidInput
from app.policies.inference.task_selection import TaskChooser
from app.policies.inference.value_networks import ValueNetworks
from app.policies.networks.pick import LAYOUTS
from app.policies.training.progress import Progress
from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.human.person import Person
from app.sim.pick.kernels.observation_layout import N_FEATURES, N_PICK, N_WITH_BODY
from app.sim.pick.task_policy import Candidate
from tests.policies.conftest import TINY, Recorder, preset_of


def test_the_curve_lies_on_the_grid_and_counts_updates(tiny_run):
    assert [point.step for point in tiny_run.progress] == [256, 512, 768, 1024, 1280, 1536]
    assert tiny_run.progress[-1].updates == (1536 - 256) // 16  # one per step of 16 cells
    assert tiny_run.progress[-1].time_left_s == 0.0


def test_the_curve_ends_with_the_training():
    recorder = Recorder()
    recorder.run(preset_of("pick-td3", TINY, {"learning.total_steps": 1_152}))
    assert [point.step for point in recorder.progress] == [256, 512, 768, 1024, 1152]
    assert [step for step, _, _ in recorder.checkpoints][-1] == 1152


def test_remaining_time_is_reported_from_the_first_updates_on(tiny_run):
    reported = [point.time_left_s is not None for point in tiny_run.progress]
    assert reported == [point.updates > 0 for point in tiny_run.progress]
    assert reported[0] is False
    assert all(reported[1:])


def test_rates_of_a_point_sum_to_one_where_episodes_ended(tiny_run):
    ended = [point for point in tiny_run.progress if point.episodes]
    assert ended
    for point in ended:
        assert share_of(point) == pytest.approx(1.0)


def share_of(point: Progress) -> float:
    """Return the share of the outcomes that a point names."""
    return point.success + point.collision + point.timeout


def test_a_training_counts_episodes_that_end_unfeasible():
    """One-step bounds can become empty: a fifth outcome, whose first ends the training."""
    overrides = {
        **TINY,
        "action.bounds": "one-step",
        "learning.total_steps": 12 * TINY["learning.total_steps"],
    }

    def is_short(point: Progress) -> bool:
        return bool(point.episodes) and share_of(point) < 1.0 - 1e-6

    recorder = Recorder(stops=is_short)
    recorder.run(preset_of("pick-reach-td3", overrides))
    shares = [share_of(point) for point in recorder.progress if point.episodes]
    assert min(shares) < 1.0 - 1e-6 and max(shares) <= 1.0 + 1e-12


@pytest.mark.usefixtures("tiny_run")
def test_thread_of_a_training_keeps_denormal_numbers_afterwards():
    assert np.float64(1e-300) * np.float64(1e-15) > 0.0


def test_networks_that_no_checkpoint_holds_are_refused_before_the_first_step():
    cell = load_cell("sorting-e0")
    slot, tower = cell.stations_of("clutter")[0], cell.stations_of("cluster")[0]
    slots = [slot.model_copy(update={"id": f"slot{k}"}) for k in range(30)]
    towers = [
        tower.model_copy(update={"id": f"tower{k}", "levels": 30, "colour": None})
        for k in range(4)
    ]
    large = cell.model_copy(update={"name": "large", "stations": (*slots, *towers)})
    fields = {**TINY, "networks.width": 512, "learning.progress_episodes": 10}
    del fields["learning.actor_frozen_updates"]
    recorder = Recorder()
    with pytest.raises(InvalidInput, match="tensors"):
        recorder.run(preset_of("sorting-e0-thesis", fields), cell=large)
    assert not recorder.progress


def test_the_same_seed_trains_the_same_bits(tiny_preset, tiny_run):
    again = Recorder()
    result = again.run(tiny_preset)
    assert result.checkpoint.tensors == tiny_run.result.checkpoint.tensors


def test_equal_trainings_have_equal_ids_and_the_id_states_the_origin(tiny_preset, tiny_run):
    stopped = Recorder(stop_at=512)
    stopped.run(tiny_preset)
    first, again = (run.checkpoints[0][1] for run in (tiny_run, stopped))
    assert first.sha256 == again.sha256
    assert {"preset", "seed", "cell", "commits", "versions"} <= set(first.manifest)
    other = Recorder(stop_at=512)
    other.run(tiny_preset, seed=4)
    assert other.checkpoints[0][1].sha256 != first.sha256


@pytest.fixture(scope="module")
def body_policy():
    """A policy that is reported the size of the person, hardly trained."""
    preset = preset_of(
        "pick-reach-td3", {**TINY, "learning.total_steps": 1024, "episode.observation": "body"}
    )
    return Recorder().run(preset).checkpoint


def test_a_policy_that_observes_the_size_decides_by_it(body_policy, tiny_run):
    networks = ValueNetworks(body_policy)
    assert networks.n_obs == N_WITH_BODY
    assert ValueNetworks(tiny_run.result.checkpoint).n_obs == N_PICK
    assert body_policy.manifest["layout"][-1] == ["body", 12]
    obs = np.random.default_rng(4).normal(0.0, 0.3, N_WITH_BODY).astype(np.float32)
    obs = np.stack([obs, obs])
    obs[1, N_FEATURES:] += 0.1
    act, value, _ = networks.evaluate(obs)
    assert value[0] != value[1] and not np.array_equal(act[0], act[1])


def test_a_policy_that_observes_the_size_decides_beside_small_and_large_people(body_policy):
    cell, chooser, values = load_cell(), TaskChooser(body_policy), []
    q, rest = np.array(cell.robot.home_q), human.rest_posture(*cell.human.home)
    candidates = [Candidate(id=s.id, position=s.position) for s in cell.stations[:3]]
    for share in (50.0, 95.0):
        size = percentile_body(share).vector(cell.floor_z)
        person = Person(q=rest, qd=np.zeros(18), size=size)
        decision = chooser.decide(q, np.zeros(6), [person], candidates)
        assert decision.chosen in {one.id for one in candidates}
        values.append(decision.values)
    assert np.isfinite(values).all() and values[0] != values[1]


@pytest.mark.parametrize("kind", ["features", "phase"])
def test_a_checkpoint_of_another_layout_is_refused(body_policy, tiny_run, kind):
    policy = {"features": body_policy, "phase": tiny_run.result.checkpoint}[kind]
    other = {**policy.manifest, "layout": LAYOUTS[kind]}
    with pytest.raises(CheckpointMismatch, match="layout"):
        ValueNetworks(dataclasses.replace(policy, manifest=other))
    # Who lies about both still has tensors of the wrong width.
    preset = policy.manifest["preset"]
    preset = {**preset, "episode": {**preset["episode"], "observation": kind}}
    with pytest.raises(CheckpointMismatch, match="tensors"):
        ValueNetworks(dataclasses.replace(policy, manifest={**other, "preset": preset}))
