"""The work cell that a checkpoint was trained in.

A shipped cell goes by its name; a cell of the user's own travels with the checkpoint, so that
the policy can be evaluated and compared with what stands there now, whatever became of the
stored cell.
"""

import json
from collections.abc import Mapping
from typing import Any

from app.errors import CheckpointMismatch
from app.sim.cell_validation.reader import read_cell
from app.sim.cells.cell import Cell, cell_names, load_cell

DEFINITION = "cell_definition"
"""Field of the manifest that holds the content of a cell that is not shipped."""


def manifest_fields(cell: Cell) -> dict[str, Any]:
    """Return what a manifest says of the cell trained in."""
    shipped = cell.name in cell_names() and load_cell(cell.name) == cell
    return {"cell": cell.name} | ({} if shipped else {DEFINITION: cell.definition()})


def is_for(manifest: Mapping[str, Any], cell: Cell) -> bool:
    """Tell whether a checkpoint was trained in this very cell."""
    fields = {"cell": cell.name, DEFINITION: manifest_fields(cell).get(DEFINITION)}
    return all(manifest.get(name) == value for name, value in fields.items())


def cell_of(manifest: Mapping[str, Any]) -> Cell:
    """Return the cell that a checkpoint's manifest names or carries.

    Raises:
        NotFound: It names a cell that is not shipped and carries none.
        BadCell: What it carries is no sound cell.
        CheckpointMismatch: It names one cell and carries another.
    """
    name = str(manifest["cell"])
    if DEFINITION not in manifest:
        return load_cell(name)
    cell = read_cell(json.dumps(manifest[DEFINITION]).encode())
    if cell.name != name:
        raise CheckpointMismatch("cell", name, cell.name)
    return cell
