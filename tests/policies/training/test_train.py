"""One training path: its curve, its checkpoints, and going on after an interruption."""

import dataclasses

import numpy as np
import pytest

from app.errors import CheckpointMismatch
from app.policies.inference.task_selection import TaskChooser
from app.policies.inference.value_networks import ValueNetworks
from app.policies.networks.pick import LAYOUTS
from app.sim.cells.cell import load_cell
from app.sim.human import model as human
from app.sim.human.anthropometry import percentile_body
from app.sim.human.person import Person
from app.sim.pick.kernels.observation_layout import N_FEATURES, N_PICK, N_WITH_BODY
from app.sim.pick.task_policy import Candidate
from tests.policies.conftest import TINY, Recorder, preset_of


def test_the_curve_lies_on_the_grid_and_counts_updates(tiny_run):
    assert [point.step for point in tiny_run.progress] == [256, 512, 768, 1024, 1280, 1536]
    # one update per vector step of 16 cells; that of the last step comes after its point
    assert tiny_run.progress[-1].updates == (1536 - 256) // 16 - 1
    assert tiny_run.progress[-1].time_left_s == 0.0


def test_remaining_time_is_reported_from_the_first_updates_on(tiny_run):
    reported = [point.time_left_s is not None for point in tiny_run.progress]
    assert reported == [point.updates > 0 for point in tiny_run.progress]
    assert reported[0] is False
    assert all(reported[1:])


def test_rates_of_a_point_sum_to_one_where_episodes_ended(tiny_run):
    ended = [point for point in tiny_run.progress if point.episodes]
    assert ended
    for point in ended:
        assert point.success + point.collision + point.timeout == pytest.approx(1.0)


def test_a_training_counts_episodes_that_end_unfeasible():
    """One-step bounds can become empty, which is a fifth outcome."""
    overrides = {
        **TINY,
        "action.bounds": "one-step",
        "learning.total_steps": 12 * TINY["learning.total_steps"],
    }
    recorder = Recorder()
    recorder.run(preset_of("pick-reach-td3", overrides))
    ended = [point for point in recorder.progress if point.episodes]
    shares = [point.success + point.collision + point.timeout for point in ended]
    assert min(shares) < 1.0 and max(shares) <= 1.0 + 1e-12


def test_the_same_seed_trains_the_same_bits(tiny_preset, tiny_run):
    again = Recorder()
    result = again.run(tiny_preset)
    assert result.checkpoint.tensors == tiny_run.result.checkpoint.tensors


def test_a_stopped_run_goes_on_without_gap_or_duplicate(tiny_preset, tiny_run):
    stopped = Recorder(stop_at=768)
    assert stopped.run(tiny_preset).stopped
    step, _, state = stopped.checkpoints[-1]
    assert step == 768
    resumed = Recorder()
    resumed.run(tiny_preset, resume=state)
    steps = [point.step for point in stopped.progress + resumed.progress]
    assert steps == [point.step for point in tiny_run.progress]
    # a stop leaves out the update of its step
    lost = tiny_run.progress[-1].updates - resumed.progress[-1].updates
    assert lost == 1


def test_a_resumed_run_starts_from_the_weights_it_had(tiny_preset):
    stopped = Recorder(stop_at=512)
    stopped.run(tiny_preset)
    _, policy, state = stopped.checkpoints[-1]
    before, after = policy.arrays(), state.arrays()
    assert all(np.array_equal(before[name], after[name]) for name in before)
    assert any(name.startswith("critic_adam") for name in after)


def test_a_checkpoint_of_another_preset_is_refused(tiny_run):
    _, _, state = tiny_run.checkpoints[0]
    other = preset_of("pick-td3", TINY, {"learning.gamma": 0.9})
    with pytest.raises(CheckpointMismatch, match="preset"):
        Recorder().run(other, resume=state)


def test_a_policy_checkpoint_does_not_resume(tiny_preset, tiny_run):
    _, policy, _ = tiny_run.checkpoints[0]
    with pytest.raises(CheckpointMismatch, match="kind"):
        Recorder().run(tiny_preset, resume=policy)


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
