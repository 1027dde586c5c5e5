"""Reports between two steps of a training: learning curve, checkpoints, stop."""

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from stable_baselines3.common.callbacks import BaseCallback

from app.errors import SimulationError
from app.policies.training.progress import Progress
from app.policies.training.run import OnCheckpoint, TrainingRun
from app.state_dict import Stateful


class Callbacks(NamedTuple):
    """Receivers of what a training reports."""

    on_progress: Callable[[Progress], None]
    """Takes the points of the learning curve."""
    on_checkpoint: OnCheckpoint
    """Takes step, policy and state."""
    should_stop: Callable[[], bool]
    """Called after every step of the environments; whether the training stops."""


class Reporter(BaseCallback, Stateful, ABC):
    """Reports every ``progress_steps``; scenarios define the rates.

    Args:
        run: The attempt.
        callbacks: Receivers of the curve and of checkpoints.
    """

    def __init__(self, run: TrainingRun, callbacks: Callbacks) -> None:
        super().__init__()
        self._run, self._callbacks = run, callbacks
        self._begin_window()

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore a state; rates per second are measured from now on."""
        super().load_state_dict(state)
        self._begin_window()

    @abstractmethod
    def watch(self, rewards: Any) -> None:
        """Process the last step; ``rewards`` have the shape (n_envs,)."""

    @abstractmethod
    def rates(self) -> dict[str, Any]:
        """Return episodes, success, collision, timeout and reward since the last point."""

    def _begin_window(self) -> None:
        self._wall, self._window_step = time.monotonic(), self._run.step
        self._window_updates = self._run.updates

    def _on_step(self) -> bool:
        rewards = np.asarray(self.locals["rewards"])
        if not np.isfinite(rewards).all():
            raise SimulationError(
                f"non-finite reward at step {self.num_timesteps}, seed {self._run.seed}"
            )
        self.watch(rewards)
        return True

    def report(self) -> bool:
        """Report after a step and its updates; return whether the training continues."""
        step, intervals = self._run.step, self._run.preset.learning
        if step % intervals.progress_steps == 0 or step >= intervals.total_steps:
            self._callbacks.on_progress(self._point(step))
            self._begin_window()
            if step % intervals.checkpoint_steps == 0:
                self._run.save(self._callbacks.on_checkpoint)
        return not self._callbacks.should_stop()

    def _point(self, step: int) -> Progress:
        wall = max(1e-6, time.monotonic() - self._wall)
        speed = (step - self._window_step) / wall
        total, updates = self._run.preset.learning.total_steps, self._run.updates
        has_rate = updates > self._window_updates or step >= total
        return Progress(
            step=step,
            total_steps=total,
            updates=updates,
            updates_per_s=(updates - self._window_updates) / wall,
            steps_per_s=speed,
            time_left_s=(total - step) / speed if has_rate else None,
            **self.rates(),
            cpu_s=self._run.cpu_s,
        )
