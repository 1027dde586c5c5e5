"""Interface of a policy that brings the tcp to a goal."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.policy_identity import PolicyIdentity
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.reach.batch import GoalRule, ViewName
from app.sim.robot.actions import ActionSettings


class ReachPolicyInfo(PolicyIdentity, Protocol):
    """Reach policy, as seen by the live world and planners."""

    @property
    def view(self) -> ViewName:
        """Observation."""

    @property
    def action(self) -> ActionSettings:
        """Meaning of its actions."""

    @property
    def goals(self) -> GoalRule:
        """Region of its training goals."""

    @property
    def targets(self) -> Vec | None:
        """Training goals [m], shape (n, 3); None for a whole box."""


def observed_people(view: ViewName) -> int:
    """Return the greatest number of people that an observation contains."""
    return MAX_PEOPLE if view == "people-set" else 1


class ReachActor(ReachPolicyInfo, Protocol):
    """Reach policy; safe to call from several threads."""

    @property
    def trained_range(self) -> Mapping[str, Mapping[str, Sequence[float]]]:
        """Least (``low``) and greatest (``high``) value of each state variable in training."""

    def acts(self, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return actions in [-1, 1].

        Args:
            obs: Observations of :attr:`view`, as ``ReachBatch`` gives them, shape (n, F).

        Returns:
            Actions, shape (n, 6).
        """
