"""Interface of a learned policy for sorting: its values of all moves."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from app.sim.core.policy_identity import PolicyIdentity
from app.sim.sorting.state import SortingShape


class SortingValues(PolicyIdentity, Protocol):
    """Sorting policy by its values of all moves; safe to call from several threads.

    It was trained on goals that have each tower of its own colour, the largest at the bottom.
    """

    @property
    def shape(self) -> SortingShape:
        """Shape of its tasks."""

    def values(self, obs: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Return Q of every move, valid or not.

        Args:
            obs: States as ``sorting.observe`` gives them, shape (n, obs_size).

        Returns:
            Expected discounted rewards, shape (n, n_actions).
        """
