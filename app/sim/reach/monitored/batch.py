"""The reach scenario under speed and separation monitoring.

:class:`MonitoredReachBatch` is a :class:`~app.sim.reach.batch.ReachBatch` whose control cycles
pass through the safety layer (``reach/monitored/kernels/step.py``); policies, planners and
trainings use both alike. Its people may follow given tracks, such as those of ``crossings.py``.

Source: docs/method.md 2.6 (last row) and 2.7.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.collision.checker import Shapes
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.people.kernels.pedestrian import GROWTH, VX, VY
from app.sim.people.kernels.people import new_people_geometry
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.monitored.kernels import step
from app.sim.reach.monitored.kernels.state import (
    BELOW_HALF,
    CELL,
    CONTACT,
    FASTEST,
    JOINT_PATH,
    N_ACCOUNT,
    PERIODS,
    PERSON,
    SPEED,
    STANDSTILL,
    STANDSTILL_STOPPED,
    STOPPED,
    TOOL_PATH,
    Commands,
    MonitoredState,
    StepResults,
)
from app.sim.robot.kernels import acceleration_bounds as polynomial
from app.sim.robot.kernels.joints import JointState
from app.sim.safety.kernels import separation_check as watch
from app.sim.safety.kernels.adversarial_people import new_trial_work
from app.sim.safety.kernels.adversarial_trials import MOVING
from app.sim.safety.layer import SafetySettings, separation_rule
from app.sim.scenario.batch import StepResult
from app.sim.scenario.kernels.episode import SUCCESS, Indices
from app.sim.scene.scene import new_people_state, require_finite, require_shape

HORIZON_S = 5.0
"""Largest time left that policies observe [s]: the time limit of docs/method.md 2.3."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitoringSettings:
    """Settings of the episodes beyond the assumptions of the safety layer."""

    active: bool = True
    """Whether the safety layer acts."""
    rest_ends: bool = True
    """Whether a person who walks into a robot at standstill ends the episode; contact with a
    moving link always does."""
    horizon_s: float = HORIZON_S
    """Largest time left that policies observe [s]."""


DEFAULT_MONITORING = MonitoringSettings()


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitoredEpisodes:
    """Results of n episodes under the safety layer; arrays of shape (n,)."""

    arrived: NDArray[np.bool_]
    """Whether the tcp reached the goal in time."""
    seconds: Vec
    """Duration [s]."""
    stopped_s: Vec
    """Time with override 0 [s]."""
    below_half_s: Vec
    """Time with override below one half, including 0 [s]."""
    standstill_s: Vec
    """Time at standstill for any reason [s]."""
    standstill_stopped_s: Vec
    """Time at standstill with override 0 [s]; braking does not count."""
    joint_path: Vec
    """Path length in joint space [rad]."""
    tool_path: Vec
    """Path length of the tcp [m]."""
    touched_moving: NDArray[np.bool_]
    """Whether a person touched a moving link."""
    touched_at_rest: NDArray[np.bool_]
    """Whether a person walked into a link at standstill."""
    touched_cell: NDArray[np.bool_]
    """Whether the robot touched its cell or itself."""
    link_speed: Vec
    """Speed of the touching link [m/s]."""
    person_speed: Vec
    """Greatest speed of any point of the people [m/s]."""


class MonitoredReachBatch(ReachBatch):
    """Many independent reach environments under the safety layer.

    Args:
        cell: Work cell with a goal region.
        n_envs: Number of environments.
        seed: Seed; see :class:`~app.sim.reach.batch.ReachBatch`.
        settings: Settings of the scenario; a collision ends the episode.
        safety: Assumptions of the safety layer.
        monitoring: Further settings.
        tracks: Cylinder of each environment's only person at the ends of control cycles: x, y,
            radius [m], shape (n_envs, n + 1, 3); None for people who walk by themselves.
        first_env: Number of the first environment.

    Raises:
        InvalidInput: The tracks have another shape, or their person is not one cylinder.
        SimulationError: A number of the tracks is NaN or infinite.
    """

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
        first_env: int = 0,
    ) -> None:
        super().__init__(cell, n_envs, seed, settings, first_env)
        self.safety, self.n_tracks = safety, 0 if tracks is None else len(tracks)
        if tracks is not None:
            self._require_tracks(tracks)
        people = self.world.people
        shape = (people.columns.shape[1], len(self.cell.cylinders))
        self._monitor = MonitoredState(
            safety=separation_rule(safety, *shape, safety.use_measured_velocity),
            active=monitoring.active,
            rest_ends=monitoring.rest_ends,
            horizon=monitoring.horizon_s,
            measured=safety.use_measured_velocity,
            tracks=np.zeros((0, 1, 3)) if tracks is None else as_kernel_array(tracks),
            period=np.zeros(n_envs, dtype=np.int64),
            trial=new_trial_work(
                self.arm,
                people,
                new_people_state(self.cell, people, 1),
                new_people_geometry(people, len(self.cell.workers), len(self.cell.cylinders)),
                (
                    watch.new_ssm_workspace(self.arm, *shape),
                    watch.new_ssm_workspace(self.arm, *shape),
                ),
                0,
            ),
            override=np.ones(n_envs),
            account=np.zeros((n_envs, N_ACCOUNT)),
            closed=np.zeros((n_envs, N_ACCOUNT)),
        )

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
        """Override of the last control cycle in [0, 1], shape (n_envs,)."""
        return self._monitor.override

    def step(
        self, act: NDArray[np.float32], *, auto_reset: bool = True, features: bool = True
    ) -> StepResult:
        """Move every environment through one control cycle under the safety layer.

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
        monitor = self._monitor
        self._call(step.begin_rows, self.world, self.state, envs, monitor, self._work)

    def _move(self, act: NDArray[np.float32]) -> None:
        self._execute(self._all, Commands(act, np.empty((0, 6))))

    def _execute(self, envs: Indices, commands: Commands) -> None:
        """Step some environments by actions or segments."""
        state = self.world, self._task, self.state, self._monitor, self._work
        results = StepResults(self._rew, self._ended)
        self._call(step.step_rows, *state, envs, commands, results)

    def step_speeds(self, env: int, wanted: Vec) -> None:
        """Move one environment through one control cycle toward joint speeds, for planners.

        Args:
            env: Number of the environment.
            wanted: Joint speeds after the cycle [rad/s], shape (6,).
        """
        require_shape("wanted", wanted, (6,))
        require_finite("wanted", wanted)
        arm, state = self.arm, self.state
        segments, end = np.empty((1, 6)), JointState(np.empty(6), np.empty(6), np.empty(6))
        start = JointState(
            as_kernel_array(state.q[env]), as_kernel_array(state.qd[env]), np.zeros(6)
        )
        polynomial.advance_to_speeds(
            arm.limits, arm.dt, start, as_kernel_array(wanted), segments[0], end
        )
        none = np.empty((0, 6), dtype=np.float32)
        self._execute(np.array([env]), Commands(none, segments))

    def people_shapes(self, env: int) -> Shapes:
        """Return the people of one environment as obstacles for planners."""
        walkers = self.state.people.cylinders[env]
        top = np.full((len(walkers), 1), self.world.people.top_z)
        return Shapes(
            columns=as_kernel_array(self.state.people.columns[env]),
            cylinders=np.hstack([walkers, top]),
            going=self.state.people.walkers.rows[env][:, [VX, VY, GROWTH]],
        )

    def runs(self) -> MonitoredEpisodes:
        """Return the results of all environments, once all episodes have ended."""
        account, dt = self._monitor.closed, self.arm.dt
        person, moving = account[:, CONTACT] == PERSON, account[:, SPEED] > MOVING
        return MonitoredEpisodes(
            arrived=self.state.outcome == SUCCESS,
            seconds=dt * account[:, PERIODS],
            stopped_s=dt * account[:, STOPPED],
            below_half_s=dt * account[:, BELOW_HALF],
            standstill_s=dt * account[:, STANDSTILL],
            standstill_stopped_s=dt * account[:, STANDSTILL_STOPPED],
            joint_path=account[:, JOINT_PATH].copy(),
            tool_path=account[:, TOOL_PATH].copy(),
            touched_moving=person & moving,
            touched_at_rest=person & ~moving,
            touched_cell=account[:, CONTACT] == CELL,
            link_speed=account[:, SPEED].copy(),
            person_speed=account[:, FASTEST].copy(),
        )
