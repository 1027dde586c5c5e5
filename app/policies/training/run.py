"""One attempt at a training of any scenario: counters, checkpoints and states."""

import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.type_aliases import TrainFreq

from app.policies.algorithms.dqn import SortingDQN
from app.policies.algorithms.prioritized_replay import PrioritisedReplay
from app.policies.algorithms.td3 import BatchTD3
from app.policies.algorithms.vecenv import BatchVecEnv
from app.policies.checkpoints import checkpoint as formats
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.model_state import versions, weights_of
from app.policies.checkpoints.trained_cell import manifest_fields
from app.policies.configs.presets import Preset
from app.policies.training import state as states
from app.policies.training.memory_files import MemoryFiles
from app.policies.training.state import (
    GlobalGenerators,
    NetworkState,
    Priorities,
    TrainingState,
)
from app.provenance import describe
from app.sim.cells.cell import Cell
from app.state_dict import State, Stateful, under

logger = logging.getLogger(__name__)

OnCheckpoint = Callable[[int, Checkpoint, TrainingState | None], None]
"""Takes the step, the policy and, where states are kept, the state to resume from."""


@dataclass(frozen=True, kw_only=True)
class CheckpointParts:
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
        seed: Seed of everything random.
        cell: Work cell trained in.
        model: Stable-Baselines3's algorithm.
        env: The batched scenario.
        parts: What its checkpoints are made of.
    """

    def __init__(
        self,
        preset: Preset,
        seed: int,
        cell: Cell,
        model: SortingDQN | BatchTD3,
        env: BatchVecEnv,
        parts: CheckpointParts,
    ) -> None:
        self.preset, self.seed, self.cell = preset, seed, cell
        self.model, self._env, self._parts = model, env, parts
        # Stable-Baselines3's own makes a folder in /tmp, even where it writes nothing.
        model.set_logger(Logger(None, []))
        self._cpu_before, self._cpu_start = 0.0, time.process_time()
        self._untimed = 0.0
        self._commits: list[Any] = []
        self._files: MemoryFiles | None = None
        self._saved: Mapping[str, Any] | None = None
        self.state_parts: dict[str, Stateful] = {
            "networks": NetworkState({**parts.policy, **parts.targets}, parts.optimizers),
            "model": model,
            "env": env,
            "generators": GlobalGenerators(),
        }
        """All that changes in a training besides the transitions of the replay memory, in the
        order of restoring; scenarios add theirs."""
        if isinstance(model.replay_buffer, PrioritisedReplay):
            self.state_parts["memory"] = Priorities(model.replay_buffer)

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

    @contextmanager
    def untimed(self) -> Iterator[None]:
        """Do not count CPU time that goes into measuring, not into training."""
        began = time.process_time()
        yield
        self._untimed += time.process_time() - began

    def keep_states(self, files: MemoryFiles) -> None:
        """Keep states to resume from; transitions go to files."""
        self._files = files

    def learn(self, callback: BaseCallback, report: Callable[[], bool]) -> bool:
        """Train to the end, or until a report stops it before; return whether it was stopped.

        Args:
            callback: Called by Stable-Baselines3 in every step.
            report: Called after each step and its updates; whether the training continues.

        Deviates: Stable-Baselines3's ``learn`` can only be left before a transition is stored
        and learned from; this loop reports and ends between two complete steps, so that a
        state is the same whether the training was interrupted or not.
        """
        model, total = self.model, self.preset.learning.total_steps
        left = total - self.step
        if left <= 0:
            return False
        _, called = model._setup_learn(left, callback, self.step == 0)
        memory, frequency = model.replay_buffer, model.train_freq
        assert memory is not None and isinstance(frequency, TrainFreq)
        while self.step < total:
            model.collect_rollouts(
                self._env,
                called,
                frequency,
                memory,
                learning_starts=model.learning_starts,
            )
            if self.step > model.learning_starts:
                model.train(model.gradient_steps, model.batch_size)
            if not report():
                break
        return self.step < total

    def policy(self) -> Checkpoint:
        """Return the checkpoint of the present policy."""
        manifest = {
            "format": formats.FORMAT,
            "kind": "policy",
            "preset": self.preset.model_dump(),
            "seed": self.seed,
            **manifest_fields(self.cell),
            "layout": [list(entry) for entry in self._parts.layout],
            "act_size": self._parts.act_size,
            "width": self.preset.networks.width,
            "step": self.step,
            "updates": self.updates,
            "trained_range": self._parts.trained_range(),
            **self._provenance(),
        }
        return formats.pack(manifest, weights_of(self._parts.policy))

    def save(self, on_checkpoint: OnCheckpoint) -> None:
        """Pass on the policy and the state; then delete files of earlier states."""
        state = None if self._files is None else self._state(self._files)
        on_checkpoint(self.step, self.policy(), state)
        if self._files is not None and state is not None:
            self._files.keep([state.manifest, self._saved])
            self._saved = state.manifest

    def restore(self, state: TrainingState) -> None:
        """Continue from a state; :meth:`keep_states` must have been called.

        Raises:
            CheckpointMismatch: The state belongs to another training or program.
            Damaged: A file of the replay memory is missing or changed.
        """
        states.require_origin(state, self.preset, self.seed, self.cell)
        manifest, memory = state.manifest, self.model.replay_buffer
        assert self._files is not None and memory is not None
        self._files.read(memory, state.step // self._env.num_envs, manifest["memory"])
        entries = state.entries()
        for name, part in self.state_parts.items():
            part.load_state_dict(under(entries, name))
        self.model._last_obs = entries["last_obs"].copy()
        self._cpu_before, self._saved = float(manifest["cpu_s"]), manifest
        self._commits = list(manifest["commits"])
        if manifest["versions"] != versions() or self._provenance()["commits"] != self._commits:
            logger.warning(
                "the training continues with another version of this program or of its "
                "libraries: its end may differ from that of an uninterrupted training"
            )

    def _state(self, files: MemoryFiles) -> TrainingState:
        memory, following = self.model.replay_buffer, self.model._last_obs
        assert memory is not None and isinstance(following, np.ndarray)
        entries: State = {"last_obs": following}
        for name, part in self.state_parts.items():
            entries |= {f"{name}.{key}": one for key, one in part.state_dict().items()}
        manifest = {
            **states.origin(self.preset, self.seed, self.cell),
            "step": self.step,
            "cpu_s": self.cpu_s,
            "memory": files.write(memory, self.step // self._env.num_envs, following),
            **self._provenance(),
        }
        return states.pack(manifest, entries)

    def _provenance(self) -> dict[str, Any]:
        """Return the commits of this program in all attempts, and versions of libraries."""
        commit = describe()["commit"]
        known = commit is None or commit in self._commits
        commits = self._commits if known else [*self._commits, commit]
        return {"commits": commits, "versions": versions()}
