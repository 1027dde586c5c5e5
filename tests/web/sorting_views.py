"""Sorting tasks as the live world would show them, put together by hand."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from app.live.sorting.snapshot import (
    BlockSnapshot,
    GoalBlockSnapshot,
    MoveSnapshot,
    SortingCounters,
    SortingSnapshot,
)
from app.sim.cells.cell import Cell

SIZES = ("small", "medium", "large")
HALVES = {"small": 0.025, "medium": 0.035, "large": 0.045}


def half_size(cell: Cell, size: str) -> np.ndarray:
    height = next(one.level_height for one in cell.stations if one.kind == "cluster")
    return np.array([HALVES[size], HALVES[size], 0.5 * float(height or 0.0)])


def centre(cell: Cell, place: str, level: int) -> np.ndarray:
    """Return where a block's middle is on a level of a station."""
    station, half = cell.station(place), half_size(cell, "small")[2]
    x, y, z = station.position
    return np.array([x, y, z - half + level * 2.0 * half])


def block(cell: Cell, id: str, kind: str, place: str, level: int = 0) -> BlockSnapshot:
    colour, size = kind.split("-")
    return BlockSnapshot(
        id=id,
        colour=colour,
        size=size,
        place=place,
        level=level,
        position=centre(cell, place, level),
        half_size=half_size(cell, size),
        held=False,
        in_goal=False,
    )


def goal_block(cell: Cell, tower: str, level: int, size: str) -> GoalBlockSnapshot:
    return GoalBlockSnapshot(
        tower=tower,
        level=level,
        colour=str(cell.station(tower).colour),
        size=size,
        position=centre(cell, tower, level),
        half_size=half_size(cell, size),
        done=False,
    )


def a_view(
    cell: Cell, blocks: Sequence[BlockSnapshot] = (), goal: Sequence[GoalBlockSnapshot] = ()
) -> SortingSnapshot:
    """Return a task of five blocks, the first of which is being fetched."""
    blocks = blocks or (
        block(cell, "block1", "red-large", "slot2"),
        block(cell, "block2", "red-small", "slot5"),
        block(cell, "block3", "blue-medium", "slot3"),
        block(cell, "block4", "blue-large", "blue"),
        block(cell, "block5", "red-medium", "blue", 1),
    )
    goal = goal or (
        goal_block(cell, "red", 0, "large"),
        goal_block(cell, "red", 1, "small"),
        replace(goal_block(cell, "blue", 0, "large"), done=True),
        goal_block(cell, "blue", 1, "medium"),
    )
    move = MoveSnapshot(
        pick=blocks[0].place, place="red", block=blocks[0].id, value=0.8, best=True
    )
    stations = [one for one in cell.stations if one.kind == "clutter"]
    return SortingSnapshot(
        blocks=tuple(blocks),
        goal=tuple(goal),
        failure=tuple(float(one.failure_probability or 0.0) for one in stations),
        colours=tuple(str(o.colour) for o in cell.stations if o.kind == "cluster"),
        sizes=SIZES,
        move=move,
        phase="approach",
        decided_by="policy",
        order="critic",
        duplicates=(),
        ranked=(move,),
        moves_to_go=4,
        attempts_to_go=5.3,
        counters=SortingCounters(),
        sorting_policy=None,
        sorting_policy_title=None,
        test=None,
        solved=False,
    )
