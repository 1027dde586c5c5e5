"""Observations of one state for each of several candidates, as task selection needs them."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec, as_kernel_array
from app.sim.core.jit import direct
from app.sim.pick.batch import Flags, observation_workspace_of
from app.sim.pick.kernels.candidates import (
    CandidateWorkspace,
    Surroundings,
    Targets,
    observe_candidates,
)
from app.sim.pick.kernels.grasp import REACH_ONLY, GraspRules
from app.sim.pick.kernels.observation_layout import N_FEATURES
from app.sim.pick.task_policy import NOT_BEGUN, PickProgress
from app.sim.robot.kernels.arm import new_robot_pose
from app.sim.scene.scene import arm_of


class CandidateObserver:
    """Observes candidates in one cell; safe to call from several threads.

    Args:
        n_obs: Length of an observation, one of those in ``batch.VIEWS``.
        grasp: Phases of a pick.
    """

    def __init__(
        self, cell: Cell, *, n_obs: int = N_FEATURES, grasp: GraspRules = REACH_ONLY
    ) -> None:
        self._arm, self._floor_z = arm_of(cell), float(cell.floor_z)
        self._n_obs, self._grasp = n_obs, grasp
        self._work = CandidateWorkspace(  # the kernel keeps the GIL
            new_robot_pose(self._arm),
            observation_workspace_of(cell),
            np.zeros(6),
            np.zeros(6),
            np.zeros(3),
        )
        self._kernel: Callable[..., None] | None = None

    def observe(
        self,
        robot: tuple[Vec, Vec],
        people: tuple[Vec, Vec, Vec],
        goals: Vec,
        time_left_s: float,
        current: int | None = None,
        progress: PickProgress = NOT_BEGUN,
    ) -> tuple[NDArray[np.float32], Flags]:
        """Return the observation of each of n candidates, beside people or each of m sets.

        Args:
            robot: Joint positions [rad] and speeds [rad/s], shape (6,) each.
            people: Joint positions [m, rad] and speeds [m/s, rad/s] of P people, the one
                nearest to the robot first, shape (P, 18) or (m, P, 18) each, and body
                dimensions [m], (P, body.N_SIZE) or (m, P, body.N_SIZE).
            goals: Targets [m], shape (n, 3).
            time_left_s: Time left [s].
            current: Number of the target that is being picked.

        Returns:
            Observations, shape (m n, n_obs), those of one set of people together, and whether
            each target is reachable, (n,).
        """
        q, qd = as_kernel_array(robot[0]), as_kernel_array(robot[1])
        sets = [as_kernel_array(value) for value in people]
        if sets[0].ndim == 2:
            sets = [value[None] for value in sets]
        at, share = -1 if current is None else current, progress.closing_s / self._grasp.close_s
        targets = Targets(as_kernel_array(goals), at, progress.phase, share)
        n = len(targets.goals)
        reachable = np.empty(n, dtype=np.bool_)
        obs = np.empty((len(sets[0]) * n, self._n_obs), dtype=np.float32)
        around = Surroundings(q, qd, sets[0], sets[1], sets[2], float(time_left_s))
        shared = self._arm, self._floor_z, self._grasp
        arguments = (*shared, around, targets, self._work, reachable, obs)
        if self._kernel is None:
            self._kernel = direct(observe_candidates, arguments)
        self._kernel(*arguments)
        return obs, reachable
