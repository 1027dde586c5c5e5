"""Read model of the sorting task of a live cell."""

from dataclasses import dataclass

import numpy as np

from app.live.read_model import frozen
from app.live.sorting.controller import MoveChoice, SortController
from app.live.sorting.snapshot import (
    HELD,
    MAX_RANKED,
    BlockSnapshot,
    GoalBlockSnapshot,
    MoveSnapshot,
    Phase,
    SortingCounters,
    SortingSnapshot,
)
from app.live.sorting.table import Block, SortingTable
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.sorting.decision_types import RankedMove
from app.sim.sorting.layout import above, half_size
from app.sim.sorting.state import NULL, Move


@dataclass(frozen=True, slots=True, kw_only=True)
class SnapshotInputs:
    """Parts of a live sorting world that the snapshot shows."""

    table: SortingTable
    """Blocks and goal."""
    controller: SortController
    """Controller with the last decision."""
    choice: MoveChoice | None
    """Present move."""
    phase: Phase
    """Phase of the move."""
    counters: SortingCounters
    """Events since the task began."""
    test: str | None
    """Id of the running test."""
    tcp: Vec
    """Tool centre point [m], shape (3,)."""


def task_snapshot(inputs: SnapshotInputs) -> SortingSnapshot:
    """Return the read model of the sorting task."""
    table, decision = inputs.table, inputs.controller.decision
    policy, choice = inputs.controller.policy, inputs.choice
    return SortingSnapshot(
        blocks=tuple(_block(inputs, one) for one in table.blocks),
        goal=_goal(inputs),
        failure=tuple(table.fail.tolist()),
        colours=table.names.colours,
        sizes=table.names.sizes,
        move=None if choice is None else _current(inputs, choice),
        phase=inputs.phase,
        decided_by=None if choice is None or decision is None else decision.by,
        order=inputs.controller.order,
        duplicates=() if choice is None else _duplicates(table, choice),
        ranked=_ranked(inputs),
        moves_to_go=0 if decision is None else decision.fewest_moves,
        attempts_to_go=0.0 if decision is None else decision.expected_attempts,
        counters=inputs.counters,
        sorting_policy=None if policy is None else policy.checkpoint,
        sorting_policy_title=None if policy is None else policy.title,
        test=inputs.test,
        solved=is_solved(table),
    )


def is_solved(table: SortingTable) -> bool:
    """Return whether there is a goal, every tower matches it, and no block is held."""
    state = table.state
    return state.solved and bool((state.goal != NULL).any()) and table.held is None


def table_of(cell: Cell, snapshot: SortingSnapshot) -> SortingTable:
    """Return the table of a snapshot, to validate a change."""
    table = SortingTable(cell)
    for block in sorted(snapshot.blocks, key=lambda one: one.level):
        size = table.names.sizes.index(block.size)
        code = table.shape.code(table.names.colours.index(block.colour), size)
        table.show(Block(block.id, code), None if block.held else block.place)
    for goal in snapshot.goal:
        size = table.names.sizes.index(goal.size)
        code = table.shape.code(table.names.colours.index(goal.colour), size)
        table.goal[table.names.towers.index(goal.tower), goal.level] = code
    return table


def _block(inputs: SnapshotInputs, block: Block) -> BlockSnapshot:
    table = inputs.table
    size = table.shape.size_of(block.code)
    half = half_size(table.cell, size, table.shape.n_sizes)
    held = block == table.held
    place, level, top = HELD, 0, inputs.tcp
    if not held:
        position, level = table.place_of(block)
        place = table.names.stations[position]
        top = table.point(position, level)
    return BlockSnapshot(
        id=block.id,
        colour=table.names.colours[table.shape.colour_of(block.code)],
        size=table.names.sizes[size],
        place=place,
        level=level,
        position=frozen(above(top, -float(half[2]))),
        half_size=frozen(half),
        held=held,
        in_goal=block.id in table.goal_ids,
    )


def _goal(inputs: SnapshotInputs) -> tuple[GoalBlockSnapshot, ...]:
    table, found = inputs.table, []
    for c, codes in enumerate(table.goal.tolist()):
        good = True
        for level, code in enumerate(codes):
            if code == NULL:
                break
            there = table.towers[c][level].code if level < len(table.towers[c]) else NULL
            good = good and there == code
            size = table.shape.size_of(code)
            half = half_size(table.cell, size, table.shape.n_sizes)
            top = table.point(table.shape.n_cells + c, level)
            found.append(
                GoalBlockSnapshot(
                    tower=table.names.towers[c],
                    level=level,
                    colour=table.names.colours[table.shape.colour_of(code)],
                    size=table.names.sizes[size],
                    position=frozen(above(top, -float(half[2]))),
                    half_size=frozen(half),
                    done=good,
                )
            )
    return tuple(found)


def _duplicates(table: SortingTable, choice: MoveChoice) -> tuple[str, ...]:
    return tuple(block.id for block, _ in choice.options if block in table.blocks)


def _ranked(inputs: SnapshotInputs) -> tuple[MoveSnapshot, ...]:
    """Return the best moves; the present one is last where it is none of them."""
    decision, choice = inputs.controller.decision, inputs.choice
    ranked = () if decision is None else decision.ranked[:MAX_RANKED]
    if choice is None or any(one.move == choice.move for one in ranked):
        return tuple(_valued(inputs.table, one) for one in ranked)
    best = (_valued(inputs.table, one) for one in ranked[: MAX_RANKED - 1])
    return (*best, _current(inputs, choice))


def _valued(table: SortingTable, one: RankedMove) -> MoveSnapshot:
    held = table.held is not None and one.move.pick == table.held_position
    block = table.held if held else table.top(one.move.pick)
    return _move(table, one.move, block, one.value, one.fewest)


def _current(inputs: SnapshotInputs, choice: MoveChoice) -> MoveSnapshot:
    decision = inputs.controller.decision
    same = [
        one for one in (() if decision is None else decision.ranked) if one.move == choice.move
    ]
    value, best = (same[0].value, same[0].fewest) if same else (None, False)
    block = choice.block if choice.block in inputs.table.blocks else None
    return _move(inputs.table, choice.move, block, value, best)


def _move(
    table: SortingTable, move: Move, block: Block | None, value: float | None, best: bool
) -> MoveSnapshot:
    if value is not None and not np.isfinite(value):
        value = None
    return MoveSnapshot(
        pick=table.names.stations[move.pick],
        place=table.names.stations[move.place],
        block=None if block is None else block.id,
        value=value,
        best=best,
    )
