"""Start of a live sorting task: a random one, or one of the six tests.

The interferences of a test are simulated.

Source: docs/method.md 1.5; ``benchmark_tasks.py``.
"""

import numpy as np

from app.errors import InvalidInput
from app.sim.core.arrays import Vec
from app.sim.pick.case_verdict import Verdict
from app.sim.sorting.batch import SortingBatch, SortingSettings
from app.sim.sorting.benchmark_tasks import sorting_test
from app.sim.sorting.state import SortingShape, SortingState

N_BLOCKS = 6
"""Number of blocks of a random task."""
TASK_SEED = 7919
"""Difference between the seeds of two tasks."""
PAUSE_S = 1.5
"""Time for which a reached goal is shown before the next interference [s]."""


def random_task(shape: SortingShape, fail: Vec, seed: int, number: int) -> SortingState:
    """Draw blocks and goal from the distribution of training episodes.

    Args:
        shape: Size of the task.
        fail: Failure probabilities of the clutter slots, shape (K,).
        seed: Seed of the world.
        number: Number of earlier tasks.
    """
    settings = SortingSettings(n_objects=min(N_BLOCKS, shape.n_slots))
    batch = SortingBatch(shape, fail, 1, seed + TASK_SEED * number, settings)
    batch.reset()
    return batch.state_of(0)


class SortingTestRun:
    """A running sorting test and its verdict.

    Args:
        name: ``test-1`` to ``test-6``.
        seed: Seeds of start and interferences.

    Raises:
        NotFound: There is no such test.
    """

    def __init__(self, name: str, seed: tuple[int, ...]) -> None:
        self._test, self._rng = sorting_test(name), np.random.default_rng(seed)
        self._waiting = list(self._test.interferences)
        self._moves = 0
        self._contacts = self._picks = self._riskier = 0
        self._spoilt: str | None = None
        self._ended: Verdict | None = None

    @property
    def name(self) -> str:
        """Id of the test."""
        return self._test.name

    @property
    def text(self) -> str:
        """Description for people."""
        return self._test.text

    def start(self, shape: SortingShape, fail: Vec) -> SortingState:
        """Draw the initial state.

        Raises:
            InvalidInput: The cell is too small for the test.
        """
        if not self._test.fits(shape):
            raise InvalidInput("id", self.name, "needs more slots, colours or sizes than here")
        self._shape = shape
        return self._test.start(shape, fail, self._rng)

    def interfere(
        self, state: SortingState, moves: int, idle_s: float
    ) -> tuple[SortingState, str] | None:
        """Apply the next interference if it is due.

        Args:
            state: Present state, without a held block.
            idle_s: Time for which the robot has been idle [s].

        Returns:
            State after it and its description for people; None where none was applied.
        """
        if not self._waiting:
            return None
        after = self._waiting[0].after_moves
        due = idle_s >= PAUSE_S if after is None else moves - self._moves >= after
        if not due:
            return None
        now, self._moves = self._waiting.pop(0), moves
        try:
            return now.change(state, self._shape, self._rng), now.text
        except InvalidInput:  # Made impossible by a visitor.
            self._spoilt = "an interference of the test was not possible"
            return None

    # Verdict.

    def note_contact(self) -> None:
        """Count a contact of the robot."""
        self._contacts += 1

    def note_pick(self, *, riskier: bool) -> None:
        """Count a grasp; ``riskier`` if a duplicate lies in a safer slot."""
        self._picks += 1
        self._riskier += riskier

    def note_visitor(self) -> None:
        """Invalidate the test: a user changed blocks or goal."""
        self._spoilt = "blocks or goal were changed by hand"

    def verdict(self, *, solved: bool, moves: int) -> Verdict:
        """Return expectation, observation and whether they agree."""
        if self._ended is not None:
            return self._ended
        over = solved and not self._waiting
        good = self._contacts == 0 and not (self._test.safer_duplicates and self._riskier)
        agrees = False if not good else True if over else None
        found = Verdict(
            expected=self._test.expected,
            observed=self._observed(over=over, solved=solved, moves=moves),
            as_expected=None if self._spoilt else agrees,
        )
        if over:
            self._ended = found
        return found

    def _observed(self, *, over: bool, solved: bool, moves: int) -> str:
        if self._spoilt is not None:
            return f"Not judged: {self._spoilt}."
        goals = 1 + sum(one.after_moves is None for one in self._test.interferences)
        waiting = 1 + sum(one.after_moves is None for one in self._waiting)
        reached = goals if over else goals - waiting + (solved and waiting > 1)
        parts = [
            f"{reached} of {goals} goals reached" if goals > 1 else _reached(over=over),
            f"{moves} {'move' if moves == 1 else 'moves'}",
            f"{self._contacts or 'no'} {'contact' if self._contacts == 1 else 'contacts'}",
        ]
        if self._test.safer_duplicates:
            parts.append(f"{self._riskier} of {self._picks} grasps in a riskier slot")
        return f"{', '.join(parts)}.".capitalize()


def _reached(*, over: bool) -> str:
    return "goal reached" if over else "goal not reached"
