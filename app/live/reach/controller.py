"""Controller of a live reach cell: a reach policy, or straight motion in joint space.

The policy receives the observation it was trained with: a
:class:`~app.sim.reach.batch.ReachBatch` of one environment is filled with robot, people and
goal. Without a policy the robot moves straight in joint space to the configuration with
vertical tool at the goal, regardless of people.
"""

import time

import numpy as np

from app.live.arm import GAIN, LiveArm
from app.live.reach.interfaces import LiveReachPolicy
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.core.out_of_range import OutOfRangeValue
from app.sim.people.kernels.pedestrian import GROWTH, VX, VY, R, X, Y
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.kernels.observation import NO_PERSON
from app.sim.reach.reach_actor import observed_people
from app.sim.robot.kernels.arm import Arm
from app.sim.safety.layer import SafetySettings
from app.sim.scene.scene import HumanKind

_ROW = np.zeros(1, dtype=np.int64)
_OBSERVED = [X, Y, VX, VY, R, GROWTH]
"""Variables of a pedestrian that policies observe."""
TIME_LIMIT_S = 5.0
"""Time limit of a goal [s] (docs/method.md 2.3)."""


class ReachController:
    """Queries a policy for the live state; None moves straight to the goal."""

    def __init__(self, cell: Cell, policy: LiveReachPolicy | None) -> None:
        self._cell = cell
        self.use(policy)

    def use(self, policy: LiveReachPolicy | None) -> None:
        """Replace the policy."""
        self.policy = policy
        self.inference_mode = "" if policy is None else default_mode(policy)
        self.elapsed_ms: float | None = None
        self.outside: tuple[OutOfRangeValue, ...] = ()
        """Inputs of the last decision outside the training range."""
        self._batch: ReachBatch | None = None

    @property
    def inference_modes(self) -> tuple[str, ...]:
        """Inference modes of the policy."""
        return () if self.policy is None else self.policy.inference_modes

    @property
    def observed_people(self) -> int | None:
        """Greatest number of people that the policy observes; None without a policy."""
        if self.policy is None:
            return None
        alone = "distance-weighted" in self.inference_mode  # beside each of them
        return MAX_PEOPLE if alone else observed_people(self.policy.view)

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
        """Return the action of the next period, in [-1, 1], shape (6,).

        Args:
            robot: State of the robot.
            walkers: States of the people, shape (n, N_STATE) of
            ``people/kernels/pedestrian.py``.
            goal: Target of the tcp [m], shape (3,).
            clear_m: Separation distance [m].
            time_left: Time left to reach the goal [s].
            elapsed: Time since the motion began [s].
            safety: Safety layer that limits the action; None without one.
        """
        if self.policy is None:
            return straight(robot.arm, robot.q, robot.configuration_at(goal)[0])
        started = time.perf_counter()
        batch = self._filled(self.policy, robot, walkers, clear_m, time_left)
        batch.state.elapsed[0] = elapsed
        batch.state.goal[0] = goal
        found = self.policy.acts(batch, self.inference_mode, safety)[0]
        act = np.asarray(found, dtype=np.float64)
        self.elapsed_ms = 1e3 * (time.perf_counter() - started)
        self.outside = self._outside(self.policy, batch)
        return np.clip(act, -1.0, 1.0)

    def _outside(
        self, policy: LiveReachPolicy, batch: ReachBatch
    ) -> tuple[OutOfRangeValue, ...]:
        """Return the inputs of a decision outside the training range."""
        state, rows = batch.state, batch.state.people.walkers.rows[0]
        people: list[tuple[int | None, Vec]] = [
            (k, row[_OBSERVED]) for k, row in enumerate(rows)
        ] or [(None, np.array(NO_PERSON))]
        if self.observed_people == 1 < len(rows):
            people = [people[int(batch.person_distances(_ROW)[0].argmin())]]
        values = np.concatenate((state.q[0], state.qd[0], state.goal[0]))
        return policy.outside(values, people)

    def _filled(
        self, policy: LiveReachPolicy, robot: LiveArm, walkers: Vec, clear_m: float, left: float
    ) -> ReachBatch:
        """Return the batch with the live state in its one environment."""
        n = len(walkers)
        if self._batch is None or self._batch.state.people.walkers.rows.shape[1] != n:
            people: tuple[HumanKind, ...] = tuple("walker" for _ in range(n))
            settings = ReachSettings(
                people=people,
                time_limit_s=TIME_LIMIT_S,
                observation=policy.view,
                action=policy.action,
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


def default_mode(policy: LiveReachPolicy) -> str:
    """Return the initial inference mode: interpolated and with rollout where available."""
    preferred = ("interpolated-rollout", "direct-rollout", "interpolated")
    modes = policy.inference_modes
    return next((mode for mode in preferred if mode in modes), modes[0])


def straight(arm: Arm, q: Vec, target: Vec) -> Vec:
    """Return the action straight in joint space to a configuration [rad], shape (6,)."""
    speed = GAIN * (target - q)
    fastest = float(np.max(np.abs(speed) / arm.limits.qd_max))
    return np.asarray(speed / arm.limits.qd_max / max(1.0, fastest))
