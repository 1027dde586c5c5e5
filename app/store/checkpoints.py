"""Trained policies and their aliases.

A checkpoint is a JSON manifest and safetensors bytes under their SHA-256, which is checked at
each reading; the store never opens it. Jobs that made the same bytes share one row.
"""

import logging
import re
from collections.abc import Collection, Iterator
from datetime import UTC, datetime
from typing import Any

import sqlalchemy as sa

from app.digests import has_digest
from app.errors import Damaged, InvalidInput, NotFound
from app.store.cursors import MAX_INTEGER, MAX_NUMBER, read_page
from app.store.database.tables import aliases, checkpoints, job_checkpoints
from app.store.engine import Store
from app.store.records import CheckpointRecord, NewCheckpoint, Page
from app.store.references import named_checkpoint, to_be_evaluated

logger = logging.getLogger(__name__)

REMEDY = (
    "restore the database from a backup, or train it again with its preset and seed, which "
    "gives the same weights"
)
MAX_TENSORS = 16 * 1024 * 1024
"""Largest checkpoint [bytes]."""

_SHA256 = re.compile(r"[0-9a-f]{64}")
_ALIAS = re.compile(r"[a-z0-9][a-z0-9._-]{0,63}")


def put_checkpoint(store: Store, new: NewCheckpoint) -> CheckpointRecord:
    """Store a checkpoint without a job, such as a shipped one; again has no effect.

    Raises:
        InvalidInput: Its id is no SHA-256 or it is too large.
        StorageFull: No room is left.
    """
    with store.writing() as connection:
        insert_checkpoint(connection, new, imported=True)
        return find_checkpoint(connection, new.sha256)


def get_checkpoint(store: Store, reference: str) -> CheckpointRecord:
    """Return one checkpoint, by SHA-256 or alias, without its tensors.

    Raises:
        NotFound: Nothing has that name.
    """
    with store.reading() as connection:
        return find_checkpoint(connection, reference)


def find_checkpoint(connection: sa.Connection, reference: str) -> CheckpointRecord:
    """Return one checkpoint in a transaction, by SHA-256 or alias, without its tensors.

    Raises:
        NotFound: Nothing has that name.
    """
    sha256 = _resolve(connection, reference)
    query = _described().where(checkpoints.c.sha256 == sha256)
    row = connection.execute(query).mappings().first()
    if row is None:
        raise NotFound("checkpoint", reference)
    return _record(row, _names(connection))


def read_checkpoint(store: Store, reference: str) -> tuple[CheckpointRecord, bytes]:
    """Return one checkpoint, by SHA-256 or alias, with its safetensors bytes.

    Raises:
        NotFound: Nothing has that name.
        Damaged: The digest does not match, or an alias has no checkpoint.
    """
    with store.reading() as connection:
        sha256 = _resolve(connection, reference)
        query = _described().add_columns(checkpoints.c.tensors)
        query = query.where(checkpoints.c.sha256 == sha256)
        row = connection.execute(query).mappings().first()
        names = _names(connection)
    if row is None and reference == sha256:
        raise NotFound("checkpoint", reference)
    if row is None or not has_digest(sha256, row["manifest"], row["tensors"]):
        known = ", ".join(names.get(sha256, ()))
        raise Damaged("checkpoint", known or sha256, REMEDY, sha256)
    return _record(row, names), row["tensors"]


def stored_among(store: Store, names: Collection[str]) -> set[str]:
    """Return those of some checkpoints that are stored, by SHA-256."""
    query = sa.select(checkpoints.c.sha256).where(checkpoints.c.sha256.in_(names))
    with store.reading() as connection:
        return set(connection.execute(query).scalars())


def find_damaged(store: Store) -> Iterator[Damaged | None]:
    """Read all checkpoints; yield the error of each damaged one, None for a sound one."""
    with store.reading() as connection:
        ids = connection.execute(sa.select(checkpoints.c.sha256)).scalars().all()
    for reference in (*ids, *list_aliases(store)):
        try:
            read_checkpoint(store, reference)
        except Damaged as error:
            yield error
        except NotFound:
            continue  # removed since
        else:
            yield None


def list_checkpoints(
    store: Store, *, job_id: str | None = None, cursor: str | None = None, limit: int = 50
) -> Page[CheckpointRecord]:
    """Return one page of the checkpoints, newest first.

    Args:
        job_id: Only checkpoints of this job, by their steps in it: it may share one with an
            older job.
        cursor: ``next_cursor`` of the page before; None for the first.
        limit: Length of the page, 1 to 200.

    Raises:
        InvalidInput: The cursor or limit is invalid.
    """
    found = _described(job_id).subquery()
    number, most = found.c.number, MAX_NUMBER
    if job_id is not None:
        number, most = found.c.step, MAX_INTEGER
    with store.reading() as connection:
        rows, more = read_page(connection, sa.select(found), number, cursor, limit, most)
        names = _names(connection)
    return Page(items=tuple(_record(row, names) for row in rows), next_cursor=more)


def set_alias(store: Store, name: str, sha256: str) -> None:
    """Set the checkpoint of an alias.

    Raises:
        NotFound: There is no such checkpoint.
        InvalidInput: The name has other than 1 to 64 of the characters ``a-z 0-9 . _ -``.
    """
    if not _ALIAS.fullmatch(name) or _SHA256.fullmatch(name):
        rule = "must have 1 to 64 of the characters a-z 0-9 . _ - and start with a-z or 0-9"
        raise InvalidInput("alias", name, rule)
    with store.writing() as connection:
        known = sa.select(checkpoints.c.sha256).where(checkpoints.c.sha256 == sha256)
        if connection.execute(known).first() is None:
            raise NotFound("checkpoint", sha256)
        connection.execute(sa.delete(aliases).where(aliases.c.name == name))
        values = {"name": name, "sha256": sha256, "set_at": datetime.now(UTC)}
        connection.execute(sa.insert(aliases).values(values))


def remove_alias(store: Store, name: str) -> None:
    """Remove an alias; its checkpoint stays.

    Raises:
        NotFound: There is no such alias.
    """
    with store.writing() as connection:
        removed = connection.execute(sa.delete(aliases).where(aliases.c.name == name))
        if removed.rowcount == 0:
            raise NotFound("alias", name, sorted(sum(_names(connection).values(), ())))


def list_aliases(store: Store) -> dict[str, str]:
    """Return the SHA-256 of every alias."""
    query = sa.select(aliases.c.name, aliases.c.sha256).order_by(aliases.c.name)
    with store.reading() as connection:
        return {row.name: row.sha256 for row in connection.execute(query)}


def insert_checkpoint(
    connection: sa.Connection, new: NewCheckpoint, *, imported: bool = False
) -> None:
    """Insert a checkpoint in a transaction, unless it is stored; replace a damaged one.

    Raises:
        InvalidInput: Its id is no SHA-256 or it is too large.
    """
    if not _SHA256.fullmatch(new.sha256):
        raise InvalidInput("checkpoint", new.sha256, "must be 64 hexadecimal digits")
    if len(new.tensors) > MAX_TENSORS:
        rule = f"bytes exceed the limit of {MAX_TENSORS} bytes per checkpoint"
        raise InvalidInput("checkpoint.tensors", len(new.tensors), rule)
    content = {"manifest": dict(new.manifest), "size": len(new.tensors), "tensors": new.tensors}
    same = checkpoints.c.sha256 == new.sha256
    query = sa.select(checkpoints).where(same)
    there = connection.execute(query).first()
    if there is None:
        values = {"sha256": new.sha256, "imported": imported, "created_at": datetime.now(UTC)}
        connection.execute(sa.insert(checkpoints).values({**values, **content}))
        return
    if not has_digest(new.sha256, there.manifest, there.tensors):
        logger.warning("checkpoint %s was damaged: it is stored again", new.sha256)
        connection.execute(sa.update(checkpoints).where(same).values(content))
    if imported and not there.imported:
        connection.execute(sa.update(checkpoints).where(same).values(imported=True))


def sole_checkpoints(connection: sa.Connection, job_id: str) -> tuple[str, ...]:
    """Return the SHA-256 of the checkpoints that nothing but a job refers to."""
    others = sa.select(job_checkpoints.c.sha256).where(job_checkpoints.c.job_id != job_id)
    query = (
        sa.select(checkpoints.c.sha256)
        .join(job_checkpoints, job_checkpoints.c.sha256 == checkpoints.c.sha256)
        .where(job_checkpoints.c.job_id == job_id, sa.not_(checkpoints.c.imported))
        .where(checkpoints.c.sha256.not_in(others))
        .where(checkpoints.c.sha256.not_in(sa.select(aliases.c.sha256)))
        .distinct()
    )
    return tuple(connection.execute(query).scalars())


def drop_job_checkpoints(connection: sa.Connection, job_id: str, *, beyond: int) -> None:
    """Delete a job's checkpoints beyond a step, and their bytes where unreferenced.

    Those that a job which has not ended refers to stay stored.
    """
    mine = sa.and_(job_checkpoints.c.job_id == job_id, job_checkpoints.c.step > beyond)
    dropped = set(connection.execute(sa.select(job_checkpoints.c.sha256).where(mine)).scalars())
    connection.execute(sa.delete(job_checkpoints).where(mine))
    if dropped:
        dropped -= {sha256 for sha256, _ in to_be_evaluated(connection, dropped)}
    unnamed = sa.and_(
        checkpoints.c.sha256.in_(dropped),
        sa.not_(checkpoints.c.imported),
        checkpoints.c.sha256.not_in(sa.select(job_checkpoints.c.sha256)),
        checkpoints.c.sha256.not_in(sa.select(aliases.c.sha256)),
    )
    connection.execute(sa.delete(checkpoints).where(unnamed))


def _resolve(connection: sa.Connection, reference: str) -> str:
    sha256 = named_checkpoint(connection, reference) or reference
    if sha256 == reference and not _SHA256.fullmatch(reference):
        names = sum(_names(connection).values(), ())
        raise NotFound("checkpoint", reference, sorted(names))
    return sha256


def _names(connection: sa.Connection) -> dict[str, tuple[str, ...]]:
    names: dict[str, tuple[str, ...]] = {}
    query = sa.select(aliases.c.name, aliases.c.sha256).order_by(aliases.c.name)
    for row in connection.execute(query):
        names[row.sha256] = (*names.get(row.sha256, ()), row.name)
    return names


def _described(job_id: str | None = None) -> sa.Select[Any]:
    """Select checkpoints without tensors, each with its first job and step."""
    link = job_checkpoints.alias()
    makes = [link.c.sha256 == checkpoints.c.sha256]
    if job_id is not None:
        makes.append(link.c.job_id == job_id)
    first = sa.select(link.c.job_id).where(*makes).order_by(link.c.step, link.c.job_id)
    query = sa.select(
        checkpoints.c.sha256,
        checkpoints.c.number,
        checkpoints.c.manifest,
        checkpoints.c.size,
        checkpoints.c.created_at,
        first.limit(1).scalar_subquery().label("job_id"),
        first.with_only_columns(link.c.step).limit(1).scalar_subquery().label("step"),
    )
    return query if job_id is None else query.where(sa.exists().where(*makes))


def _record(row: sa.RowMapping, names: dict[str, tuple[str, ...]]) -> CheckpointRecord:
    fields = {name: value for name, value in row.items() if name != "tensors"}
    if not isinstance(fields["manifest"], dict):
        fields["manifest"] = {}
    return CheckpointRecord(**fields, aliases=names.get(row["sha256"], ()))
