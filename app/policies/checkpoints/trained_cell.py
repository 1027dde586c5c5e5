"""Training cell of a checkpoint.

The manifest names a shipped cell, and contains the definition of any other cell, so that the
policy can be evaluated even if the stored cell was changed or deleted.
"""

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from app.errors import BadCell, CheckpointMismatch, Fault, InvalidInput
from app.sim.cell_validation.reader import read_cell
from app.sim.cells.cell import Cell, cell_names, load_cell

DEFINITION = "cell_definition"
"""Field of the manifest that holds the content of a cell that is not shipped."""


def manifest_fields(cell: Cell) -> dict[str, Any]:
    """Return the manifest fields of a training cell."""
    shipped = cell.name in cell_names() and load_cell(cell.name) == cell
    return {"cell": cell.name} | ({} if shipped else {DEFINITION: cell.definition()})


def is_for(manifest: Mapping[str, Any], cell: Cell) -> bool:
    """Return whether a checkpoint was trained in exactly this cell."""
    fields = {"cell": cell.name, DEFINITION: manifest_fields(cell).get(DEFINITION)}
    return all(manifest.get(name) == value for name, value in fields.items())


def cell_of(manifest: Mapping[str, Any]) -> Cell:
    """Return the training cell from a manifest.

    Raises:
        InvalidInput: The manifest names a cell that is not shipped, without a definition.
        BadCell: The definition is invalid.
        CheckpointMismatch: The definition has another name.
    """
    name = str(manifest["cell"])
    if DEFINITION not in manifest:
        if name not in cell_names():
            rule = f"must be a shipped cell where there is no {DEFINITION}"
            raise InvalidInput("manifest.cell", name, rule, cell_names())
        return load_cell(name)
    try:
        cell = read_cell(json.dumps(manifest[DEFINITION]).encode())
    except BadCell as error:
        raise BadCell([_in_manifest(fault) for fault in error.faults]) from None
    if cell.name != name:
        raise CheckpointMismatch("cell", name, cell.name)
    return cell


def _in_manifest(fault: Fault) -> Fault:
    """Return a fault of the definition with its place in the manifest."""
    inside = "" if fault.place == "file" else f".{fault.place}"
    return replace(fault, place=f"manifest.{DEFINITION}{inside}")
