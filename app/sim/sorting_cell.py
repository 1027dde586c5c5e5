"""The geometry of a sorting cell: where blocks lie, where the tool goes, what a person does.

Blocks are as high as a level of the towers and narrower than the clutter's cells; they lie on
the table or on each other. A station's point is where the tcp is when the magnet touches the
block there; the pick policy brings the tool to APPROACH_M above it.

To the pick scenario (``pick.py``, ``task_library.py``) a sorting cell is one whose clutter
cells are cubes and whose towers are docks (:func:`reaching_cell`): so people work there, and so
policies can be trained there.
"""

from functools import lru_cache

import numpy as np

from app.sim.cell_parts import Station
from app.sim.cells import Cell
from app.sim.ports import Vec

APPROACH_M = 0.07
"""How far above the point of a grasp the pick policy brings the tool [m]."""
HALF_WIDTHS = (0.02, 0.03, 0.04)
"""Half of the width of small, medium and large blocks [m]."""


@lru_cache(maxsize=8)
def reaching_cell(cell: Cell) -> Cell:
    """Return the cell as the pick scenario sees it: clutter as cubes, towers as docks.

    Their points are those above which the policy brings the tool.
    """

    def seen(station: Station) -> Station:
        x, y, z = station.position
        kind = {"clutter": "cube", "cluster": "dock"}.get(station.kind, station.kind)
        return Station.model_validate(
            {
                "id": station.id,
                "kind": kind,
                "label": station.label,
                "position": (x, y, z + APPROACH_M),
            }
        )

    return cell.model_copy(update={"stations": tuple(seen(one) for one in cell.stations)})


def above(point: Vec) -> Vec:
    """Return the point to which the policy brings the tool [m], shape (3,)."""
    return point + np.array([0.0, 0.0, APPROACH_M])
