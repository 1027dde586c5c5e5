"""The verb ``cells`` of the command line: list, show, check, add and remove work cells.

Each function returns what is to be printed; the entry point prints it.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from app.errors import Conflict, InvalidInput, NotFound
from app.settings import Settings
from app.sim.cell_file import MAX_BYTES, read_cell
from app.sim.cells import Cell, cell_names, lacks_for_pick, load_cell
from app.store.engine import Store
from app.store.lock import ServerLock
from app.store.migrate import migrate
from app.store.schema import check_schema
from jobs.cells import CellCatalog

Printed = tuple[str, dict[str, Any]]
"""Text for people, and the same as data."""


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
        with _store(settings, create=True) as store:
            new = CellCatalog(store).add(cell)
        return _described(cell, "is stored" if new else "was stored already")
    with _store(settings) as store:
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
    if not _has_database(settings):
        raise NotFound("cell", name, cell_names())
    with _store(settings) as store:
        return CellCatalog(store).get(name)


def _listed(settings: Settings) -> Printed:
    cells = [load_cell(name) for name in cell_names()]
    if _has_database(settings):
        with _store(settings) as store:
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


def _has_database(settings: Settings) -> bool:
    return settings.database_url is not None or (settings.data / "tandem.db").exists()


@contextmanager
def _store(settings: Settings, *, create: bool = False) -> Iterator[Store]:
    """Open the database; with ``create`` one that is not there yet is made."""
    if create:
        settings.data.mkdir(parents=True, exist_ok=True)
    elif not _has_database(settings):
        raise NotFound("cell of your own: there is no database at", settings.database)
    store = Store(settings.database)
    try:
        try:
            check_schema(store)
        except Conflict:
            if not create:
                raise
            lock = ServerLock(store, settings.data)
            lock.acquire()
            try:
                migrate(store)
            finally:
                lock.release()
        yield store
    finally:
        store.close()
