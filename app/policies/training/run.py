"""One attempt at a training: its counters and its checkpoints, whatever is trained."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
from stable_baselines3.common.type_aliases import TrainFreq, TrainFrequencyUnit
from stable_baselines3.common.vec_env import VecEnv

from app.errors import CheckpointMismatch
from app.policies.checkpoints import checkpoint as formats
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.model_state import moments_of, restore, versions, weights_of
from app.policies.checkpoints.trained_cell import cell_of, manifest_fields
from app.policies.configs.presets import Preset
from app.sim.cells.cell import Cell

REFILL_STEPS = 51_200
"""Environment steps that refill the replay memory after an interruption."""


@dataclass(frozen=True, kw_only=True)
class Parts:
    """What a checkpoint is made of."""

    policy: dict[str, torch.nn.Module]
    """Networks of the policy, by name."""
    targets: Mapping[str, torch.nn.Module]
    """Networks that only training needs."""
    optimizers: Mapping[str, torch.optim.Optimizer]
    """Optimisers."""
    layout: Sequence[Sequence[Any]]
    """Names and sizes of the groups of an observation."""
    act_size: int
    """Numbers of an action, or number of actions."""
    trained_range: Callable[[], dict[str, Any]]
    """Returns least and greatest value of the state's variables met so far."""


class TrainingRun:
    """One attempt at a training.

    Args:
        preset: All hyper-parameters.
        seed: Seed of everything random.
        cell: Work cell trained in.
        model: Stable-Baselines3's algorithm.
        env: The batched scenario.
        parts: What its checkpoints are made of.
        resume: The last ``resume`` checkpoint of an interrupted attempt.

    Raises:
        CheckpointMismatch: ``resume`` belongs to another preset, cell or program.
    """

    def __init__(
        self,
        preset: Preset,
        seed: int,
        cell: Cell,
        model: OffPolicyAlgorithm,
        env: VecEnv,
        parts: Parts,
        resume: Checkpoint | None,
    ) -> None:
        self.preset, self.seed, self.cell = preset, seed, cell
        self.model, self._env, self._parts = model, env, parts
        self._cpu_before, self._cpu_start = 0.0, time.process_time()
        self._untimed = 0.0
        if resume is not None:
            self._restore(resume)

    @property
    def step(self) -> int:
        """Environment steps so far."""
        return int(self.model.num_timesteps)

    @property
    def updates(self) -> int:
        """Updates so far."""
        return int(self.model._n_updates)

    @property
    def cpu_s(self) -> float:
        """CPU time of the training so far, earlier attempts included [s]."""
        return self._cpu_before + time.process_time() - self._cpu_start - self._untimed

    def add(self, name: str, network: torch.nn.Module) -> None:
        """Add a network to the policy's checkpoints."""
        self._parts.policy[name] = network

    def leave_out(self, cpu_s: float) -> None:
        """Do not count CPU time that went into measuring, not into training [s]."""
        self._untimed += cpu_s

    def checkpoints(self) -> tuple[Checkpoint, Checkpoint]:
        """Return the policy and what resuming needs."""
        parts, manifest = self._parts, self._manifest()
        arrays = weights_of(parts.policy)
        policy = formats.pack({**manifest, "kind": "policy"}, arrays)
        more = weights_of(parts.targets) | moments_of(parts.optimizers)
        return policy, formats.pack({**manifest, "kind": "resume"}, arrays | more)

    def _manifest(self) -> dict[str, Any]:
        return {
            "format": formats.FORMAT,
            "preset": self.preset.model_dump(),
            "seed": self.seed,
            **manifest_fields(self.cell),
            "layout": [list(entry) for entry in self._parts.layout],
            "act_size": self._parts.act_size,
            "width": self.preset.networks.width,
            "step": self.step,
            "updates": self.updates,
            "cpu_s": round(self.cpu_s, 1),
            "trained_range": self._parts.trained_range(),
            "versions": versions(),
        }

    def _restore(self, resume: Checkpoint) -> None:
        manifest, parts = resume.manifest, self._parts
        if manifest["kind"] != "resume":
            raise CheckpointMismatch("kind", "resume", manifest["kind"])
        if manifest["preset"] != self.preset.model_dump():
            raise CheckpointMismatch("preset", self.preset.model_dump(), manifest["preset"])
        if cell_of(manifest) != self.cell:
            raise CheckpointMismatch("cell", self.cell.sha256, cell_of(manifest).sha256)
        layout = [list(entry) for entry in parts.layout]
        formats.expect_layout(resume, layout, parts.act_size)
        restore(resume.arrays(), {**parts.policy, **parts.targets}, parts.optimizers)
        self.model.num_timesteps = int(manifest["step"])
        self.model._n_updates = int(manifest["updates"])
        self._cpu_before = float(manifest.get("cpu_s", 0.0))

    def refill(self) -> None:
        """Fill the replay memory with the restored policy; these steps are not counted."""
        model, step, learning = self.model, self.step, self.preset.learning
        _, silent = model._setup_learn(learning.total_steps, None, False)
        n_steps = max(1, min(REFILL_STEPS, learning.buffer_size) // learning.n_envs)
        assert model.replay_buffer is not None
        model.collect_rollouts(
            self._env,
            callback=silent,
            train_freq=TrainFreq(n_steps, TrainFrequencyUnit.STEP),
            replay_buffer=model.replay_buffer,
        )
        model.num_timesteps = step
