"""The reach scenario under the safety layer: what is commanded, SSM scales or stops.

:class:`MonitoredReachBatch` is a :class:`~app.sim.reach.batch.ReachBatch` whose periods go through
speed and
separation monitoring (``reach/monitored/kernels/step.py``), so whatever drives the one drives
the
other: policies, planners, training. Its people may also follow given tracks, such as those of
``crossings.py``. Source: METHOD 2.6 (last row) and 2.7.
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
from app.sim.reach.monitored.kernels import step as guarded_reach
from app.sim.reach.monitored.kernels.step import (
    BELOW_HALF,
    CELL,
    CONTACT,
    FASTEST,
    HELD,
    JOINT_WAY,
    N_ACCOUNT,
    PERIODS,
    PERSON,
    SPEED,
    STANDING,
    STOPPED,
    TOOL_WAY,
    Guard,
)
from app.sim.robot.kernels import acceleration_bounds as polynomial
from app.sim.robot.kernels.joints import JointState
from app.sim.safety.kernels import separation_check as watch
from app.sim.safety.kernels.adversarial_people import new_trial_work
from app.sim.safety.kernels.adversarial_trials import MOVING
from app.sim.safety.layer import SafetySettings, separation_rule
from app.sim.scenario.batch import Rows, StepResult
from app.sim.scenario.kernels.episode import SUCCESS
from app.sim.scene.scene import new_people_state, require_finite, require_shape

HORIZON_S = 5.0
"""Time left that policies are shown at most [s]: the length of an episode of METHOD 2.3."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitoredEpisodes:
    """What happened in n episodes under the safety layer; arrays of shape (n,)."""

    arrived: NDArray[np.bool_]
    """Whether the tcp came within 0.1 m of the goal in time."""
    seconds: Vec
    """How long the episode was [s]."""
    stopped_s: Vec
    """Time with override 0 [s]."""
    below_half_s: Vec
    """Time with override below one half, that at 0 included [s]."""
    standing_s: Vec
    """Time at rest for whatever reason [s]."""
    held_s: Vec
    """Time at rest with override 0 [s]; a stop that is begun and not ended is no rest."""
    joint_way: Vec
    """Way in joint space [rad]."""
    tool_way: Vec
    """Way of the tcp [m]."""
    touched_moving: NDArray[np.bool_]
    """Whether a person and a link in motion touched."""
    touched_at_rest: NDArray[np.bool_]
    """Whether a person walked into a link at rest."""
    touched_cell: NDArray[np.bool_]
    """Whether the robot met its cell or itself."""
    link_speed: Vec
    """Speed of the touching link [m/s]."""
    person_speed: Vec
    """Greatest speed of any point of the people [m/s]."""


class MonitoredReachBatch(ReachBatch):
    """Many independent reach cells under the safety layer, stepped together by one thread.

    Args:
        cell: Work cell with a goal region.
        n_envs: Number of cells.
        seed: Seed; see :class:`~app.sim.reach.batch.ReachBatch`.
        settings: Starts, ends and rewards; a collision ends the episode.
        safety: What the safety layer assumes.
        tracks: Cylinder of each cell's only person at the ends of periods: x, y, radius [m],
            shape (n_envs, n + 1, 3); None where people walk by themselves.
        guarded: Whether the layer acts.
        rest_ends: Whether a person who walks into a robot at rest ends the episode; a link in
            motion that is touched always does.
        horizon_s: Most time left that policies are shown [s].
        first_env: Number of the first cell.

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
        *,
        tracks: Vec | None = None,
        guarded: bool = True,
        rest_ends: bool = True,
        horizon_s: float = HORIZON_S,
        first_env: int = 0,
    ) -> None:
        super().__init__(cell, n_envs, seed, settings, first_env)
        self.safety, self.n_tracks = safety, 0 if tracks is None else len(tracks)
        if tracks is not None:
            self._require_tracks(tracks)
        people = self.world.people
        shape = (people.columns.shape[1], len(self.cell.cylinders))
        self._guard = Guard(
            safety=separation_rule(safety, *shape, safety.use_measured_velocity),
            guarded=guarded,
            rest_ends=rest_ends,
            horizon=horizon_s,
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
        """Override of the last period in [0, 1], shape (n_envs,)."""
        return self._guard.override

    def step(
        self, act: NDArray[np.float32], *, auto_reset: bool = True, features: bool = True
    ) -> StepResult:
        """Move every cell through one control period, under the safety layer.

        Args:
            act: Actions in [-1, 1], shape (n_envs, 6); what they mean is in the settings.
            auto_reset: Start the next episode where one ended; else its row stands still.
            features: Whether observations are wanted.

        Raises:
            InvalidInput: The actions have another shape, or a next episode is wanted of people
                on tracks.
            SimulationError: An action is NaN or infinite.
        """
        if auto_reset and self.n_tracks:
            raise InvalidInput(
                "auto_reset", auto_reset, "must be false where people have tracks"
            )
        return super().step(act, auto_reset=auto_reset, features=features)

    def _start(self, rows: Rows) -> None:
        super()._start(rows)
        self._call(
            guarded_reach.begin_rows, self.world, self.state, rows, self._guard, self._work
        )

    def _move(self, act: NDArray[np.float32]) -> None:
        self._step(np.arange(self.n_envs), act, np.empty((0, 6)))

    def _step(self, rows: Rows, act: NDArray[np.float32], pieces: Vec) -> None:
        """Step some cells by actions, or by pieces where there are any."""
        self._call(
            guarded_reach.step_rows,
            self.world,
            self._rules,
            self._action,
            self._weights,
            self.state,
            self._guard,
            self._work,
            rows,
            act,
            pieces,
            self._rew,
            self._ended,
        )

    def step_speeds(self, row: int, wanted: Vec) -> None:
        """Move one cell through one period toward wanted joint speeds, as planners ask.

        Args:
            row: The cell.
            wanted: Joint speeds to have after the period [rad/s], shape (6,).
        """
        require_shape("wanted", wanted, (6,))
        require_finite("wanted", wanted)
        arm, state = self.arm, self.state
        pieces, end = np.empty((1, 6)), JointState(np.empty(6), np.empty(6), np.empty(6))
        start = JointState(
            as_kernel_array(state.q[row]), as_kernel_array(state.qd[row]), np.zeros(6)
        )
        polynomial.advance_to_speeds(
            arm.limits, arm.dt, start, as_kernel_array(wanted), pieces[0], end
        )
        self._step(np.array([row]), np.empty((0, 6), dtype=np.float32), pieces)

    def people_shapes(self, row: int) -> Shapes:
        """Return where one cell's people are now, as planners see them."""
        walkers = self.state.people.cylinders[row]
        top = np.full((len(walkers), 1), self.world.people.top_z)
        return Shapes(
            columns=as_kernel_array(self.state.people.columns[row]),
            cylinders=np.hstack([walkers, top]),
            going=self.state.people.walkers.rows[row][:, [VX, VY, GROWTH]],
        )

    def runs(self) -> MonitoredEpisodes:
        """Return what happened in the episode of every cell, once all have ended."""
        account, dt = self._guard.closed, self.arm.dt
        person, moving = account[:, CONTACT] == PERSON, account[:, SPEED] > MOVING
        return MonitoredEpisodes(
            arrived=self.state.outcome == SUCCESS,
            seconds=dt * account[:, PERIODS],
            stopped_s=dt * account[:, STOPPED],
            below_half_s=dt * account[:, BELOW_HALF],
            standing_s=dt * account[:, STANDING],
            held_s=dt * account[:, HELD],
            joint_way=account[:, JOINT_WAY].copy(),
            tool_way=account[:, TOOL_WAY].copy(),
            touched_moving=person & moving,
            touched_at_rest=person & ~moving,
            touched_cell=account[:, CONTACT] == CELL,
            link_speed=account[:, SPEED].copy(),
            person_speed=account[:, FASTEST].copy(),
        )
