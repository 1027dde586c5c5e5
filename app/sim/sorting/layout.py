"""Geometry of a sorting cell: blocks, tool positions, and the work of people.

Blocks are as high as a level of the towers and narrower than the clutter slots. The position of
a station is that of the tcp when the magnet touches the top of the block; the pick policy
brings the tool to APPROACH_M above it.

For the pick scenario (``pick.py``, ``primitive_library.py``) a sorting cell is one whose
clutter slots are cubes and whose towers are docks (:func:`reaching_cell`), for the work of
people and for training and evaluation of policies.
"""

from functools import lru_cache

import numpy as np

from app.errors import CheckpointMismatch
from app.sim.cells.cell import Cell
from app.sim.cells.parts import Station
from app.sim.core.arrays import Vec
from app.sim.sorting.state import MAX_COLOURS, MAX_SLOTS

APPROACH_M = 0.07
"""Height of the pick policy's target above a grasp [m]."""
HALF_WIDTHS = (0.02, 0.03, 0.04)
"""Half of the width of small, medium and large blocks [m]."""


def is_sorting(cell: Cell) -> bool:
    """Return whether a cell is a sorting cell."""
    return bool(cell.stations_of("clutter")) and bool(cell.stations_of("cluster"))


def lacks_for_tasks(cell: Cell) -> str | None:
    """Return the missing parts for sorting tasks; None if complete.

    Tasks have as many levels on each tower as clutter slots: a tower takes all objects.
    """
    if not is_sorting(cell):
        return "needs at least one station of kind clutter and one of kind cluster"
    clutter, towers = cell.stations_of("clutter"), cell.stations_of("cluster")
    if len(clutter) > MAX_SLOTS or len(towers) > MAX_COLOURS:
        return f"has more than {MAX_SLOTS} clutter slots or {MAX_COLOURS} clusters"
    if any((one.levels or 1) < len(clutter) for one in towers):
        return f"needs at least {len(clutter)} levels for each cluster, one per clutter slot"
    return None


def lacks_for_sorting(cell: Cell) -> str | None:
    """Return the missing parts for a live sorting cell; None if complete."""
    towers = cell.stations_of("cluster")
    if (lack := lacks_for_tasks(cell)) is not None:
        return lack
    if len(cell.people) != 1 or not cell.workers:
        return "needs exactly one person, of kind worker"
    if any(one.colour is None or one.level_height is None for one in towers):
        return "needs a colour and a level height for each cluster"
    if len({one.colour for one in towers}) < len(towers):
        return "needs another colour for each cluster"
    if len({one.level_height for one in towers}) > 1:
        return "needs the same level height for each cluster"
    return None


WORKSPACE = ("robot", "table", "obstacles", "people")
"""Parts of a cell that a policy that goes to any point it is given depends on."""


def require_workspace(cell: Cell, trained: Cell) -> None:
    """Raise unless a policy of another cell may act in a cell.

    Robot, limits, tool, table, obstacles and people must agree; points outside what the policy
    was trained on are flagged.

    Raises:
        CheckpointMismatch: One of these parts differs.
    """
    differing = [part for part in WORKSPACE if getattr(cell, part) != getattr(trained, part)]
    if differing:
        found = f"{trained.name}, which has another {', '.join(differing)}"
        raise CheckpointMismatch("cell", cell.name, found)


@lru_cache(maxsize=8)
def reaching_cell(cell: Cell) -> Cell:
    """Return the cell as the pick scenario sees it: clutter as cubes, towers as docks.

    Their points are those above which the policy brings the tool.
    """

    def seen(station: Station) -> Station:
        x, y, z = station.position
        kind = {"clutter": "cube", "cluster": "dock"}.get(station.kind, station.kind)
        kept = {"id": station.id, "label": station.label, "kind": kind}
        return Station.model_validate({**kept, "position": (x, y, z + APPROACH_M)})

    return cell.model_copy(update={"stations": tuple(seen(one) for one in cell.stations)})


def above(point: Vec, height: float = APPROACH_M) -> Vec:
    """Return the point ``height`` above another [m], shape (3,)."""
    return np.asarray(point + np.array([0.0, 0.0, height]))


def block_height(cell: Cell) -> float:
    """Return the height of a cell's blocks: that of a level [m]."""
    return float(cell.stations_of("cluster")[0].level_height or 0.0)


def half_size(cell: Cell, size: int, n_sizes: int) -> Vec:
    """Return half of a block's length, width and height [m], shape (3,).

    Args:
        cell: Sorting cell.
        size: 0 the smallest.
    """
    share = size / (n_sizes - 1) if n_sizes > 1 else 0.5
    width = HALF_WIDTHS[0] + share * (HALF_WIDTHS[-1] - HALF_WIDTHS[0])
    return np.array([width, width, 0.5 * block_height(cell)])
