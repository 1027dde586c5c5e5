"""A reach policy in the live cell, with all its inference modes."""

import numpy as np
from numpy.typing import NDArray

from app.policies.inference.controllers import (
    Controller,
    RolloutController,
    controller_of,
    inference_modes_of,
)
from app.policies.inference.rollout import ssm_constraint_of
from app.sim.core.arrays import Vec
from app.sim.reach.batch import GoalRule, ReachBatch, ViewName
from app.sim.reach.reach_actor import ReachActor
from app.sim.robot.actions import ActionSettings
from app.sim.safety.layer import SafetySettings


class TrainedReachPolicy:
    """One policy and its controllers by inference mode; for one thread at a time."""

    def __init__(self, actor: ReachActor) -> None:
        self._actor = actor
        self._controllers: dict[str, Controller] = {
            mode: controller_of(actor, mode) for mode in inference_modes_of(actor)
        }

    @property
    def checkpoint(self) -> str:
        """SHA-256 of the checkpoint."""
        return self._actor.checkpoint

    @property
    def title(self) -> str:
        """Short description."""
        return self._actor.title

    @property
    def cell(self) -> str:
        """Name of the training cell."""
        return self._actor.cell

    @property
    def cell_sha256(self) -> str:
        """Identity of the training cell's content."""
        return self._actor.cell_sha256

    @property
    def view(self) -> ViewName:
        """Kind of observation."""
        return self._actor.view

    @property
    def action(self) -> ActionSettings:
        """Meaning of the actions."""
        return self._actor.action

    @property
    def goals(self) -> GoalRule:
        """Set of the training goals."""
        return self._actor.goals

    @property
    def targets(self) -> Vec | None:
        """Training targets [m], shape (n, 3); None for a whole box."""
        return self._actor.targets

    @property
    def inference_modes(self) -> tuple[str, ...]:
        """Available inference modes."""
        return tuple(self._controllers)

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
            controller.layer = ssm_constraint_of(safety, batch.arm.dt)
        return controller.acts(batch)
