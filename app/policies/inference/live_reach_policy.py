"""Reach policy of a live cell, with all its inference modes."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from app.policies.inference.controllers import (
    Controller,
    RolloutController,
    controller_of,
    inference_modes_of,
)
from app.policies.inference.reach_training_range import PersonValues, ReachTrainingRange
from app.policies.inference.rollout import ssm_constraint_of
from app.sim.core.arrays import Vec
from app.sim.core.out_of_range import OutOfRangeValue
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.reach.batch import ReachBatch
from app.sim.reach.reach_actor import ReachActor
from app.sim.safety.layer import SafetySettings


class TrainedReachPolicy:
    """One policy and its controllers by inference mode; for one thread at a time.

    Args:
        actor: The policy, whose identity and training goals are attributes.
    """

    def __init__(self, actor: ReachActor) -> None:
        self.checkpoint, self.title = actor.checkpoint, actor.title
        self.cell, self.cell_sha256 = actor.cell, actor.cell_sha256
        self.view, self.action = actor.view, actor.action
        self.goals, self.targets = actor.goals, actor.targets
        self._controllers: dict[str, Controller] = {
            mode: controller_of(actor, mode) for mode in inference_modes_of(actor)
        }
        self.inference_modes = tuple(self._controllers)
        """Available inference modes."""
        self._trained = ReachTrainingRange(actor.trained_range)

    def acts(
        self, batch: ReachBatch, inference_mode: str, safety: SafetySettings | None
    ) -> NDArray[np.float32]:
        """Return the actions for every environment of a batch, shape (n_envs, 6).

        Args:
            batch: Robots, people and goals.
            inference_mode: One of ``inference_modes``.
            safety: Assumptions of the safety layer; None without one.
        """
        controller = self._controllers[inference_mode]
        if isinstance(controller, RolloutController):
            controller.constraint = ssm_constraint_of(safety, batch.arm.dt)
        return controller.acts(batch)

    def outside(
        self, state: Vec, people: Sequence[PersonValues]
    ) -> tuple[OutOfRangeValue, ...]:
        """Return the inputs of a decision outside the training range.

        Args:
            state: q [rad], qd [rad/s] and goal [m], shape (15,).
            people: Observed people.
        """
        return self._trained.outside(state, people, range(MAX_PEOPLE))
