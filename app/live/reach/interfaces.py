"""What a live reach cell needs of a policy; ``app.policies`` implements it."""

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from app.sim.reach.reach_actor import ReachKnown

if TYPE_CHECKING:  # the batch needs the ports first
    from app.sim.reach.batch import ReachBatch
    from app.sim.safety.layer import SafetySettings


class ReachPilot(ReachKnown, Protocol):
    """A reach policy with the ways in which it can be asked; used by one thread at a time."""

    @property
    def ways(self) -> tuple[str, ...]:
        """Names of the inference modes (``app.policies.inference.controllers``)."""

    def acts(
        self, batch: "ReachBatch", way: str, safety: "SafetySettings | None"
    ) -> NDArray[np.float32]:
        """Return the actions for every environment of a batch, shape (n_envs, 6).

        Args:
            batch: Robots, people and goals.
            way: One of ``ways``.
            safety: What the safety layer assumes that they go through; None without one.
        """
