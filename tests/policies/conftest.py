"""A tiny training run, shared by the tests of this folder."""

from collections.abc import Callable

import pytest

from app.policies.configs import presets
from app.policies.configs.pick import PickPreset
from app.policies.configs.presets import Preset
from app.policies.training.memory_files import MemoryFiles
from app.policies.training.progress import Progress
from app.policies.training.train import train
from app.sim.cells.cell import Cell

TINY = {
    "learning.total_steps": 1536,
    "learning.n_envs": 16,
    "learning.buffer_size": 2000,
    "learning.batch_size": 32,
    "learning.learning_starts": 256,
    "learning.actor_frozen_updates": 8,
    "networks.width": 32,
    "learning.progress_steps": 256,
    "learning.checkpoint_steps": 512,
}
"""Overrides that make a training last seconds."""


def preset_of(name: str, *fields: dict[str, object]) -> Preset:
    """Return a preset with fields changed, by dotted names; later changes win."""
    changed: dict[str, object] = {}
    for one in fields:
        changed |= one
    return presets.resolve(name, presets.nested(changed))


class Recorder:
    """Keeps what a training reports; stops it at a step or a point if asked to."""

    def __init__(
        self,
        stop_at: int | None = None,
        memory: MemoryFiles | None = None,
        stops: Callable[[Progress], bool] = lambda _: False,
    ) -> None:
        self.progress: list[Progress] = []
        self.checkpoints = []
        self._stop_at, self._memory, self._stops = stop_at, memory, stops

    def run(self, preset: Preset, resume=None, seed: int = 3, cell: Cell | None = None):
        return train(
            preset,
            seed=seed,
            cell=cell,
            memory=self._memory,
            resume=resume,
            on_progress=self.progress.append,
            on_checkpoint=lambda step, policy, state: self.checkpoints.append(
                (step, policy, state)
            ),
            should_stop=lambda: bool(self.progress) and self._is_last(self.progress[-1]),
        )

    def _is_last(self, point: Progress) -> bool:
        return self._stops(point) or (self._stop_at is not None and point.step >= self._stop_at)


@pytest.fixture(scope="session")
def tiny_preset() -> PickPreset:
    return preset_of("pick-td3", TINY)


@pytest.fixture(scope="session")
def tiny_run(tiny_preset):
    recorder = Recorder()
    recorder.result = recorder.run(tiny_preset)
    return recorder
