"""What moves the robot of a live reach cell: a policy, or a straight way to a posture.

The policy sees what it saw in training: the row of a :class:`~app.sim.reach.batch.ReachBatch`
is
filled with robot, people and goal as they are, and observed. Without a policy the robot goes
straight in joint space to the posture with its tool pointing down at the goal, whoever stands
in the way.
"""

import time

import numpy as np

from app.live.arm import GAIN, LiveArm
from app.live.reach.interfaces import ReachPilot
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.people.kernels.pedestrian import R, X, Y
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.robot.kernels.arm import Arm
from app.sim.safety.layer import SafetySettings
from app.sim.scene.scene import HumanKind

TIME_LIMIT_S = 5.0
"""Time to reach a goal [s] (METHOD 2.3)."""


class LiveReacher:
    """Asks a policy about the live state.

    Args:
        cell: Cell with a goal region.
        pilot: Moves; None goes straight.
    """

    def __init__(self, cell: Cell, pilot: ReachPilot | None) -> None:
        self._cell = cell
        self.elapsed_ms: float | None = None
        """Time the last decision took [ms]."""
        self.use(pilot)

    def use(self, pilot: ReachPilot | None) -> None:
        """Let another policy move."""
        self.pilot = pilot
        self.way = "" if pilot is None else usual_way(pilot)
        self.elapsed_ms = None
        self._batch: ReachBatch | None = None

    @property
    def ways(self) -> tuple[str, ...]:
        """How the policy can be asked."""
        return () if self.pilot is None else self.pilot.ways

    def act(
        self,
        robot: LiveArm,
        walkers: Vec,
        goal: Vec,
        clear_m: float,
        time_left: float,
        elapsed: float,
        safety: SafetySettings | None,
    ) -> Vec:
        """Return the action for the period to come, in [-1, 1], shape (6,).

        Args:
            robot: Where the robot is.
            walkers: The people, shape (n, N_STATE) of ``people/kernels/pedestrian.py``.
            goal: Where the tcp shall be [m], shape (3,).
            clear_m: Distance of robot and people [m].
            time_left: Time left to reach it [s].
            elapsed: Time for which it has been sought [s].
            safety: What the safety layer assumes that the robot obeys; None without one.
        """
        if self.pilot is None:
            return straight(robot.arm, robot.q, robot.posture_at(goal)[0])
        started = time.perf_counter()
        batch = self._filled(self.pilot, robot, walkers, clear_m, time_left)
        batch.state.elapsed[0] = elapsed
        batch.state.goal[0] = goal
        act = np.asarray(self.pilot.acts(batch, self.way, safety)[0], dtype=np.float64)
        self.elapsed_ms = 1e3 * (time.perf_counter() - started)
        return np.clip(act, -1.0, 1.0)

    def _filled(
        self, pilot: ReachPilot, robot: LiveArm, walkers: Vec, clear_m: float, left: float
    ) -> ReachBatch:
        """Return the batch with its one row as the live cell is."""
        n = len(walkers)
        if self._batch is None or self._batch.state.people.walkers.rows.shape[1] != n:
            people: tuple[HumanKind, ...] = tuple("walker" for _ in range(n))
            settings = ReachSettings(
                people=people,
                time_limit_s=TIME_LIMIT_S,
                observation=pilot.view,
                action=pilot.action,
                start="uniform",
            )
            self._batch = ReachBatch(self._cell, 1, 0, settings)
            self._batch.reset()
        state = self._batch.state
        state.q[0], state.qd[0], state.qdd[0] = robot.q, robot.qd, robot.qdd
        state.people.walkers.rows[0] = walkers
        state.people.cylinders[0] = walkers[:, [X, Y, R]]
        state.clear[0, 0], state.time_left[0] = clear_m, left
        return self._batch


def usual_way(pilot: ReachPilot) -> str:
    """Return how a policy is asked at first: between its targets and ahead where it can be."""
    wanted = ("interpolated-ahead", "direct-ahead", "interpolated")
    return next((way for way in wanted if way in pilot.ways), pilot.ways[0])


def straight(arm: Arm, q: Vec, posture: Vec) -> Vec:
    """Return the action that leads straight, in joint space, to a posture [rad], shape (6,)."""
    speed = GAIN * (posture - q)
    fastest = float(np.max(np.abs(speed) / arm.limits.qd_max))
    return np.asarray(speed / arm.limits.qd_max / max(1.0, fastest))
