"""How ``tools/docs/task_maximisation.py`` trains, judges policies and puts seeds together."""

import json
from pathlib import Path

import numpy as np
import pytest

from app.errors import InvalidInput
from app.policies.configs import presets
from app.policies.configs.pick import PickPreset
from app.policies.training.pick import start
from app.sim.cells.cell import load_cell
from app.sim.pick.valued_targets import ValuedTargetBatch
from tests.policies.conftest import TINY, preset_of
from tools.docs import task_maximisation as study
from tools.docs.training_curves import record

SHORT = {**TINY, "learning.total_steps": 1024, "learning.checkpoint_steps": 512}


def short(choice: str) -> PickPreset:
    """Return the preset of a choice with a training of seconds."""
    changes = {**study.SETUP, **SHORT, "episode.target_choice": choice}
    preset = preset_of("pick-reach-td3", changes)
    assert isinstance(preset, PickPreset)
    return preset


def test_both_choices_differ_in_nothing_else() -> None:
    critic, uniform = (study.preset_of(choice).model_dump() for choice in study.CHOICES)
    assert critic["episode"].pop("target_choice") == "critic"
    assert uniform["episode"].pop("target_choice") == "uniform"
    assert critic == uniform


def test_critic_chooses_the_targets_of_its_training() -> None:
    run, monitor = start(short("critic"), 5, load_cell("pick-and-place"))
    batch = monitor.env.batch
    assert isinstance(batch, ValuedTargetBatch)
    batch.reset()
    chosen = batch.state.candidates[:, 0].copy()
    values = batch.station_values(np.arange(batch.n_envs), batch.values)
    np.testing.assert_array_equal(chosen, values.argmax(axis=1))


def test_trained_policies_are_judged_on_the_same_episodes(tmp_path: Path) -> None:
    found, batch = {}, study.episodes_of(short("uniform"), 48)
    for choice in study.CHOICES:
        folder = tmp_path / choice
        record(short(choice), 5, folder, predicts=False)
        assert len(list(folder.glob("step-*.json"))) == 2
        assert not (folder / "resume").exists()
        found[choice] = [study.numbers_of(folder, batch, choice)] * 2
    stations = [one.id for one in batch.cell.pick_stations]
    for one in (found["critic"][0], found["uniform"][0]):
        assert list(one) == ["all", *stations, "chosen"]
        assert sum(one[name]["trained"] for name in stations) == pytest.approx(1.0)
        ends = sum(one["all"][end] for end in ("success", "collision", "timeout"))
        assert ends == pytest.approx(1.0)
        assert 0.0 <= abs(one["all"]["error"]) <= one["all"]["error_abs"]
    rows, paired = study.table_of(found)
    result = {"results": rows, "paired": paired}
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    assert paired[0]["name"] == "critic - uniform all"
    difference = found["critic"][0]["all"]["success"] - found["uniform"][0]["all"]["success"]
    assert paired[0]["success"]["mean"] == pytest.approx(difference)
    assert len(study.draw(result).axes) == 3


def test_critic_needs_targets_at_stations() -> None:
    changes = {"episode": {"target_choice": "critic"}}
    with pytest.raises(InvalidInput, match="target_jitter_m = 0"):
        presets.resolve("pick-reach-td3", changes)
