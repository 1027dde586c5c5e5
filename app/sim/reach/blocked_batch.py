"""Reach environments of the thesis' authors: a contact blocks the arm, the episode goes on.

The authors' simulator computes contact forces, so that the arm does not enter an obstacle. Here
the joint motion of a period that would bring a part of the robot in contact closer to its
obstacle is not executed: the joints keep their positions, at rest. Motion away from the
obstacle is. A person who walks into the robot passes through it.

Source: docs/method.md 2.5; the reward (4.25)-(4.28), with the norm of the action as its cost.
"""

import numpy as np
from numpy.typing import NDArray

from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.reach.batch import ReachBatch, ReachSettings
from app.sim.reach.kernels import queries
from app.sim.reach.recipe_rules import BlockedRules
from app.sim.scenario.kernels.episode import RUNNING, SUCCESS_DISTANCE, Indices

CONTACT = 2e-3
"""Clearance up to which the contact test may report a contact [m]."""


class BlockedReachBatch(ReachBatch):
    """Reach environments in which a contact blocks the arm; arguments as ReachBatch.

    Rewards are ``-c_d d - c_u |a| - c_c [contact] + c_s [reached]``, with the action ``a``;
    with ``bonus_alone`` the period that reaches the goal is rewarded with ``c_s`` only. A goal
    is reached within 0.1 m without a contact in the same period; the episode then ends, and
    counts as a collision if there was a contact before.
    """

    def _move(self, act: NDArray[np.float32]) -> None:
        """Step every running environment, block arms in contact, and fill rewards."""
        state = self.state
        live, touched = state.outcome == RUNNING, state.touched.copy()
        before = [part.copy() for part in (state.q, state.robot, state.clear, state.distance)]
        super()._move(act)
        contact = state.touched > touched
        envs = np.flatnonzero(contact)
        if envs.size:
            self._block(envs, *(part[envs] for part in before))
        self._rew[:] = np.where(live, self._rewards(act, contact), 0.0)

    def _block(self, envs: Indices, q: Vec, robot: Vec, clear: Vec, distance: Vec) -> None:
        """Undo the joint motion of environments in which it deepens a contact.

        Args:
            envs: Environments with a contact in this period, shape (k,).
            q: Their joint positions before it [rad], shape (k, 6).
            robot: Their capsules before it, shape (k, 9, n).
            clear: Their clearances before it [m], shape (k, 3).
            distance: Their distances to the goal before it [m], shape (k,).
        """
        state = self.state
        moved, after = state.q[envs].copy(), state.clear[envs].copy()
        state.q[envs] = q
        self._call(queries.measure_envs, self.world, state, envs, self._observation_work)
        rest = np.column_stack([state.clear[envs, 0], clear[:, 1:]])
        blocked = ((after < rest) & (after <= CONTACT)).any(axis=1)
        free, held = envs[~blocked], envs[blocked]
        state.q[free], state.clear[free] = moved[~blocked], after[~blocked]
        state.clear[held], state.robot[held] = rest[blocked], robot[blocked]
        state.qd[held], state.qdd[held] = 0.0, 0.0
        state.distance[held] = distance[blocked]

    def _rewards(self, act: NDArray[np.float32], contact: NDArray[np.bool_]) -> Vec:
        """Return the rewards of this period, shape (n_envs,)."""
        weights, d = self.settings.weights, self.state.distance
        rules = self.settings.blocked or BlockedRules()
        cost = weights.c_d * d + weights.c_c * contact
        cost = cost + rules.command_cost * np.linalg.norm(act, axis=1)
        reached = (self._ended != RUNNING) & (d < SUCCESS_DISTANCE) & ~contact
        rest = 0.0 if rules.bonus_alone else cost
        return np.where(reached, weights.c_s - rest, -cost)


def new_reach_batch(
    cell: Cell, n_envs: int, seed: int, settings: ReachSettings, first_env: int = 0
) -> ReachBatch:
    """Return reach environments; contacts block the arm where the settings say so."""
    kind = ReachBatch if settings.blocked is None else BlockedReachBatch
    return kind(cell, n_envs, seed, settings, first_env)
