"""Interpolation of actions for goals between training targets.

Weights are trilinear among the eight corners of a grid cell (docs/method.md 2.4), barycentric
among the four corners of a tetrahedron of a Halton set. At a target the result is the policy's
action.

Source: (4.29); Halton, the outlook of thesis 4.5.
"""

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.reach.goal_sets import (
    INTERPOLATING,
    InterpolationWeights,
    TargetInterpolation,
    interpolation_of,
)
from app.sim.reach.reach_actor import ReachActor


def interpolates(actor: ReachActor) -> bool:
    """Whether a policy has training targets to interpolate between."""
    return actor.targets is not None and actor.goals in INTERPOLATING


class Interpolation:
    """A policy between its training targets.

    Args:
        actor: A policy trained on a grid or a Halton set.

    Raises:
        InvalidInput: It was trained on a continuous set of goals.
    """

    def __init__(self, actor: ReachActor) -> None:
        if actor.targets is None or actor.goals not in INTERPOLATING:
            rule = "of its training leaves no targets to interpolate between"
            raise InvalidInput("goals", actor.goals, rule, INTERPOLATING)
        self.actor = actor
        """The policy."""
        self.cells: TargetInterpolation = interpolation_of(actor.targets, actor.goals)
        """The cells between its targets."""

    def around(self, goals: Vec, field: str = "goal") -> tuple[InterpolationWeights, Vec]:
        """Return the targets around goals, with weights and positions.

        Args:
            goals: [m], shape (n, 3).
            field: Name of the goal in messages.

        Returns:
            Numbers and weights, shape (n, K), and positions [m], shape (n, K, 3).

        Raises:
            GoalOutside: A goal lies outside the targets.
        """
        mix = self.cells.weights_at(goals, field)
        return mix, self.cells.targets[mix.which]

    def acts(self, obs: NDArray[np.float32], mix: InterpolationWeights) -> NDArray[np.float32]:
        """Return the mean actions, shape (n, 6); targets without weight are not queried.

        Args:
            obs: Observations of each target, shape (n, K, obs_size).
        """
        used = mix.weights > 0.0
        act = np.zeros((*used.shape, 6))
        act[used] = self.actor.acts(obs[used])
        mean: NDArray[np.float32] = (mix.weights[..., None] * act).sum(axis=1, dtype=np.float64)
        return mean.astype(np.float32)
