"""Interface of policies of a live reach cell; ``app.policies`` implements it."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.sim.reach.batch import ReachBatch
from app.sim.reach.reach_actor import ReachPolicyInfo
from app.sim.safety.layer import SafetySettings


class LiveReachPolicy(ReachPolicyInfo, Protocol):
    """A reach policy with its inference modes; used by one thread at a time."""

    @property
    def inference_modes(self) -> tuple[str, ...]:
        """Available inference modes, ``direct`` among them."""

    def acts(
        self, batch: ReachBatch, inference_mode: str, safety: SafetySettings | None
    ) -> NDArray[np.float32]:
        """Return the actions for every environment of a batch, shape (n_envs, 6).

        Args:
            batch: Robots, people and goals.
            inference_mode: One of ``inference_modes``.
            safety: Safety layer that limits the actions; None without one.
        """
