"""One training path: its curve, its checkpoints, and going on after an interruption."""

import dataclasses

import numpy as np
import pytest

from app.errors import CheckpointMismatch
from tests.policies.conftest import Recorder


def test_the_curve_lies_on_the_grid_and_counts_updates(tiny_run):
    assert [point.step for point in tiny_run.progress] == [256, 512, 768, 1024, 1280, 1536]
    # one update per vector step of 16 cells; that of the last step comes after its point
    assert tiny_run.progress[-1].updates == (1536 - 256) // 16 - 1
    assert tiny_run.progress[-1].time_left_s == 0.0


def test_rates_of_a_point_sum_to_one_where_episodes_ended(tiny_run):
    ended = [point for point in tiny_run.progress if point.episodes]
    assert ended
    for point in ended:
        assert point.success + point.collision + point.timeout == pytest.approx(1.0)


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


def test_a_checkpoint_of_another_preset_is_refused(tiny_preset, tiny_run):
    _, _, state = tiny_run.checkpoints[0]
    other = dataclasses.replace(tiny_preset, gamma=0.9)
    with pytest.raises(CheckpointMismatch, match="preset"):
        Recorder().run(other, resume=state)


def test_a_policy_checkpoint_does_not_resume(tiny_preset, tiny_run):
    _, policy, _ = tiny_run.checkpoints[0]
    with pytest.raises(CheckpointMismatch, match="kind"):
        Recorder().run(tiny_preset, resume=policy)
