"""The reach scenario under speed and separation monitoring.

:class:`MonitoredReachBatch` is a :class:`~app.sim.reach.batch.ReachBatch` whose control periods
pass through the safety layer (``reach/monitored/kernels/step.py``); policies, planners and
trainings use both alike. Its people may follow given tracks, such as those of ``crossings.py``.

Source: docs/method.md 2.6 (last row) and 2.7.
"""

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.collision.checker import Shapes
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.people.kernels.pedestrian import GROWTH, VX, VY
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.monitored.kernels import step
from app.sim.reach.monitored.kernels.state import Commands, StepResults
from app.sim.robot.kernels import acceleration_bounds
from app.sim.robot.kernels.joints import JointState
from app.sim.safety.layer import SafetySettings
from app.sim.scenario.kernels.episode import Indices
from app.sim.scenario.kernels.monitored_motion import begin_envs
from app.sim.scenario.monitoring import (
    MonitoredEpisodes,
    MonitoringSettings,
    monitored_episodes,
    new_monitored_state,
)
from app.sim.scenario.step_result import StepResult
from app.sim.scene.scene import require_finite, require_shape

HORIZON_S = 5.0
"""Largest time left that policies observe [s]: the time limit of docs/method.md 2.3."""
DEFAULT_MONITORING = MonitoringSettings()


class MonitoredReachBatch(ReachBatch):
    """Many independent reach environments under the safety layer.

    Args:
        cell: Work cell with a goal region.
        seed: Seed; see :class:`~app.sim.reach.batch.ReachBatch`.
        settings: Settings of the scenario; a collision ends the episode.
        safety: Assumptions of the safety layer.
        monitoring: Further settings.
        tracks: Cylinder of each environment's only person at the ends of control periods: x, y,
            radius [m], shape (n_envs, n + 1, 3); None for people who walk by themselves.

    Raises:
        InvalidInput: The tracks have another shape, or their person is not one cylinder.
        SimulationError: A number of the tracks is NaN or infinite.
    """

    STATE = (*ReachBatch.STATE, "_monitor")

    def __init__(
        self,
        cell: Cell,
        n_envs: int,
        seed: int,
        settings: ReachSettings,
        safety: SafetySettings,
        monitoring: MonitoringSettings = DEFAULT_MONITORING,
        *,
        tracks: Vec | None = None,
    ) -> None:
        super().__init__(cell, n_envs, seed, settings)
        self.safety, self.n_tracks = safety, 0 if tracks is None else len(tracks)
        if tracks is not None:
            self._require_tracks(tracks)
        self._monitor = new_monitored_state(self, safety, monitoring, tracks, HORIZON_S)

    def _require_tracks(self, tracks: Vec) -> None:
        if self.cell.workers or len(self.cell.cylinders) != 1:
            kinds = [person.kind for person in self.cell.people]
            raise InvalidInput("people", kinds, "must be one cylinder where it has a track")
        if tracks.ndim != 3:
            raise InvalidInput("tracks", tracks.shape, "must have three dimensions")
        require_shape("tracks", tracks, (self.n_envs, max(1, tracks.shape[1]), 3))
        require_finite("tracks", tracks)

    @property
    def override(self) -> Vec:
        """Override of the last control period in [0, 1], shape (n_envs,)."""
        return self._monitor.override

    def step(
        self, act: NDArray[np.float32], *, auto_reset: bool = True, features: bool = True
    ) -> StepResult:
        """Move every environment through one control period under the safety layer.

        Args:
            act: Actions in [-1, 1], shape (n_envs, 6); the settings choose their type.
            auto_reset: Start the next episode where one ended; else the environment stays.
            features: Whether observations are wanted.

        Raises:
            InvalidInput: The actions have another shape, or ``auto_reset`` with tracks.
            SimulationError: An action is NaN or infinite.
        """
        if auto_reset and self.n_tracks:
            raise InvalidInput(
                "auto_reset", auto_reset, "must be false where people have tracks"
            )
        return super().step(act, auto_reset=auto_reset, features=features)

    def _start(self, envs: Indices) -> None:
        super()._start(envs)
        world, state, monitor = self.world, self.state, self._monitor
        self._call(begin_envs, world.arm, world.people, state, envs, monitor, self._work)

    def _move(self, act: NDArray[np.float32]) -> None:
        self._execute(self._all, Commands(act, np.empty((0, 6))))

    def _execute(self, envs: Indices, commands: Commands) -> None:
        """Step some environments by actions or segments."""
        state = self.world, self._task, self.state, self._monitor, self._work
        results = StepResults(self._rew, self._ended)
        self._call(step.step_envs, *state, envs, commands, results)

    def step_speeds(self, env: int, wanted: Vec) -> None:
        """Move one environment through one control period toward joint speeds, for planners.

        Args:
            wanted: Joint speeds after the control period [rad/s], shape (6,).
        """
        require_shape("wanted", wanted, (6,))
        require_finite("wanted", wanted)
        arm, state = self.arm, self.state
        segments, end = np.empty((1, 6)), JointState(np.empty(6), np.empty(6), np.empty(6))
        start = JointState(
            as_kernel_array(state.q[env]), as_kernel_array(state.qd[env]), np.zeros(6)
        )
        acceleration_bounds.advance_to_speeds(
            arm.limits, arm.dt, start, as_kernel_array(wanted), segments[0], end
        )
        none = np.empty((0, 6), dtype=np.float32)
        self._execute(np.array([env]), Commands(none, segments))

    def people_shapes(self, env: int) -> Shapes:
        """Return the people of one environment as obstacles for planners."""
        walkers = self.state.people.cylinders[env]
        top = np.full((len(walkers), 1), self.world.people.top_z)
        return Shapes(
            capsules=as_kernel_array(self.state.people.capsules[env]),
            cylinders=np.hstack([walkers, top]),
            going=self.state.people.walkers.rows[env][:, [VX, VY, GROWTH]],
        )

    def runs(self) -> MonitoredEpisodes:
        """Return the results of all environments, once all episodes have ended."""
        return monitored_episodes(self._monitor, self.state, self.arm.dt)
