"""Status messages of a live sorting cell, one sentence each."""

from app.live.snapshot import Status
from app.live.sorting.controller import FALLBACK_REASONS, MoveChoice, SortController
from app.live.sorting.snapshot import Order, Phase
from app.live.sorting.table import Block, SortingTable
from app.live.status_messages import percent_text, value_text
from app.sim.cells.cell import Cell
from app.sim.pick.task_policy import Decision
from app.sim.sorting.decision_types import REASONS

WITHOUT_MOVE: dict[Status, str] = {
    "picking": "Moving up again: blocks, goal or policy have changed.",
    "solved": "Done: every tower matches the goal.",
    "no candidates": "Nothing to do: click blocks to add them to the goal.",
}
"""Message of a status without a chosen move."""


class StatusMessages:
    """Builds the messages of one sorting cell."""

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
        return f"the {label}" if position >= self._table.shape.n_slots else label

    def motion(
        self,
        phase: Phase,
        choice: MoveChoice,
        controller: SortController,
        decision: Decision | None,
    ) -> str:
        """Return the present motion, its reason and the number of remaining moves."""
        block, move = self.block(choice.block), choice.move
        place = self.place(move.place)
        if choice.back:
            return f"Returning {block} to {place}: the goal needs another move first."
        if phase in ("carry", "place"):
            verb = "Carrying" if phase == "carry" else "Placing"
            text = f"{verb} {block} {'to' if phase == 'carry' else 'on'} {place}"
            return f"{text}: {self._left(controller)}.{self._fallback(controller)}"
        verb = "Moving to" if phase == "approach" else "Grasping"
        inside = "in" if move.pick < self._table.shape.n_slots else "on"
        text = f"{verb} {block} {inside} {self.place(move.pick)}, to be placed on {place}: "
        text += f"{self._left(controller)}."
        why = _preference(choice, controller.order, decision) or self._risk(choice)
        return f"{text}{why}{self._fallback(controller)}"

    def failed_grasp(self, block: Block, risk: float) -> str:
        """Return that a grasp failed."""
        chance = percent_text(risk)
        return f"Grasp of {self.block(block)} failed ({chance} fail here): trying again."

    def timeout(self, phase: Phase, choice: MoveChoice) -> str:
        """Return that a motion reached the time limit."""
        block = self.block(choice.block)
        if phase == "carry":
            place = self.place(choice.move.place)
            return f"Timed out carrying {block} to {place}: trying again."
        return f"Timed out on the motion to {block}: trying again."

    def returned_block(self, block: Block, position: int) -> str:
        """Return the place of a held block after a contact."""
        text = self.block(block)
        return f"{text[0].upper()}{text[1:]} is back at {self.place(position)}."

    def removed_goal_block(self, block: Block) -> str:
        """Return that the goal lost a removed block."""
        text = self.block(block)
        return f"{text[0].upper()}{text[1:]} was removed, also from the goal."

    def _left(self, controller: SortController) -> str:
        moves = 0 if controller.decision is None else controller.decision.fewest_moves
        return "1 move to go" if moves == 1 else f"{moves} moves to go"

    def _risk(self, choice: MoveChoice) -> str:
        """Return a comparison with an identical block that is riskier to grasp."""
        table = self._table
        if choice.move.pick >= table.shape.n_slots:
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
        return f" Its duplicate in {label} fails more often ({percent_text(risk)})."

    def _fallback(self, controller: SortController) -> str:
        """Return why the planner decides in place of the policy."""
        decision = controller.decision
        if decision is None or decision.by == "policy" or controller.policy is None:
            return ""
        took = " Fallback to the exact planner." if decision.why in FALLBACK_REASONS else ""
        return f" {REASONS[decision.why]}{took}"


def _preference(choice: MoveChoice, order: Order, decision: Decision | None) -> str:
    """Return why a move was chosen among equal ones."""
    if choice.n_equal == 1:
        return ""
    text = f" {choice.n_equal} moves are equal; "
    if order == "planner":
        return f"{text}this one comes first."
    if order == "nearest":
        return f"{text}chosen because it was the nearest."
    if decision is None or len(decision.values) < 2:
        return ""
    own = decision.values[decision.index]
    best = max(value for i, value in enumerate(decision.values) if i != decision.index)
    return f"{text}chosen by value {value_text(own)} (the next has {value_text(best)})."
