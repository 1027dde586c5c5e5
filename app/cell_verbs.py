"""The verb ``cells`` of the command line: list, show, check, add and remove work cells.

Each function returns what is to be printed; the entry point prints it.
"""

import json
from pathlib import Path
from typing import Any

from app.database import has_database, opened
from app.errors import InvalidInput, NotFound
from app.settings import Settings
from app.sim.cell_validation.reader import MAX_BYTES, read_cell
from app.sim.cells.cell import Cell, cell_names, lacks_for_pick, load_cell
from jobs.cells import CellCatalog

Printed = tuple[str, dict[str, Any]]
"""Text for people, and the same as data."""
NOUN = "cell of your own"


def run(action: str, target: str | None, settings: Settings) -> Printed:
    """Carry out one action.

    Args:
        action: ``list``, ``show``, ``check``, ``add`` or ``remove``.
        target: A file (``check``, ``add``) or a cell's name (``show``, ``remove``).
        settings: Where the database is.

    Raises:
        BadCell: The file is no sound cell; carries every fault.
        ServiceError: It cannot be done.
    """
    if action == "list":
        return _listed(settings)
    if target is None:
        noun = "FILE" if action in ("check", "add") else "NAME"
        raise InvalidInput(noun, None, f"must be given: cells {action} {noun}")
    if action == "check":
        return _described(read_file(Path(target)), "is a sound work cell")
    if action == "show":
        cell = named_cell(target, settings)
        return json.dumps(cell.definition(), indent=2), cell.definition()
    if action == "add":
        cell = read_file(Path(target))
        with opened(settings, NOUN, create=True) as store:
            new = CellCatalog(store).add(cell)
        return _described(cell, "is stored" if new else "was stored already")
    with opened(settings, NOUN) as store:
        CellCatalog(store).remove(target)
    return f"{target} is removed", {"name": target, "removed": True}


def read_file(path: Path) -> Cell:
    """Read a cell from a file.

    Raises:
        BadCell: It is no sound cell.
        InvalidInput: The file cannot be read.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except OSError as error:
        rule = f"cannot be read: {error.strerror}"
        raise InvalidInput("FILE", str(path), rule) from error
    return read_cell(content)


def named_cell(name: str, settings: Settings) -> Cell:
    """Return a shipped cell, or one of the user's own from the database.

    Raises:
        NotFound: No cell has that name.
    """
    if name in cell_names():
        return load_cell(name)
    if not has_database(settings):
        raise NotFound("cell", name, cell_names())
    with opened(settings, NOUN) as store:
        return CellCatalog(store).get(name)


def _listed(settings: Settings) -> Printed:
    cells = [load_cell(name) for name in cell_names()]
    if has_database(settings):
        with opened(settings, NOUN) as store:
            cells = CellCatalog(store).all()
    rows = [
        {
            "name": cell.name,
            "title": cell.title,
            "shipped": cell.name in cell_names(),
            "pick": lacks_for_pick(cell) is None,
        }
        for cell in cells
    ]
    lines = [f"{cell.name:20} {cell.title}" for cell in cells]
    return "\n".join(lines), {"cells": rows}


def _described(cell: Cell, what: str) -> Printed:
    n_targets = 0 if cell.goal_region is None else len(cell.goal_region.targets())
    counted = (
        (len(cell.stations), "station", "stations"),
        (n_targets, "grid target", "grid targets"),
        (len(cell.obstacles), "obstacle", "obstacles"),
        (len(cell.people), "person", "people"),
    )
    parts = [f"{n} {one if n == 1 else more}" for n, one, more in counted if n]
    lack = lacks_for_pick(cell)
    lines = [f"{cell.name} {what}: {', '.join(parts)}"]
    if lack is not None:
        lines.append(f"not for picking: it {lack}")
    found = {
        "name": cell.name,
        "ok": True,
        "stations": list(cell.station_ids),
        "sha256": cell.sha256,
        "lacks_for_pick": lack,
    }
    return "\n".join(lines), found
