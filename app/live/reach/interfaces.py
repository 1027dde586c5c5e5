"""Interface of policies of a live reach cell; ``app.policies`` implements it."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.out_of_range import OutOfRangeValue
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

    def outside(
        self, state: Vec, people: Sequence[tuple[int | None, Vec]]
    ) -> tuple[OutOfRangeValue, ...]:
        """Return the inputs of a decision outside the training range.

        Args:
            state: q [rad], qd [rad/s] and goal [m], shape (15,).
            people: Index of each observed person, None for ``NO_PERSON``, and its x, y [m],
                vx, vy [m/s], r [m] and growth [m/s], shape (6,).
        """
