"""An interrupted training ends with the same bits as one that was not interrupted."""

import json
import logging
import random
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from app.errors import CheckpointMismatch, Damaged, InvalidInput
from app.policies.configs.presets import Preset
from app.policies.training import state as states
from app.policies.training.file_store import FileFolder
from app.policies.training.memory_files import MemoryFiles
from app.policies.training.progress import Progress, TrainResult
from app.policies.training.reporter import Callbacks
from app.policies.training.run import TrainingRun
from app.policies.training.state import TrainingState
from app.policies.training.state_folder import StateFolder
from app.policies.training.train import start, train
from app.sim.cells.cell import load_cell
from tests.policies.conftest import preset_of
from tests.policies.object_graph import leaves

SMALL = {
    "learning.total_steps": 1024,
    "learning.n_envs": 8,
    "learning.buffer_size": 2000,
    "learning.batch_size": 16,
    "learning.learning_starts": 128,
    "learning.progress_steps": 512,
    "learning.checkpoint_steps": 512,
    "networks.width": 16,
}
SORTING = {**SMALL, "learning.progress_episodes": 10}
REACH = {**SMALL, "learning.actor_frozen_updates": 4}
ARM = {**REACH, "learning.progress_steps": 64, "learning.checkpoint_steps": 256}
DDPG = {
    **REACH,
    "learning.progress_episodes": 2,
    "learning.policy_delay": 1,
    "learning.target_noise": 0.0,
    "learning.alpha": 0.6,
    "learning.n_steps": 1,
    "networks.n_critics": 1,
    "exploration.noise": "ou",
}
PARAMETERS = {
    **ARM,
    "learning.gradient_steps": 2,
    "learning.progress_steps": 256,
    "learning.progress_episodes": 2,
    "episode.curriculum_steps": 300,
    "episode.time_limit_s": 1.0,
    "episode.short_limit_s": 1.0,
}
"""Perturbed actors, and a curriculum that ends within the training."""
TRAININGS: dict[str, tuple[str, dict[str, Any]]] = {
    "DQN": ("sorting-e0-dqn", SORTING),
    "DDPG": ("reach-td3", DDPG),
    "TD3": ("pick-td3", ARM),
    "parameter noise": ("pick-td3-thesis", PARAMETERS),
}
SEED = 3
N_ENVS = 8


def small(kind: str, **changes: object) -> Preset:
    name, fields = TRAININGS[kind]
    return preset_of(name, fields, changes)


class Training:
    """A training in a folder that can be stopped at any step and continued."""

    def __init__(self, preset: Preset, folder: Path) -> None:
        self.preset, self.states = preset, StateFolder(folder)
        self.points: dict[int, Progress] = {}
        self.ids: dict[int, str] = {}

    def run(self, stop_at: int | None = None) -> TrainResult:
        state = self.states.newest()
        steps = iter(range(0 if state is None else state.step, 10**9, N_ENVS))
        next(steps)

        def on_checkpoint(step: int, policy: Any, state: TrainingState | None) -> None:
            self.ids[step] = policy.sha256
            assert state is not None
            self.states.write(state)

        return train(
            self.preset,
            seed=SEED,
            on_progress=lambda point: self.points.__setitem__(point.step, point),
            on_checkpoint=on_checkpoint,
            should_stop=lambda: next(steps) == stop_at,
            memory=self.states.memory,
            resume=state,
        )

    @property
    def curve(self) -> list[tuple[object, ...]]:
        """The points without what depends on the speed of the machine."""
        names = ("step", "updates", "episodes", "success", "collision", "timeout", "reward")
        return [tuple(getattr(self.points[k], n) for n in names) for k in sorted(self.points)]


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Return the uninterrupted training of each algorithm, which runs once."""
    done: dict[str, tuple[Training, TrainResult]] = {}

    def of(kind: str) -> tuple[Training, TrainResult]:
        if kind not in done:
            training = Training(small(kind), tmp_path_factory.mktemp(kind))
            done[kind] = training, training.run()
        return done[kind]

    return of


def interrupted_at(kind: str, folder: Path, *stops: int) -> tuple[Training, TrainResult]:
    training = Training(small(kind), folder)
    for stop in stops:
        result = training.run(stop)
        assert (result.stopped, result.step) == (True, stop)
    return training, training.run()


def test_training_stopped_while_outcomes_are_fitted_continues_there(
    uninterrupted: Any, tmp_path: Path
) -> None:
    whole, result = uninterrupted("TD3")
    training = Training(small("TD3"), tmp_path)
    for n_played in (1, 5):
        stopped = training.run(1024 + n_played * N_ENVS)
        assert (stopped.stopped, stopped.step) == (True, 1024)
    resumed = training.run()
    assert (resumed.stopped, resumed.checkpoint.sha256) == (False, result.checkpoint.sha256)
    assert training.curve == whole.curve


def test_stop_at_the_last_step_is_no_interruption(tmp_path: Path) -> None:
    result = Training(small("DQN"), tmp_path).run(1024)
    assert (result.stopped, result.step) == (False, 1024)


def steps_of(seed: int, n: int, total: int = 1024) -> list[int]:
    """Return steps at which a training is interrupted."""
    return sorted(random.Random(seed).sample(range(N_ENVS, total, N_ENVS), n))


@pytest.mark.parametrize("kind", TRAININGS)
def test_interrupted_training_ends_with_the_same_bits(
    kind: str, uninterrupted: Any, tmp_path: Path
) -> None:
    whole, expected = uninterrupted(kind)
    resumed, result = interrupted_at(kind, tmp_path, *steps_of(7, 2))
    assert result.checkpoint.tensors == expected.checkpoint.tensors
    assert result.checkpoint.sha256 == expected.checkpoint.sha256
    assert resumed.curve == whole.curve
    assert {step: resumed.ids[step] for step in whole.ids} == whole.ids


@pytest.mark.slow
@pytest.mark.parametrize("kind", TRAININGS)
@pytest.mark.parametrize("seed", range(10))
def test_ten_random_interruptions_change_nothing(
    kind: str, seed: int, uninterrupted: Any, tmp_path: Path
) -> None:
    whole, expected = uninterrupted(kind)
    resumed, result = interrupted_at(kind, tmp_path, *steps_of(100 + seed, 1))
    assert result.checkpoint.sha256 == expected.checkpoint.sha256
    assert resumed.curve == whole.curve


VARIANTS: list[tuple[str, dict[str, Any]]] = [
    ("sorting-e0-dqn", SORTING),
    ("sorting-e0-thesis", SORTING),
    ("reach-td3", {**REACH, "learning.progress_episodes": 2}),
    ("reach-td3", DDPG),
    ("reach-ddpg-thesis", {**REACH, "networks.layers": 2, "learning.progress_episodes": 2}),
    ("reach-ddpg-authors", {**REACH, "networks.layers": 2, "learning.progress_episodes": 2}),
    ("reach-td3-monitored", {**REACH, "learning.progress_episodes": 2}),
    (
        "reach-td3",
        {
            **REACH,
            "learning.progress_episodes": 3,
            "episode.observation": "people-set",
            "people.n_people": 3,
            "people.count": "up-to",
        },
    ),
    ("pick-td3", ARM),
    ("pick-td3-monitored", ARM),
    ("pick-td3-thesis", PARAMETERS),
    (
        "pick-reach-td3",
        {
            **ARM,
            "episode.target_choice": "critic",
            "episode.target_jitter_m": 0.0,
            "episode.on_path_share": 0.0,
        },
    ),
]


def started(preset: Preset, files: MemoryFiles) -> tuple[TrainingRun, Any]:
    calls = Callbacks(lambda _: None, lambda *_: None, lambda: False)
    run, reporter = start(preset, SEED, load_cell(preset.cell), calls)
    run.keep_states(files)
    return run, reporter


@pytest.mark.parametrize(("name", "fields"), VARIANTS)
def test_everything_that_a_training_changes_is_restored(
    name: str, fields: dict[str, Any], tmp_path: Path
) -> None:
    """Compares all objects of a training with those of a restored one."""
    preset = preset_of(name, fields)
    first, reporter = started(preset, MemoryFiles(FileFolder(tmp_path)))
    new = contents(first)
    steps = iter(range(N_ENVS, 10**9, N_ENVS))
    first.learn(reporter, lambda: next(steps) < 280)
    saved: list[TrainingState] = []
    first.save(lambda _step, _policy, state: saved.append(state))  # type: ignore[arg-type]
    worked, generators = contents(first), global_generators()
    second, _ = started(preset, MemoryFiles(FileFolder(tmp_path)))
    second.model._setup_learn(preset.learning.total_steps)
    second.restore(saved[0])
    restored = contents(second)
    for part, content in worked.items():
        assert new[part] != content or part in ("generators", "reporter")
        differs = {path for path in content if restored[part].get(path) != content[path]}
        assert differs <= COUNTED_BY_CALLBACK.get(part, set())
    assert global_generators() == generators


def test_a_training_leaves_no_temporary_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    Training(small("DQN"), tmp_path / "states").run()
    # PyTorch makes one for each user, when its optimisers are used first in a process.
    made = {one.name for one in temporary.iterdir()}
    assert not {name for name in made if not name.startswith("torchinductor_")}


COUNTED_BY_CALLBACK = {
    "reporter": {".num_timesteps"},
    "run": {".state_parts.reporter.num_timesteps"},
}
"""A copy of the model's number that Stable-Baselines3's callback makes in each step."""


def contents(run: TrainingRun) -> dict[str, dict[str, str]]:
    """Return the leaves of each part of the state, and of the whole training."""
    parts = {**run.state_parts, "run": run}
    return {name: dict(leaves(part, "")) for name, part in parts.items()}


def global_generators() -> tuple[str, str, str]:
    kept = np.random.get_state(legacy=True)  # noqa: NPY002
    return str(torch.get_rng_state().tolist()), repr(kept), repr(random.getstate())


@pytest.fixture
def stopped(tmp_path: Path) -> Training:
    """A training of sorting that was interrupted twice; both states are there."""
    training = Training(small("DQN"), tmp_path)
    training.run(320)
    training.run(400)
    return training


def files(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.rglob("*") if path.is_file())


def test_two_states_and_their_files_are_kept(stopped: Training, tmp_path: Path) -> None:
    assert [name for name in files(tmp_path) if name.startswith("step-")] == [
        f"step-{step:012d}.{kind}" for step in (320, 400) for kind in ("json", "safetensors")
    ]
    listed = set()
    for path in tmp_path.glob("*.json"):
        memory = json.loads(path.read_text())["manifest"]["memory"]
        listed |= {entry["sha256"] for entry in memory}
        assert (memory[0]["first"], memory[-1]["last"]) == (0, int(path.stem[5:]) // N_ENVS)
    assert files(tmp_path / "memory") == sorted(f"{one}.safetensors" for one in listed)
    stopped.states.remove()
    assert not tmp_path.exists()


@pytest.mark.parametrize("part", ["manifest", "tensors", "memory", "missing file"])
def test_training_continues_from_the_state_before_a_damaged_one(
    part: str,
    stopped: Training,
    uninterrupted: Any,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:
    newest = sorted(tmp_path.glob("*.json"))[-1]
    memory = json.loads(newest.read_text())["manifest"]["memory"]
    transitions = tmp_path / "memory" / f"{memory[-1]['sha256']}.safetensors"
    if part == "manifest":
        newest.write_text(newest.read_text().replace('"step": 400', '"step": 408'))
    elif part == "missing file":
        transitions.unlink()
    else:
        path = newest.with_suffix(".safetensors") if part == "tensors" else transitions
        path.write_bytes(path.read_bytes()[:-100])  # torn
    with caplog.at_level(logging.WARNING):
        state = stopped.states.newest()
    assert state is not None and state.step == 320
    assert "an earlier state is" in caplog.text
    assert stopped.run().checkpoint.sha256 == uninterrupted("DQN")[1].checkpoint.sha256


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"learning.gamma": 0.9}, r"learning\.gamma"),
        ({"networks.width": 32}, r"networks\.width"),
    ],
)
def test_state_of_another_configuration_is_refused_by_field(
    change: dict[str, Any], field: str, stopped: Training
) -> None:
    stopped.preset = small("DQN", **change)
    with pytest.raises(CheckpointMismatch, match=field):
        stopped.run()


def test_state_from_before_a_field_was_added_has_its_default(stopped: Training) -> None:
    state, cell = stopped.states.newest(), load_cell(stopped.preset.cell)
    assert state is not None
    del state.manifest["preset"]["learning"]["max_grad_norm"]
    states.require_origin(state, stopped.preset, SEED, cell)
    changed = small("DQN", **{"learning.max_grad_norm": 3.0})
    with pytest.raises(CheckpointMismatch, match=r"learning\.max_grad_norm is .*, expected 3"):
        states.require_origin(state, changed, SEED, cell)


def test_state_of_another_seed_or_cell_is_refused(stopped: Training) -> None:
    state, cell = stopped.states.newest(), load_cell(stopped.preset.cell)
    assert state is not None
    states.require_origin(state, stopped.preset, SEED, cell)
    with pytest.raises(CheckpointMismatch, match="seed is 3, expected 4"):
        states.require_origin(state, stopped.preset, SEED + 1, cell)
    with pytest.raises(CheckpointMismatch, match="cell is"):
        states.require_origin(state, stopped.preset, SEED, load_cell("sorting-e1"))


def test_state_of_another_format_is_refused(stopped: Training) -> None:
    state = stopped.states.newest()
    assert state is not None
    with pytest.raises(CheckpointMismatch, match="format is 'tandem-training-state/9'"):
        states.load({**state.manifest, "format": "tandem-training-state/9"}, state.tensors)
    with pytest.raises(InvalidInput, match=r"manifest\.memory"):
        states.load({**state.manifest, "memory": None}, state.tensors)


def test_missing_rows_of_the_memory_are_found(stopped: Training) -> None:
    state = stopped.states.newest()
    assert state is not None
    run, _ = started(stopped.preset, stopped.states.memory)
    lacking = {**state.manifest, "memory": state.manifest["memory"][1:]}
    with pytest.raises(Damaged, match="replay memory"):
        run.restore(TrainingState(lacking, state.tensors))
