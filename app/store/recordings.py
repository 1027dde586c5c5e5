"""Imported human motion, as bytes under a name; the store never opens them.

A stored recording never changes: another file under the same name is refused until the first
is removed, so that results keep the meaning of the names they cite.
"""

import logging
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa

from app.digests import digest, has_digest
from app.errors import Conflict, Damaged, InvalidInput, NotFound, WrongState
from app.store.database.tables import recordings
from app.store.engine import Store
from app.store.records import NewRecording, StoredRecording
from app.store.references import require_unused

logger = logging.getLogger(__name__)

MAX_RECORDINGS = 200
"""Largest number of recordings."""
MAX_TENSORS = 40 * 1024 * 1024
"""Largest recording [bytes]; 200 000 frames are 31 MiB."""
MAX_TOTAL = 2 * 1024 * 1024 * 1024
"""Limit of the size of all recordings [bytes]."""

_LISTED = [one for one in recordings.c if one.name not in ("digest", "tensors", "detail")]


def put_recording(store: Store, new: NewRecording) -> bool:
    """Store a recording; return whether it is new: the same one again has no effect.

    Raises:
        InvalidInput: It is too large.
        Conflict: Another file has that name, or the limits are reached.
        StorageFull: No room is left.
    """
    if len(new.tensors) > MAX_TENSORS:
        rule = f"bytes exceed the limit of {MAX_TENSORS} bytes per recording"
        raise InvalidInput("recording", len(new.tensors), rule)
    with store.writing() as connection:
        if _is_stored(connection, new.name, new.sha256):
            return False
        summary, detail = dict(new.summary), dict(new.detail)
        values = {
            **asdict(new),
            "size": len(new.tensors),
            "created_at": datetime.now(UTC),
            "summary_digest": digest({"summary": summary}),
            "digest": digest({"summary": summary, "detail": detail}, new.tensors),
        }
        connection.execute(sa.insert(recordings).values(values))
    return True


def is_stored(store: Store, name: str, sha256: str) -> bool:
    """Return whether a file is stored under a name; otherwise it could be stored now.

    Raises:
        WrongState: Another file has that name.
        Conflict: The limits are reached.
    """
    with store.reading() as connection:
        return _is_stored(connection, name, sha256)


def read_runs(store: Store, name: str) -> tuple[StoredRecording, bytes]:
    """Return a recording with its detail, and the safetensors bytes of its runs.

    Raises:
        NotFound: No recording has that name.
        Damaged: Its digest does not match.
    """
    with store.reading() as connection:
        row = dict(_row(connection, name, list(recordings.c)))
    content = {"summary": row["summary"], "detail": row["detail"]}
    if not has_digest(row["digest"], content, row["tensors"]):
        raise Damaged("recording", name, "remove it, and import its file again")
    tensors: bytes = row.pop("tensors")
    return _record(row), tensors


def recording_number(store: Store, name: str) -> int:
    """Return the running number of a recording; a later one of its name has another number.

    Raises:
        NotFound: No recording has that name.
    """
    with store.reading() as connection:
        return int(_row(connection, name, [recordings.c.number])["number"])


def list_recordings(store: Store) -> tuple[StoredRecording, ...]:
    """Return all recordings with an undamaged summary, by name, without detail and runs."""
    query = sa.select(*_LISTED).order_by(recordings.c.name)
    with store.reading() as connection:
        rows = connection.execute(query).mappings().all()
    found = []
    for row in rows:
        if has_digest(row["summary_digest"], {"summary": row["summary"]}):
            found.append(_record(row))
        else:
            logger.error("recording %s is damaged and left out", row["name"])
    return tuple(found)


def recording_names(store: Store) -> tuple[str, ...]:
    """Return the names of all recordings."""
    with store.reading() as connection:
        query = sa.select(recordings.c.name).order_by(recordings.c.name)
        return tuple(connection.execute(query).scalars())


def remove_recording(store: Store, name: str) -> None:
    """Remove a recording.

    Raises:
        NotFound: No recording has that name.
        WrongState: A job that has not ended evaluates with it.
    """
    query = sa.delete(recordings).where(recordings.c.name == name)
    with store.writing() as connection:
        if not connection.execute(query).rowcount:
            raise NotFound("recording", name)
        require_unused(connection, "recording", name, lambda job: name in job.recordings)


def _record(row: Any) -> StoredRecording:
    return StoredRecording(**{name: row[name] for name in row if "digest" not in name})


def _row(connection: sa.Connection, name: str, columns: list[sa.Column[Any]]) -> Any:
    query = sa.select(*columns).where(recordings.c.name == name)
    row = connection.execute(query).mappings().first()
    if row is None:
        raise NotFound("recording", name)
    return row


def _is_stored(connection: sa.Connection, name: str, sha256: str) -> bool:
    query = sa.select(recordings.c.sha256).where(recordings.c.name == name)
    stored = connection.execute(query).scalar()
    if stored == sha256:
        return True
    if stored is not None:
        rule = "from another file is stored: remove it first, or choose another name"
        raise WrongState("name", name, rule)
    held = sa.select(sa.func.count(), sa.func.coalesce(sa.func.sum(recordings.c.size), 0))
    count, total = connection.execute(held.select_from(recordings)).one()
    if count >= MAX_RECORDINGS:
        raise Conflict(f"{MAX_RECORDINGS} recordings are stored, the limit: remove one first")
    if total >= MAX_TOTAL:
        raise Conflict(
            f"the stored recordings take {total} of at most {MAX_TOTAL} bytes: remove one first"
        )
    return False
