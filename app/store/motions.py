"""Imported human motions, as bytes under their names; the store never opens them.

A stored motion never changes: another file under the same name is refused until the first is
removed, so that what was measured with a motion is what its name meant.
"""

import logging
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa

from app.digests import digest, has_digest
from app.errors import Conflict, Damaged, InvalidInput, NotFound
from app.store.engine import Store
from app.store.records import NewRecording, StoredRecording
from app.store.tables import motions

logger = logging.getLogger(__name__)

MAX_RECORDINGS = 200
"""Most motions that are kept."""
MAX_TENSORS = 40 * 1024 * 1024
"""Largest motion that goes into the database [bytes]; 200 000 frames are 31 MiB."""
MAX_TOTAL = 2 * 1024 * 1024 * 1024
"""Most that all motions together take [bytes]."""

_LISTED = [column for column in motions.c if column.name not in ("digest", "tensors", "detail")]
_DETAILED = [*_LISTED, motions.c.detail]


def put_recording(store: Store, new: NewRecording) -> bool:
    """Store a motion; the same file under the same name again is harmless.

    Args:
        store: The database.
        new: The motion.

    Returns:
        Whether it is new.

    Raises:
        InvalidInput: It is too large.
        Conflict: Another file has that name, or there is too much.
        StorageFull: No room is left.
    """
    if len(new.tensors) > MAX_TENSORS:
        rule = f"bytes exceed the limit of {MAX_TENSORS} bytes per motion"
        raise InvalidInput("motion", len(new.tensors), rule)
    with store.writing() as connection:
        if _same(connection, new.name, new.sha256) is not None:
            return False
        summary, detail = dict(new.summary), dict(new.detail)
        values = {
            "name": new.name,
            "sha256": new.sha256,
            "file_name": new.file_name,
            "n_runs": new.n_runs,
            "n_frames": new.n_frames,
            "duration": new.duration,
            "summary": summary,
            "detail": detail,
            "size": len(new.tensors),
            "created_at": datetime.now(UTC),
            "summary_digest": digest({"summary": summary}),
            "digest": digest({"summary": summary, "detail": detail}, new.tensors),
            "tensors": new.tensors,
        }
        connection.execute(sa.insert(motions).values(values))
    return True


def find_same(store: Store, name: str, sha256: str) -> StoredRecording | None:
    """Return what is stored of a file under a name; None where it could be stored now.

    Args:
        store: The database.
        name: Name of the motion.
        sha256: Of the file.

    Raises:
        Conflict: Another file has that name, or there is too much.
    """
    with store.reading() as connection:
        return _same(connection, name, sha256)


def read_runs(store: Store, name: str) -> tuple[StoredRecording, bytes]:
    """Return one motion with its detail and the safetensors bytes of its runs.

    Raises:
        NotFound: No motion has that name.
        Damaged: It is not what was stored.
    """
    with store.reading() as connection:
        row = dict(_row(connection, name, list(motions.c)))
    content = {"summary": row["summary"], "detail": row["detail"]}
    if not has_digest(row["digest"], content, row["tensors"]):
        raise Damaged("motion", name, "remove it, and import its file again")
    tensors: bytes = row.pop("tensors")
    return _record(row), tensors


def recording_number(store: Store, name: str) -> int:
    """Return the running number of a motion, which tells it from later ones of its name.

    Raises:
        NotFound: No motion has that name.
    """
    with store.reading() as connection:
        return int(_row(connection, name, [motions.c.number])["number"])


def list_recordings(store: Store) -> tuple[StoredRecording, ...]:
    """Return all motions whose summary is undamaged, by name, without detail and runs."""
    with store.reading() as connection:
        rows = connection.execute(sa.select(*_LISTED).order_by(motions.c.name)).mappings().all()
    found = []
    for row in rows:
        if has_digest(row["summary_digest"], {"summary": row["summary"]}):
            found.append(_record(row))
        else:
            logger.error("motion %s is damaged and left out", row["name"])
    return tuple(found)


def recording_names(store: Store) -> tuple[str, ...]:
    """Return the names of all motions."""
    with store.reading() as connection:
        query = sa.select(motions.c.name).order_by(motions.c.name)
        return tuple(connection.execute(query).scalars())


def remove_recording(store: Store, name: str) -> None:
    """Remove a motion.

    Raises:
        NotFound: No motion has that name.
    """
    with store.writing() as connection:
        if not connection.execute(sa.delete(motions).where(motions.c.name == name)).rowcount:
            raise NotFound("motion", name)


def _record(row: Any) -> StoredRecording:
    return StoredRecording(**{name: row[name] for name in row if "digest" not in name})


def _row(connection: sa.Connection, name: str, columns: list[sa.Column[Any]]) -> Any:
    query = sa.select(*columns).where(motions.c.name == name)
    row = connection.execute(query).mappings().first()
    if row is None:
        raise NotFound("motion", name)
    return row


def _same(connection: sa.Connection, name: str, sha256: str) -> StoredRecording | None:
    query = sa.select(*_DETAILED).where(motions.c.name == name)
    row = connection.execute(query).mappings().first()
    if row is not None:
        if row["sha256"] == sha256:
            return _record(row)
        raise Conflict(
            f"a motion named {name!r} from another file is stored: remove it first, or choose "
            "another name"
        )
    held = sa.select(sa.func.count(), sa.func.coalesce(sa.func.sum(motions.c.size), 0))
    n_motions, total = connection.execute(held.select_from(motions)).one()
    if n_motions >= MAX_RECORDINGS:
        raise Conflict(
            f"{MAX_RECORDINGS} motions are stored, no more are kept: remove one first"
        )
    if total >= MAX_TOTAL:
        raise Conflict(
            f"the stored motions take {total} bytes, from {MAX_TOTAL} on no more are kept: "
            "remove one first"
        )
    return None
