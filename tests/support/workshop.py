"""A work cell of somebody's own, for tests: four cubes, a dock, another table."""

import json
from typing import Any

from app.sim.cells.cell import Cell, load_cell, parse_definition


def definition(**changes: Any) -> dict[str, Any]:
    """Return the cell as JSON data; ``changes`` replace members."""
    base = json.loads(json.dumps(load_cell("pick-and-place").definition()))
    stations = [
        {"id": f"part{k}", "kind": "cube", "label": f"Part {k}", "position": [x, 0.62, 0.12]}
        for k, x in enumerate((-0.45, -0.2, 0.2, 0.45))
    ]
    stations.append(
        {"id": "tray", "kind": "dock", "label": "Tray", "position": [0.0, 0.5, 0.12]}
    )
    own = {"name": "workshop", "title": "The workshop", "stations": stations}
    return {**base, **own, **changes}


def cell(**changes: Any) -> Cell:
    """Return the cell."""
    return parse_definition(definition(**changes))
