"""Says in one sentence what a live sorting robot does and why."""

from app.live.sorting.controller import HAND_OVER, Choice, LiveSorter
from app.live.sorting.snapshot import Phase
from app.live.sorting.table import Block, SortingTable
from app.sim.cells.cell import Cell
from app.sim.sorting.decision_types import REASONS

NO_GOAL = "Nothing to do: click blocks to put them into the goal."
DONE = "Done: every tower is as the goal asks."


class Teller:
    """Puts the sorting task into words.

    Args:
        cell: Sorting cell.
        table: Its table.
    """

    def __init__(self, cell: Cell, table: SortingTable) -> None:
        self._table = table
        self._labels = [
            f"{one.colour} tower" if one.kind == "cluster" else one.label.lower()
            for one in (cell.station(name) for name in table.names.stations)
        ]

    def block(self, block: Block) -> str:
        """Return a block in words."""
        return f"the {self._table.names.kind(block.code)} block"

    def place(self, position: int) -> str:
        """Return a position in words."""
        label = self._labels[position]
        return f"the {label}" if position >= self._table.shape.n_cells else label

    def doing(self, phase: Phase, choice: Choice, sorter: LiveSorter) -> str:
        """Return what the robot does with a block, why, and how many moves are left."""
        what, move = self.block(choice.block), choice.move
        place = self.place(move.place)
        if choice.back:
            return f"Puts {what} back to {place}: the goal needs another move first."
        if phase in ("carry", "place"):
            verb = "Carries" if phase == "carry" else "Puts"
            text = f"{verb} {what} {'to' if phase == 'carry' else 'on'} {place}"
            return f"{text}: {self._left(sorter)}.{self._who(sorter)}"
        verb = "Goes for" if phase == "approach" else "Takes"
        pick = self.place(move.pick)
        inside = "in" if move.pick < self._table.shape.n_cells else "on"
        text = f"{verb} {what} {inside} {pick}, for {place}: {self._left(sorter)}."
        return f"{text}{self._twin(choice)}{self._who(sorter)}"

    def missed(self, block: Block, risk: float) -> str:
        """Return that a grasp failed."""
        return f"The magnet missed {self.block(block)}; trying again ({risk:.0%} fail here)."

    def late(self, choice: Choice) -> str:
        """Return that a motion took too long."""
        return f"Time is up on the way to {self.block(choice.block)}: trying again."

    def fell(self, block: Block, position: int) -> str:
        """Return where a held block falls back after a contact."""
        text = self.block(block)
        return f"{text[0].upper()}{text[1:]} is back at {self.place(position)}."

    def shrunk(self, block: Block) -> str:
        """Return that the goal lost a block that is gone."""
        text = self.block(block)
        return f"{text[0].upper()}{text[1:]} is gone, and the goal does without it."

    def _left(self, sorter: LiveSorter) -> str:
        moves = 0 if sorter.decision is None else sorter.decision.fewest_moves
        return "1 move to go" if moves == 1 else f"{moves} moves to go"

    def _twin(self, choice: Choice) -> str:
        """Return what is said about blocks like the one that is taken."""
        table = self._table
        if len(choice.options) > 1:
            return f" Of {len(choice.options)} that are as good it is the easiest to reach now."
        if choice.move.pick >= table.shape.n_cells:
            return ""
        least = table.fail[choice.move.pick]
        risks = {
            label: float(fail)
            for one, label, fail in zip(table.clutter, self._labels, table.fail, strict=False)
            if one is not None and one.code == choice.block.code and fail > least
        }
        if not risks:
            return ""
        label, risk = next(iter(risks.items()))
        return f" Its twin in {label} fails more often ({risk:.0%})."

    def _who(self, sorter: LiveSorter) -> str:
        """Return why the planner decides where a policy was asked."""
        decision = sorter.decision
        if decision is None or decision.by == "policy" or sorter.sorter is None:
            return ""
        took = " The exact planner took over." if decision.why in HAND_OVER else ""
        return f" {REASONS[decision.why]}{took}"
