"""Read model of the sorting task of a live cell."""

from typing import Any

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
from app.sim.sorting.decision_types import RankedMove, SortingDecision
from app.sim.sorting.layout import above, half_size
from app.sim.sorting.state import NULL, Move


def task_snapshot(
    table: SortingTable,
    controller: SortController,
    choice: MoveChoice | None,
    *,
    phase: Phase,
    counters: SortingCounters,
    test: str | None,
    tcp: Vec,
) -> SortingSnapshot:
    """Return the read model of the sorting task.

    ``choice`` is the present move, ``test`` the id of the running test, and ``tcp`` the tool
    centre point [m], shape (3,).
    """
    decision, policy = controller.decision, controller.policy
    return SortingSnapshot(
        blocks=tuple(_block(table, one, tcp) for one in table.blocks),
        goal=_goal(table),
        failure=tuple(table.fail.tolist()),
        colours=table.names.colours,
        sizes=table.names.sizes,
        move=None if choice is None else _current(table, decision, choice),
        phase=phase,
        decided_by=None if choice is None or decision is None else decision.by,
        order=controller.order,
        duplicates=tuple(
            block.id for block, _ in (choice.options if choice else ()) if block in table.blocks
        ),
        ranked=_ranked(table, decision, choice),
        moves_to_go=0 if decision is None else decision.fewest_moves,
        attempts_to_go=0.0 if decision is None else decision.expected_attempts,
        counters=counters,
        sorting_policy=None if policy is None else policy.checkpoint,
        sorting_policy_title=None if policy is None else policy.title,
        test=test,
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
        code = table.code(block.colour, block.size)
        table.show(Block(block.id, code), None if block.held else block.place)
    for goal in snapshot.goal:
        tower = table.names.towers.index(goal.tower)
        table.goal[tower, goal.level] = table.code(goal.colour, goal.size)
    return table


def _block(table: SortingTable, block: Block, tcp: Vec) -> BlockSnapshot:
    held = block == table.held
    place, level, top = HELD, 0, tcp
    if not held:
        position, level = table.place_of(block)
        place = table.names.stations[position]
        top = table.point(position, level)
    return BlockSnapshot(
        id=block.id,
        place=place,
        level=level,
        held=held,
        in_goal=block.id in table.goal_ids,
        **_kind_and_box(table, block.code, top),
    )


def _kind_and_box(table: SortingTable, code: int, top: Vec) -> dict[str, Any]:
    """Return colour, size, centre and half size of a block with its top centre [m]."""
    size = table.shape.size_of(code)
    half = half_size(table.cell, size, table.shape.n_sizes)
    return {
        "colour": table.names.colours[table.shape.colour_of(code)],
        "size": table.names.sizes[size],
        "position": frozen(above(top, -float(half[2]))),
        "half_size": frozen(half),
    }


def _goal(table: SortingTable) -> tuple[GoalBlockSnapshot, ...]:
    found = []
    for c, codes in enumerate(table.goal.tolist()):
        good = True
        for level, code in enumerate(codes):
            if code == NULL:
                break
            there = table.towers[c][level].code if level < len(table.towers[c]) else NULL
            good = good and there == code
            top = table.point(table.shape.n_slots + c, level)
            found.append(
                GoalBlockSnapshot(
                    tower=table.names.towers[c],
                    level=level,
                    done=good,
                    **_kind_and_box(table, code, top),
                )
            )
    return tuple(found)


def _ranked(
    table: SortingTable, decision: SortingDecision | None, choice: MoveChoice | None
) -> tuple[MoveSnapshot, ...]:
    """Return the best moves; the present one is last where it is none of them."""
    ranked = () if decision is None else decision.ranked[:MAX_RANKED]
    if choice is None or any(one.move == choice.move for one in ranked):
        return tuple(_valued(table, one) for one in ranked)
    best = (_valued(table, one) for one in ranked[: MAX_RANKED - 1])
    return (*best, _current(table, decision, choice))


def _valued(table: SortingTable, one: RankedMove) -> MoveSnapshot:
    held = table.held is not None and one.move.pick == table.held_position
    block = table.held if held else table.top(one.move.pick)
    return _move(table, one.move, block, one.value, one.fewest)


def _current(
    table: SortingTable, decision: SortingDecision | None, choice: MoveChoice
) -> MoveSnapshot:
    ranked = () if decision is None else decision.ranked
    same = next((one for one in ranked if one.move == choice.move), None)
    value, best = (None, False) if same is None else (same.value, same.fewest)
    block = choice.block if choice.block in table.blocks else None
    return _move(table, choice.move, block, value, best)


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
