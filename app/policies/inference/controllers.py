"""Controllers of the robot made of one trained policy, by inference mode.

A mode is a set of three independent switches (docs/method.md 2.4):

interpolated   mean of the policy's actions for the training targets around the goal
distance-weighted
               mean over people of its actions beside each of them alone, weighted by distance;
               otherwise the nearest person is observed
rollout        rollout policy improvement of the resulting action (``rollout.py``)

Source: for several people the outlook of thesis 4.5, "deploying a policy for each person inside
the robot workspace and then averaging the action based on the distance between human and
robot", which leaves the weights open.
"""

from abc import ABC, abstractmethod
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.errors import CheckpointMismatch, InvalidInput
from app.policies.inference.rollout import (
    NO_CONSTRAINT,
    RolloutImprovement,
    SsmConstraint,
    can_roll_out,
)
from app.policies.inference.target_interpolation import Interpolation, interpolates
from app.sim.core.arrays import Vec
from app.sim.reach.batch import ReachBatch
from app.sim.reach.reach_actor import ReachActor
from app.sim.scenario.kernels.episode import RUNNING


class InferenceMode(StrEnum):
    """All combinations of the switches; without one the policy is queried directly."""

    DIRECT = "direct"
    INTERPOLATED = "interpolated"
    DISTANCE_WEIGHTED = "distance-weighted"
    DISTANCE_WEIGHTED_INTERPOLATED = "distance-weighted-interpolated"
    DIRECT_ROLLOUT = "direct-rollout"
    INTERPOLATED_ROLLOUT = "interpolated-rollout"
    DISTANCE_WEIGHTED_ROLLOUT = "distance-weighted-rollout"
    DISTANCE_WEIGHTED_INTERPOLATED_ROLLOUT = "distance-weighted-interpolated-rollout"

    @property
    def interpolated(self) -> bool:
        """Whether actions are interpolated between training targets."""
        return "interpolated" in self.value

    @property
    def distance_weighted(self) -> bool:
        """Whether actions are averaged over people, weighted by distance."""
        return "distance-weighted" in self.value

    @property
    def rollout(self) -> bool:
        """Whether actions are improved by rollouts."""
        return self.value.endswith(ROLLOUT)


ROLLOUT = "-rollout"
"""End of the names of modes with rollouts."""
NEAREST_M = 0.05
"""Distance below which weights stop growing [m]."""
POWER = 2.0
"""Weights fall with this power of the distance."""
Actions = NDArray[np.float32]
Rows = NDArray[np.int64]


class Controller(Protocol):
    """Selects the actions of a batch."""

    def acts(self, batch: ReachBatch) -> Actions:
        """Return actions in [-1, 1], shape (n_envs, 6); 0 where the episode has ended."""


class PolicyQuery(ABC):
    """Controller that queries a policy, beside all people or beside one of them alone."""

    def acts(self, batch: ReachBatch) -> Actions:
        """Return actions; see :class:`Controller`.

        Raises:
            GoalOutside: A goal lies outside the training targets interpolated between.
        """
        act = np.zeros((batch.n_envs, 6), dtype=np.float32)
        rows = np.flatnonzero(batch.state.outcome == RUNNING)
        if rows.size:
            act[rows] = self.query(batch, rows, None)
        return act

    @abstractmethod
    def query(self, batch: ReachBatch, rows: Rows, person: int | None) -> Actions:
        """Return actions in [-1, 1], shape (k, 6).

        Args:
            rows: Indices of the queried environments, shape (k,).
            person: Index of the only person that is observed; None for all people.
        """


class Direct(PolicyQuery):
    """The policy for its own goal."""

    def __init__(self, actor: ReachActor) -> None:
        self._actor = actor

    def query(self, batch: ReachBatch, rows: Rows, person: int | None) -> Actions:
        """Return actions; see :class:`PolicyQuery`."""
        _require_view(self._actor, batch)
        obs = batch.observe_goals(rows, batch.state.goal[rows][:, None], person)
        return self._actor.acts(obs[:, 0])


class Interpolated(PolicyQuery):
    """The policy between its training targets.

    Args:
        actor: A policy trained on a grid or a Halton set.

    Raises:
        InvalidInput: It was trained on a continuous set of goals.
    """

    def __init__(self, actor: ReachActor) -> None:
        self._between = Interpolation(actor)

    def query(self, batch: ReachBatch, rows: Rows, person: int | None) -> Actions:
        """Return actions; see :class:`PolicyQuery`."""
        _require_view(self._between.actor, batch)
        mix, places = self._between.around(batch.state.goal[rows], "goals")
        return self._between.acts(batch.observe_goals(rows, places, person), mix)


class DistanceWeighted(PolicyQuery):
    """The distance-weighted mean over people of the actions beside each of them alone.

    With one person it is the query itself, exactly.
    """

    def __init__(self, query: PolicyQuery) -> None:
        self._query = query

    def query(self, batch: ReachBatch, rows: Rows, person: int | None) -> Actions:
        """Return actions; see :class:`PolicyQuery`."""
        if person is not None or batch.n_people < 2:
            return self._query.query(batch, rows, person)
        weights = person_weights(batch.person_distances(rows))
        mean = np.zeros((len(rows), 6))
        for k in range(batch.n_people):
            mean += weights[:, k, None] * self._query.query(batch, rows, k)
        return mean.astype(np.float32)


class RolloutController:
    """Rollout policy improvement of another controller.

    Args:
        base: Controller whose actions are improved.
        actor: Policy that is simulated.
        constraint: Separation that the safety layer requires.

    Raises:
        InvalidInput: The policy cannot be simulated by the kernels.
    """

    def __init__(
        self, base: Controller, actor: ReachActor, constraint: SsmConstraint = NO_CONSTRAINT
    ) -> None:
        self._base, self._improvement = base, RolloutImprovement(actor)
        self.constraint = constraint
        """Separation that the safety layer requires."""

    def acts(self, batch: ReachBatch) -> Actions:
        """Return actions; see :class:`Controller`."""
        act = self._base.acts(batch)
        self._improvement.constraint = self.constraint
        self._improvement.improve(batch, act)
        return act


def person_weights(distances: Vec) -> Vec:
    """Return the weights of people: the inverse square of the distance, normalised.

    Args:
        distances: Distances of robot and people [m], shape (n, n_people), at least one.

    Returns:
        Weights, which sum to one in every row, shape (n, n_people).
    """
    weight: Vec = np.maximum(distances, NEAREST_M) ** -POWER
    shares: Vec = weight / weight.sum(axis=1, keepdims=True)
    return shares


def controller_of(actor: ReachActor, mode: str | None = None) -> Controller:
    """Return the controller of a policy in an inference mode.

    Args:
        mode: The mode; None interpolates where the policy has training targets.

    Raises:
        InvalidInput: There is no such mode, or the policy does not allow it.
    """
    if mode is None:
        mode = InferenceMode.INTERPOLATED if interpolates(actor) else InferenceMode.DIRECT
    if mode not in tuple(InferenceMode):
        raise InvalidInput("inference_mode", mode, "must be a mode", tuple(InferenceMode))
    chosen = InferenceMode(mode)
    query = Interpolated(actor) if chosen.interpolated else Direct(actor)
    base = DistanceWeighted(query) if chosen.distance_weighted else query
    return RolloutController(base, actor) if chosen.rollout else base


def inference_modes_of(actor: ReachActor) -> tuple[InferenceMode, ...]:
    """Return the inference modes that a policy allows."""
    targets, rollouts = interpolates(actor), can_roll_out(actor)
    return tuple(
        mode
        for mode in InferenceMode
        if (targets or not mode.interpolated) and (rollouts or not mode.rollout)
    )


def _require_view(actor: ReachActor, batch: ReachBatch) -> None:
    """Check that a batch has the observation of the policy.

    Raises:
        CheckpointMismatch: It has another one.
    """
    if batch.settings.observation != actor.view:
        raise CheckpointMismatch("view", batch.settings.observation, actor.view)
