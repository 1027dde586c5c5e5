"""Shipped task primitives: one movement primitive per segment of a worker's task.

For each segment (home - cube, home - dock, cube - dock; each hand) the file holds the weights
of its demonstrations, from which ``promp.of_weights`` makes the primitive. A segment is stored
in one direction; reversed in time, its weights are in reverse order.
``tools/make_primitives.py`` writes the file; it contains numbers only and is read without
pickle.

Source: docs/method.md 3.4 (a library of primitives, one per task).
"""

import json
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import numpy as np

from app.sim.cells.cell import Cell, load_cell
from app.sim.core.arrays import Vec
from app.sim.human.model import HANDS, Hand

FILE = Path(str(resources.files("app.sim.primitives"))) / "data" / "task_primitives.npz"
"""File of the primitives."""
HOME = "home"
"""Name of the resting place."""

Kind = Literal["home-cube", "home-dock", "cube-dock"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskSegment:
    """One segment of a worker's task, in the stored direction."""

    kind: Kind
    """Kinds of places at its ends."""
    start: str
    """Initial place: a station or HOME."""
    end: str
    """Final station."""
    hand: Hand
    """Working hand."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TaskPrimitive:
    """Demonstrations of one segment."""

    cell: str
    """Name of the shipped cell of the demonstrations."""
    segment: TaskSegment
    """The segment."""
    weights: Vec
    """Weights of each demonstration [m, rad], shape (n, 18, n_basis)."""
    durations: Vec
    """Duration of each [s], shape (n,)."""
    residual: Vec
    """Root-mean-square residual of the regression per joint [m, rad], shape (18,)."""


def segments_of(cell: Cell) -> tuple[TaskSegment, ...]:
    """Return the segments of a worker's task in a cell, in the stored direction.

    A cell without a worker has none.
    """
    if not cell.workers:
        return ()
    cubes = [station.id for station in cell.stations_of("cube")]
    docks = [station.id for station in cell.stations_of("dock")]
    pairs: list[tuple[Kind, str, str]] = [
        *(("home-cube", HOME, cube) for cube in cubes),
        *(("home-dock", HOME, dock) for dock in docks),
        *(("cube-dock", cube, dock) for cube in cubes for dock in docks),
    ]
    return tuple(
        TaskSegment(kind=kind, start=start, end=end, hand=hand)
        for kind, start, end in pairs
        for hand in HANDS
    )


def place_of(cell: Cell, name: str) -> Vec | None:
    """Return the point of a place [m], shape (3,); None at home."""
    return None if name == HOME else np.array(cell.station(name).position)


@cache
def read_header(path: Path = FILE) -> dict[str, Any]:
    """Return the header of the file: seed, version, styles, sizes, tasks."""
    with np.load(path, allow_pickle=False) as data:
        header: dict[str, Any] = json.loads(str(data["header"]))
    return header


@cache
def load_primitives(path: Path = FILE) -> tuple[TaskPrimitive, ...]:
    """Return the shipped primitives; arrays are read-only."""
    with np.load(path, allow_pickle=False) as data:
        weights, durations, residual = (
            np.asarray(data[name], dtype=np.float64)
            for name in ("weights", "durations", "residual")
        )
    for array in (weights, durations, residual):
        array.setflags(write=False)
    return tuple(
        TaskPrimitive(
            cell=task["cell"],
            segment=TaskSegment(
                **{name: task[name] for name in ("kind", "start", "end", "hand")}
            ),
            weights=weights[i],
            durations=durations[i],
            residual=residual[i],
        )
        for i, task in enumerate(read_header(path)["tasks"])
    )


def primitive_for(cell: Cell, segment: TaskSegment) -> TaskPrimitive:
    """Return the shipped primitive for a segment of any cell.

    Among the primitives of the same kind and hand, the one whose places are nearest relative to
    the worker's stance is chosen; its pelvis is moved to the stance in this cell.
    """

    def apart(one: TaskPrimitive) -> float:
        theirs, ours = ends_seen(load_cell(one.cell), one.segment), ends_seen(cell, segment)
        return float(np.linalg.norm(theirs - ours, axis=1).sum())

    same = [
        one
        for one in load_primitives()
        if (one.segment.kind, one.segment.hand) == (segment.kind, segment.hand)
    ]
    nearest = min(same, key=apart)
    weights = nearest.weights.copy()
    weights[:, :2] += (_stand(cell) - _stand(load_cell(nearest.cell)))[:2, None]
    return replace(nearest, weights=weights)


def ends_seen(cell: Cell, segment: TaskSegment) -> Vec:
    """Return a segment's two places relative to the worker's stance [m], shape (2, 3)."""
    x, y, _ = cell.human.home
    home = np.array([x, y, 0.0])
    points = [place_of(cell, name) for name in (segment.start, segment.end)]
    return np.stack([home if point is None else point for point in points]) - _stand(cell)


def _stand(cell: Cell) -> Vec:
    """Return the middle of a worker's stance at the table [m], shape (3,)."""
    return np.array([cell.human.home[0], cell.human.y_min, 0.0])
