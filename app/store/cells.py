"""Work cells of the user's own, as JSON under a name; the store never opens them.

A stored cell never changes: another one of the same name is refused until the first is removed,
so that a job trains in the cell for which it was posted.
"""

import logging
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa

from app.digests import digest, has_digest
from app.errors import Conflict, Damaged, NotFound, WrongState
from app.store.database.tables import cells
from app.store.engine import Store
from app.store.records import CellRecord
from app.store.references import require_unused

logger = logging.getLogger(__name__)

MAX_CELLS = 200
"""Largest number of cells."""


def put_cell(store: Store, name: str, definition: Mapping[str, Any]) -> bool:
    """Store a cell; return whether it is new: the same one again has no effect.

    Raises:
        WrongState: Another cell has that name.
        Conflict: There are too many.
        StorageFull: No room is left.
    """
    with store.writing() as connection:
        known = {row.name: row.definition for row in connection.execute(sa.select(cells))}
        if name in known:
            if known[name] == definition:
                return False
            rule = "with other content is stored: remove it first, or choose another name"
            raise WrongState("name", name, rule)
        if len(known) >= MAX_CELLS:
            raise Conflict(f"{MAX_CELLS} cells are stored, the limit: remove one first")
        content = {"definition": dict(definition)}
        values = {"name": name, "digest": digest(content), "created_at": datetime.now(UTC)}
        connection.execute(sa.insert(cells).values({**values, **content}))
    return True


def get_cell(store: Store, name: str) -> CellRecord:
    """Return one cell.

    Raises:
        NotFound: No cell has that name.
        Damaged: Its digest does not match.
    """
    query = sa.select(cells).where(cells.c.name == name)
    with store.reading() as connection:
        row = connection.execute(query).mappings().first()
    if row is None:
        raise NotFound("cell", name)
    if not _is_sound(row):
        raise Damaged("cell", name, "remove it, and post its file again")
    return _record(row)


def list_cells(store: Store) -> tuple[CellRecord, ...]:
    """Return all undamaged cells, by name."""
    with store.reading() as connection:
        rows = connection.execute(sa.select(cells).order_by(cells.c.name)).mappings().all()
    found = []
    for row in rows:
        if _is_sound(row):
            found.append(_record(row))
        else:
            logger.error("cell %s is damaged and left out", row["name"])
    return tuple(found)


def list_names(store: Store) -> tuple[str, ...]:
    """Return the names of all cells, damaged ones too."""
    query = sa.select(cells.c.name).order_by(cells.c.name)
    with store.reading() as connection:
        return tuple(connection.execute(query).scalars())


def _is_sound(row: sa.RowMapping) -> bool:
    return has_digest(row["digest"], {"definition": row["definition"]})


def _record(row: sa.RowMapping) -> CellRecord:
    values = {name: value for name, value in row.items() if name != "digest"}
    return CellRecord(**values)


def remove_cell(store: Store, name: str) -> None:
    """Remove a cell; policies trained in it have their own copy.

    Raises:
        NotFound: No cell has that name.
        WrongState: A job that has not ended trains in it.
    """
    query = sa.delete(cells).where(cells.c.name == name)
    with store.writing() as connection:
        if not connection.execute(query).rowcount:
            raise NotFound("cell", name)
        require_unused(connection, "cell", name, lambda job: job.cell == name)
