"""What a live reach cell needs of a policy; ``app.policies`` implements it."""

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from app.sim.ports import Vec

if TYPE_CHECKING:  # the batch needs the ports first
    from app.sim.actions import ActionSettings
    from app.sim.reach import GoalRule, ReachBatch, ViewName


class ReachPilot(Protocol):
    """A reach policy with the ways in which it can be asked; used by one thread at a time."""

    @property
    def checkpoint(self) -> str:
        """SHA-256 of the checkpoint."""

    @property
    def title(self) -> str:
        """Short text for people, such as ``"reach-td3, 2.0 M steps"``."""

    @property
    def cell(self) -> str:
        """Name of the work cell it was trained for."""

    @property
    def cell_sha256(self) -> str:
        """Identity of that cell's content (``Cell.sha256``)."""

    @property
    def view(self) -> "ViewName":
        """What it observes."""

    @property
    def action(self) -> "ActionSettings":
        """What its actions mean."""

    @property
    def goals(self) -> "GoalRule":
        """Where the goals of its training were drawn from."""

    @property
    def targets(self) -> Vec | None:
        """The goals it was trained on [m], shape (n, 3); None for a whole box."""

    @property
    def ways(self) -> tuple[str, ...]:
        """How it can be asked, ``direct`` among them; see ``app.policies.movers``."""

    def acts(self, batch: "ReachBatch", way: str) -> NDArray[np.float32]:
        """Return the actions for every environment of a batch, shape (n_envs, 6).

        Args:
            batch: Robots, people and goals.
            way: One of ``ways``.
        """
