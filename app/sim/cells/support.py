"""Support of points in a cell: the table or an obstacle below them."""

import math
from collections.abc import Sequence

from app.sim.cells.cell import Cell
from app.sim.cells.parts import Obstacle, TableGeometry


def is_over(box: Obstacle, point: Sequence[float]) -> bool:
    """Return whether a point lies over or in the footprint of an obstacle."""
    c, s = math.cos(box.yaw), math.sin(box.yaw)
    x, y = point[0] - box.center[0], point[1] - box.center[1]
    along, across = abs(c * x + s * y), abs(c * y - s * x)
    return along <= box.half_size[0] and across <= box.half_size[1]


def is_over_table(table: TableGeometry, point: Sequence[float]) -> bool:
    """Return whether a point lies over or in the rectangle of the table."""
    return table.x_min <= point[0] <= table.x_max and table.y_min <= point[1] <= table.y_max


def top_of(box: Obstacle) -> float:
    """Return the height of an obstacle's top over the table [m]."""
    return box.center[2] + box.half_size[2]


def support_height(cell: Cell, point: Sequence[float]) -> float:
    """Return the height of the table or obstacle that carries what is at a point [m].

    Args:
        point: Point [m], shape (3,).

    Returns:
        The highest top below it; 0, the table's, where nothing is below it.
    """
    tops = [top_of(box) for box in cell.obstacles if is_over(box, point)]
    tops += [0.0] if is_over_table(cell.table, point) else []
    return max((top for top in tops if top <= point[2]), default=0.0)
