"""What a live sorting cell begins with: a random task, or one of the six tests.

A test's person acts without a visitor.

Source: METHOD 1.5; ``sorting_tests.py``.
"""

from dataclasses import dataclass

import numpy as np

from app.errors import InvalidInput
from app.sim.ports import Vec
from app.sim.sorting import SortingBatch, SortingSettings
from app.sim.sorting_state import SortingShape, SortingState
from app.sim.sorting_tests import sorting_test

N_BLOCKS = 6
"""Blocks of a random task."""
TASK_SEED = 7919
"""Between the seeds of two tasks."""
PAUSE_S = 1.5
"""How long a reached goal is shown before the person acts [s]."""


def random_task(shape: SortingShape, fail: Vec, seed: int, number: int) -> SortingState:
    """Draw blocks in the clutter and a goal for some of them, as episodes are drawn.

    Args:
        shape: Size of the task.
        fail: Failure probabilities of the clutter cells, shape (K,).
        seed: Seed of the world.
        number: Tasks begun before.
    """
    settings = SortingSettings(n_objects=min(N_BLOCKS, shape.n_cells))
    batch = SortingBatch(shape, fail, 1, seed + TASK_SEED * number, settings)
    batch.reset()
    return batch.state_of(0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Interfered:
    """What a person did."""

    state: SortingState
    """The state after it."""
    text: str
    """What it was, for people."""


class SortingTrial:
    """A running test.

    Args:
        name: ``test-1`` to ``test-6``.
        seed: Seeds of what is drawn.

    Raises:
        NotFound: There is no such test.
    """

    def __init__(self, name: str, seed: tuple[int, ...]) -> None:
        self._test, self._rng = sorting_test(name), np.random.default_rng(seed)
        self._waiting = list(self._test.interferences)
        self._moves = 0

    @property
    def name(self) -> str:
        """Its id."""
        return self._test.name

    @property
    def text(self) -> str:
        """What happens in it, for people."""
        return self._test.text

    def start(self, shape: SortingShape, fail: Vec) -> SortingState:
        """Draw the start.

        Raises:
            InvalidInput: The cell is too small for the test.
        """
        if not self._test.fits(shape):
            raise InvalidInput("id", self.name, "needs more cells, colours or sizes than here")
        self._shape = shape
        return self._test.start(shape, fail, self._rng)

    def interfere(self, state: SortingState, moves: int, idle_s: float) -> Interfered | None:
        """Do what is due; None where nothing is.

        Args:
            state: The state now; nothing is held.
            moves: Moves done in this test.
            idle_s: How long the robot has had nothing to do [s].
        """
        if not self._waiting:
            return None
        after = self._waiting[0].after_moves
        due = idle_s >= PAUSE_S if after is None else moves - self._moves >= after
        if not due:
            return None
        now, self._moves = self._waiting.pop(0), moves
        try:
            return Interfered(state=now.change(state, self._shape, self._rng), text=now.text)
        except InvalidInput:  # A visitor left nothing that this person could do.
            return None
