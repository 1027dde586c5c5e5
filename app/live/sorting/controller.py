"""Who chooses the moves of a live sorting cell: the sorter's policy, watched, or the planner.

A decision is made anew whenever an attempt is over or a person changed something. Where the
sorter calls moves equal the motion policy's critic may take any of them: twins in clutter cells
whose grasps fail about as often (ALIKE), and other first moves of shortest plans that are worth
as much (MARGIN).

Source: METHOD 1.4, 3.1 and 4 (the critic's values used for the symbolic choice as well).
"""

from dataclasses import dataclass

from app.live.sorting.table import Block, SortingTable
from app.sim.sorting.batch import apply
from app.sim.sorting.decision import decide, failure_of
from app.sim.sorting.decision_types import RankedMove, SortingDecision, Why
from app.sim.sorting.progress_monitor import SortingWatch, note_move, state_key
from app.sim.sorting.sorting_values import SortingValues
from app.sim.sorting.state import Move

ALIKE = 0.02
"""Difference of failure probabilities up to which twins count as equal."""
MARGIN = 0.01
"""Difference up to which moves are worth as much: of Q, or of the planner's attempts."""
HAND_OVER: tuple[Why, ...] = ("repeated", "patience")
"""Reasons that mean that the planner took over from a policy that may decide here."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """The move that shall be carried out."""

    move: Move
    """From where to where."""
    block: Block
    """The block that is meant."""
    options: tuple[tuple[Block, Move], ...]
    """Blocks that may be taken as well, each with its move; itself first."""
    back: bool = False
    """Whether a held block is only put back where it counts."""


class LiveSorter:
    """Decides, remembers, and hands over.

    Args:
        sorter: The policy; None leaves it to the planner.
    """

    def __init__(self, sorter: SortingValues | None) -> None:
        self.sorter = sorter
        """The policy."""
        self.decision: SortingDecision | None = None
        """The last decision."""
        self.hand_overs = 0
        """Times at which the planner took over."""
        self._before: SortingWatch | None = None
        self._after: SortingWatch | None = None
        self._attempted = False
        self._avoid: set[int] = set()

    def begin(self) -> None:
        """Begin another task."""
        self.decision, self.hand_overs = None, 0
        self._before = self._after = None
        self._attempted = False
        self._avoid.clear()

    def avoid(self, pick: int) -> None:
        """Take another block next, if another move is as short: this one was not reached."""
        self._avoid.add(pick)

    def note_attempt(self, table: SortingTable, move: Move) -> None:
        """Note the move that is tried now, before it is: the critic may have taken a twin."""
        self._avoid.clear()
        if self._after is not None:
            state = table.state
            key = state_key(apply(state, table.shape, move))
            self._after = note_move(self._after, key, can_fail=failure_of(state, move) > 0.0)

    def end_attempt(self) -> None:
        """Note that the attempt is over: the grasp failed, or the block is where it should."""
        self._attempted = True

    def choose(self, table: SortingTable, kept: Move | None = None) -> Choice | None:
        """Decide on the next move; None where the goal is reached.

        Args:
            table: The table as it is now.
            kept: What a held block was on its way to; it goes on if that still is as short.
        """
        decision = self._decide(table)
        if table.held is not None:
            return _for_held(table, decision, kept)
        if decision.move is None:
            return None
        move = self._move_of(decision)
        block = table.top(move.pick)
        assert block is not None
        options = (
            {block: move} | _twins(table, move, block) | self._equal(table, decision, move)
        )
        return Choice(move=move, block=block, options=tuple(options.items()))

    def _decide(self, table: SortingTable) -> SortingDecision:
        if self._attempted:  # Otherwise the same question is asked again.
            self._before, self._attempted = self._after, False
        handed = self.decision is not None and self.decision.why in HAND_OVER
        decision = decide(self.sorter, table.state, table.shape, self._before)
        self.decision, self._after = decision, decision.watch
        if decision.why in HAND_OVER and not handed:
            self.hand_overs += 1
        return decision

    def _equal(
        self, table: SortingTable, decision: SortingDecision, move: Move
    ) -> dict[Block, Move]:
        """Return other blocks whose moves begin a shortest plan and are worth as much."""
        values = {one.move: one.value for one in decision.ranked if one.fewest}
        best, found = values.get(move), dict[Block, Move]()
        for other, value in values.items():
            block = table.top(other.pick)
            if block is None or other.pick in (move.pick, *self._avoid):
                continue
            if best is not None and value is not None and abs(value - best) <= MARGIN:
                found.setdefault(block, other)
        return found

    def _move_of(self, decision: SortingDecision) -> Move:
        """Return the best move, or one as short in place of one that was not reached."""
        others = [
            one for one in decision.ranked if one.fewest and one.move.pick not in self._avoid
        ]
        best = decision.ranked[0]
        return others[0].move if best.move.pick in self._avoid and others else best.move


def has_safer_twin(table: SortingTable, cell: int) -> bool:
    """Return whether a block like the one in a clutter cell lies in a safer cell."""
    block, least = table.clutter[cell], table.fail[cell] - ALIKE
    return block is not None and any(
        one is not None and one.code == block.code and fail < least
        for one, fail in zip(table.clutter, table.fail, strict=False)
    )


def _twins(table: SortingTable, move: Move, block: Block) -> dict[Block, Move]:
    """Return blocks like the one in a clutter cell that fail about as often."""
    if move.pick >= table.shape.n_cells:
        return {}
    fail = table.fail[move.pick]
    return {
        one: Move(k, move.place)
        for k, one in enumerate(table.clutter)
        if one is not None and one.code == block.code and abs(table.fail[k] - fail) <= ALIKE
    }


def _for_held(table: SortingTable, decision: SortingDecision, kept: Move | None) -> Choice:
    """Return where the held block goes: on, elsewhere, or back to where it counts."""
    block, seat = table.held, table.seat
    assert block is not None

    def going(place: int, *, back: bool = False) -> Choice:
        move = Move(seat, place)
        return Choice(move=move, block=block, options=((block, move),), back=back)

    own = [one for one in decision.ranked if one.move.pick == seat]
    if kept is not None and _is_fewest(own, kept.place):
        return going(kept.place)
    best = decision.move
    if best is not None and (best.pick == seat or _is_twin(table, best, block)):
        if _is_fewest(own, best.place) or best.pick == seat:
            return going(best.place)
    return going(seat, back=True)


def _is_twin(table: SortingTable, move: Move, block: Block) -> bool:
    other = table.top(move.pick)
    return other is not None and other.code == block.code


def _is_fewest(ranked: list[RankedMove], place: int) -> bool:
    return any(one.fewest and one.move.place == place for one in ranked)
