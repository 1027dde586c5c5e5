"""The pick scenario under speed and separation monitoring.

:class:`MonitoredPickBatch` is a :class:`~app.sim.pick.batch.PickBatch` whose control periods
pass through the safety layer (``pick/kernels/monitored_step.py``).

Source: docs/method.md 2.7.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.pick.batch import PickBatch, PickSettings
from app.sim.pick.kernels import monitored_step
from app.sim.safety.layer import SafetySettings
from app.sim.scenario.kernels.episode import Indices
from app.sim.scenario.kernels.monitored_motion import begin_envs
from app.sim.scenario.monitoring import (
    MonitoredEpisodes,
    MonitoringSettings,
    monitored_episodes,
    new_monitored_state,
)

AMONG_HANDS = SafetySettings(protective_distance=0.0)
"""Assumptions without a protective distance: people work at the objects that are picked."""


class MonitoredPickBatch(PickBatch):
    """Many independent pick environments under the safety layer.

    Args:
        seed: Seed; see :class:`~app.sim.pick.batch.PickBatch`.
        settings: Settings of the scenario.
        safety: Assumptions of the safety layer.
        monitoring: Further settings.
    """

    STATE = (*PickBatch.STATE, "_monitor")

    def __init__(
        self,
        cell: Cell,
        n_envs: int,
        seed: int,
        settings: PickSettings,
        safety: SafetySettings,
        monitoring: MonitoringSettings,
        first_env: int = 0,
    ) -> None:
        super().__init__(cell, n_envs, seed, settings, first_env)
        self.safety = safety
        self._monitor = new_monitored_state(self, safety, monitoring)

    @property
    def account(self) -> Vec:
        """Accounts of the present episodes (``monitored_state.py``), (n_envs, N_ACCOUNT)."""
        return self._monitor.account

    def _start(self, envs: Indices) -> None:
        super()._start(envs)
        world, state, monitor = self.world, self.state, self._monitor
        self._call(begin_envs, world.arm, world.people, state, envs, monitor, self._work)

    def _move(self, act: NDArray[np.float32]) -> None:
        shared: tuple[Any, ...] = self.world, self._task, self.state, self._monitor, self._work
        self._call(monitored_step.step_monitored, *shared, act, self._rew, self._ended)

    def runs(self) -> MonitoredEpisodes:
        """Return the results of all environments, once all episodes have ended."""
        return monitored_episodes(self._monitor, self.state, self.arm.dt)
