"""Choice of moves in a live sorting cell: by the monitored sorting policy, or by the planner.

A new decision follows every attempt and every change of the task. Moves that the exact planner
expects to take about as many attempts (MARGIN) are equal; by the order set for the cell, the
critic of the pick policy chooses among them, the nearest block is taken, or the move stays.

Source: docs/method.md 1.4, 3.1 and 4 (the critic's values also decide the symbolic choice).
"""

from dataclasses import dataclass

import numpy as np

from app.live.sorting.commands import PlanningCommand, SetOrder
from app.live.sorting.snapshot import Order
from app.live.sorting.table import Block, SortingTable
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import apply
from app.sim.sorting.decision import decide, failure_of
from app.sim.sorting.decision_types import RankedMove, SortingDecision, Why
from app.sim.sorting.near_optimal_moves import near_optimal_moves
from app.sim.sorting.progress_monitor import ProgressMonitor, expect_state, state_key
from app.sim.sorting.sorting_values import SortingValues
from app.sim.sorting.state import Move

ALIKE = 0.02
"""Difference of failure probabilities up to which identical blocks count as equal."""
MARGIN = 0.02
"""Expected attempts up to which moves count as equal; less than in ``near_optimal_moves.py``,
so that no riskier of two identical blocks is taken."""
Options = tuple[tuple[Block, Move], ...]
"""Blocks, each with its move."""
FALLBACK_REASONS: tuple[Why, ...] = ("repeated", "attempts-exceeded")
"""Reasons for a planner fallback: the policy may decide here but makes no progress."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveChoice:
    """The chosen move."""

    move: Move
    """Pick and place position."""
    block: Block
    """The block to move."""
    options: Options
    """Blocks that the critic chooses among; the chosen one first."""
    n_equal: int = 1
    """Number of equal moves before the order decided."""
    back: bool = False
    """Whether a held block only returns to where it counts."""


class SortController:
    """Chooses moves, monitors progress and falls back to the planner."""

    def __init__(self, policy: SortingValues | None) -> None:
        self.policy = policy
        """Sorting policy; None: the planner selects every move."""
        self.decision: SortingDecision | None = None
        """The last decision."""
        self.planner_fallbacks = 0
        """Number of planner fallbacks."""
        self.order: Order = "critic"
        """Choice among equal moves."""
        self._before: ProgressMonitor | None = None
        self._after: ProgressMonitor | None = None
        self._attempted = False
        self._avoid: set[int] = set()

    def begin(self) -> None:
        """Start another task."""
        self.decision, self.planner_fallbacks = None, 0
        self._before = self._after = None
        self._attempted = False
        self._avoid.clear()

    def change(self, command: PlanningCommand) -> None:
        """Replace the sorting policy or the order of equal moves."""
        if isinstance(command, SetOrder):
            self.order = command.order
        else:
            self.policy = command.loaded

    def avoid(self, pick: int) -> None:
        """Prefer another move of a shortest plan next: this block was not reached."""
        self._avoid.add(pick)

    def note_attempt(self, table: SortingTable, move: Move) -> None:
        """Note the move before its grasp; the critic may have chosen an identical block."""
        self._avoid.clear()
        if self._after is not None:
            state = table.state
            key = state_key(apply(state, table.shape, move))
            self._after = expect_state(self._after, key, can_fail=failure_of(state, move) > 0.0)

    def end_attempt(self) -> None:
        """Note that the attempt is over: the grasp failed, or the block is placed."""
        self._attempted = True

    def choose(
        self, table: SortingTable, kept: Move | None = None, tcp: Vec | None = None
    ) -> MoveChoice | None:
        """Return the next move; None if the goal is reached.

        Args:
            table: The table as it is now.
            kept: Present move of a held block; continued while it is on a shortest plan.
            tcp: Tool centre point [m], shape (3,), for the order of equal moves; None: all of
                them are options.
        """
        decision = self._decide(table)
        if table.held is not None:
            return _for_held(table, decision, kept)
        if decision.move is None:
            return None
        move = self._move_of(decision)
        block = table.top(move.pick)
        assert block is not None
        equal = tuple(({block: move} | self._equal(table, move)).items())
        options = equal if tcp is None else self._ordered(table, equal, tcp)
        block, move = options[0]
        return MoveChoice(move=move, block=block, options=options, n_equal=len(equal))

    def _ordered(self, table: SortingTable, equal: Options, tcp: Vec) -> Options:
        """Return those of equal moves that the critic may choose among."""
        if self.order == "critic":
            return equal
        if self.order == "planner":
            return equal[:1]
        points = [table.point(*table.place_of(block)) for block, _ in equal]
        nearest = int(np.argmin([np.linalg.norm(point - tcp) for point in points]))
        return equal[nearest : nearest + 1]

    def _decide(self, table: SortingTable) -> SortingDecision:
        if self._attempted:  # Otherwise the state is the same.
            self._before, self._attempted = self._after, False
        fell_back = self.decision is not None and self.decision.why in FALLBACK_REASONS
        decision = decide(self.policy, table.state, table.shape, self._before)
        self.decision, self._after = decision, decision.monitor
        if decision.why in FALLBACK_REASONS and not fell_back:
            self.planner_fallbacks += 1
        return decision

    def _equal(self, table: SortingTable, move: Move) -> dict[Block, Move]:
        """Return other blocks whose moves take about as many attempts as a near-optimal one."""
        near = near_optimal_moves(table.state, table.shape, MARGIN)
        found: dict[Block, Move] = {}
        for other in near.moves if move in near.moves else ():
            block = table.top(other.pick)
            if block is not None and other.pick not in (move.pick, *self._avoid):
                found.setdefault(block, other)
        return found

    def _move_of(self, decision: SortingDecision) -> Move:
        """Return the best move, or one as short if its block was not reached.

        Where no block of a shortest plan was reached, all of them are offered again.
        """
        best = decision.ranked[0].move
        if best.pick not in self._avoid:
            return best
        for other in decision.ranked:
            if other.fewest and other.move.pick not in self._avoid:
                return other.move
        self._avoid.clear()
        return best


def has_safer_duplicate(table: SortingTable, slot: int) -> bool:
    """Return whether an identical block lies in a safer clutter slot."""
    block, least = table.clutter[slot], table.fail[slot] - ALIKE
    return block is not None and any(
        one is not None and one.code == block.code and fail < least
        for one, fail in zip(table.clutter, table.fail, strict=False)
    )


def _for_held(table: SortingTable, decision: SortingDecision, kept: Move | None) -> MoveChoice:
    """Return the place of the held block: the same, another, or back to where it counts."""
    block, position = table.held, table.held_position
    assert block is not None

    def place_at(place: int, *, back: bool = False) -> MoveChoice:
        move = Move(position, place)
        return MoveChoice(move=move, block=block, options=((block, move),), back=back)

    own = [one for one in decision.ranked if one.move.pick == position]
    if kept is not None and _is_fewest(own, kept.place):
        return place_at(kept.place)
    best = decision.move
    if best is not None and (best.pick == position or _is_duplicate(table, best, block)):
        if _is_fewest(own, best.place) or best.pick == position:
            return place_at(best.place)
    return place_at(position, back=True)


def _is_duplicate(table: SortingTable, move: Move, block: Block) -> bool:
    other = table.top(move.pick)
    return other is not None and other.code == block.code


def _is_fewest(ranked: list[RankedMove], place: int) -> bool:
    return any(one.fewest and one.move.place == place for one in ranked)
