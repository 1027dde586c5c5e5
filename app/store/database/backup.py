"""Backups of a data folder with a SQLite database, also while the server runs.

A backup is an archive with the database as one file and the other files of the data folder. The
database is copied by SQLite's online backup, which sees one consistent state and blocks no
writer; the files beside it never change once they have their name, and are held by links until
they are copied.
"""

import errno
import os
import shutil
import sqlite3
import tarfile
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import takewhile
from pathlib import Path, PurePath, PurePosixPath
from typing import Any

from app.durable_files import sync_folder
from app.errors import Conflict, InvalidInput
from app.storage_errors import StorageDamaged, StorageFull, StorageUnavailable
from app.store.database.archive import (
    DATABASE,
    FORMAT,
    is_backup,
    measured,
    opened,
    unpack,
    write_archive,
)
from app.store.database.lock import ServerLock
from app.store.database.schema import REVISION
from app.store.engine import BUSY_TIMEOUT_S, Store
from app.temporary_folder import TemporaryFolder, remove_left

TEMPORARY = ".unfinished-tandem-backup-"
"""Start of the names of folders that exist during a backup or its restoration."""
NOT_KEPT = (
    "kernels",
    "logs",
    ".*",
    "*.lock",
    "*.db",
    "*.db-*",
    "*.db.*",
    "*.part",
    "*.unfinished",
)
"""Names in the data folder that no backup contains and none restores, as patterns; compiled
kernels are code."""


_WITHOUT_LINKS = (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EXDEV)
"""Errors of a file system that has no links, or not for this file, or is another one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BackupSummary:
    """Content of a backup."""

    path: Path
    """Its file."""
    created_at: str
    """Time of the copy of the database, ISO 8601."""
    revision: str
    """Schema of the database."""
    rows: Mapping[str, int]
    """Number of rows of each table."""
    n_files: int
    """Number of files beside the database."""
    size: int
    """Size of the archive [bytes]."""


def write_backup(store: Store, data_dir: Path, path: Path) -> BackupSummary:
    """Write a backup of a SQLite database to a new file, which appears when it is complete.

    Raises:
        InvalidInput: The file exists, its folder cannot be written to, or the database is no
            SQLite file.
        StorageDamaged: The database is damaged; no backup is written.
        StorageFull: The disk of the backup is full.
    """
    source = _sqlite_file(store)
    if path.exists():
        raise _exists(path)
    with (
        _file_errors(path, store.shown_url),
        closing(TemporaryFolder(TEMPORARY, data_dir)) as links,
        closing(TemporaryFolder(TEMPORARY, path.parent)) as folder,
    ):
        held = links.path
        part, copy = folder.path / "backup.tar", folder.path / DATABASE
        _link_files(data_dir, held, source)
        _copy_database(source, copy, store.shown_url)
        created_at = datetime.now(UTC).isoformat(timespec="seconds")
        _link_files(data_dir, held, source)
        files = {DATABASE: copy} | {
            f"files/{name}": file for name, file in _files(held, source)
        }
        with closing(sqlite3.connect(copy)) as database:
            rows = _row_counts(database)
            (revision,) = database.execute("SELECT version_num FROM alembic_version").fetchone()
        head = {
            "format": FORMAT,
            "created_at": created_at,
            "revision": revision,
            "rows": rows,
            "files": {name: measured(file) for name, file in files.items()},
        }
        write_archive(part, head, files)
        _publish(part, path)
        sync_folder(path.parent)
    return _summary(path, head)


def restore_backup(
    store: Store, data_dir: Path, path: Path
) -> tuple[BackupSummary, Path | None]:
    """Replace a SQLite database, which may be damaged or missing, by that of a backup.

    The present one is kept beside it. Nothing changes unless the whole backup is sound.

    Returns:
        The content of the backup, and where the database that was there before is kept.

    Raises:
        Conflict: A server uses the folder or the database, or a newer version wrote the backup.
        InvalidInput: The file is no backup, torn or changed, or the database is no SQLite file.
        StorageFull: The disk of the data folder is full.
    """
    target = _sqlite_file(store)
    data_dir.mkdir(parents=True, exist_ok=True)
    lock = ServerLock(store, data_dir)
    lock.acquire()
    try:
        with (
            _file_errors(target, store.shown_url),
            opened(path) as (archive, head),
            closing(TemporaryFolder(TEMPORARY, target.parent)) as folder,
        ):
            part = folder.path / DATABASE
            if head["revision"] > REVISION:
                raise Conflict(
                    f"{path} has schema {head['revision']}, this version of Tandem knows "
                    f"{REVISION} at most: restore it with the version that wrote it"
                )
            unpack(archive, head, DATABASE, part)
            _check_database(part, str(path))
            for name in head["files"]:
                if name != DATABASE and _is_kept(PurePosixPath(name)):
                    _restore_file(archive, head, name, data_dir, target)
            kept = _keep(target)
            part.replace(target)
            sync_folder(target.parent)
    finally:
        lock.release()
    return _summary(path, head), kept


def remove_unfinished(store: Store, data_dir: Path) -> None:
    """Remove what killed backups and restorations left in the folders of data and database."""
    remove_left(data_dir, TEMPORARY)
    if store.sqlite_path is not None:
        remove_left(store.sqlite_path.parent, TEMPORARY)


def _sqlite_file(store: Store) -> Path:
    if store.sqlite_path is None:
        rule = "is no SQLite file: use pg_dump and pg_restore"
        raise InvalidInput("TANDEM_DATABASE_URL", store.shown_url, rule)
    return store.sqlite_path


def _exists(path: Path) -> InvalidInput:
    return InvalidInput("FILE", str(path), "exists: name a new file")


def _publish(part: Path, path: Path) -> None:
    """Give a complete backup its name, unless another file has got it meanwhile."""
    try:
        os.link(part, path)
    except FileExistsError:
        raise _exists(path) from None
    except OSError:  # a file system without links
        part.replace(path)


@contextmanager
def _file_errors(place: Path, database: str) -> Iterator[None]:
    """Raise the project's error of a file or database error; ``place`` is written to."""
    try:
        yield
    except sqlite3.OperationalError as error:
        if "full" in str(error):
            raise StorageFull(str(place.parent)) from error
        raise StorageUnavailable(database, str(error)) from error
    except OSError as error:
        is_named = isinstance(error.filename, str)
        found = _without_temporary(Path(error.filename)) if is_named else place
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise StorageFull(str(found if found.is_dir() else found.parent)) from error
        rule = f"cannot be read or written: {error.strerror}"
        raise InvalidInput("file" if is_named else "FILE", str(found), rule) from error


def _without_temporary(path: Path) -> Path:
    """Return the folder in which a backup has its temporary folder, for a path in this one."""
    return Path(*takewhile(lambda part: not part.startswith(TEMPORARY), path.parts))


def _link_files(folder: Path, held: Path, database: Path) -> None:
    """Hold the files of the data folder, so that a running job cannot remove them."""
    for name, file in _files(folder, database):
        link = held / name
        if link.exists():
            continue
        link.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileNotFoundError):  # removed since: no later state refers to it
            _link(file, link)


def _link(file: Path, name: Path) -> None:
    """Give a file a second name; on a file system without links, copy it."""
    try:
        os.link(file, name)
    except OSError as error:
        if error.errno not in _WITHOUT_LINKS:
            raise
        shutil.copyfile(file, name)
        with name.open("rb+") as copy:
            os.fsync(copy.fileno())


def _files(folder: Path, database: Path) -> Iterator[tuple[str, Path]]:
    """Yield the files of a folder that a backup contains, each with its relative name."""
    for place, folders, names in _walk(folder):
        folders[:] = sorted(one for one in folders if _is_kept(PurePath(one)))
        for file in (Path(place, one) for one in sorted(names)):
            kept = _is_kept(PurePath(file.name)) and file.is_file() and not file.is_symlink()
            if kept and not _is_of_database(file, database) and not is_backup(file):
                yield file.relative_to(folder).as_posix(), file


def _walk(folder: Path) -> Iterator[tuple[str, list[str], list[str]]]:
    """Yield the folders below a folder as ``os.walk``; links in it to other folders, too.

    A link to a folder that contains this one is left out.
    """
    above = folder.resolve()
    linked = [one for one in sorted(folder.iterdir()) if one.is_symlink() and one.is_dir()]
    others = [one for one in linked if not above.is_relative_to(one.resolve())]
    for top in (folder, *(one for one in others if _is_kept(PurePath(one.name)))):
        yield from os.walk(top, onerror=_raise_unless_removed)


def _raise_unless_removed(error: OSError) -> None:
    if not isinstance(error, FileNotFoundError):
        raise error


def _is_kept(name: PurePath) -> bool:
    """Return whether backups contain a file of this relative name."""
    return not any(PurePosixPath(part).match(one) for part in name.parts for one in NOT_KEPT)


def _is_of_database(file: Path, database: Path) -> bool:
    """Return whether a file is the database, its log, or one that was kept beside it."""
    database = database.resolve()
    before, name, rest = file.name.partition(database.name)
    same = file.parent.resolve() == database.parent and bool(name) and not before
    return same and rest[:1] in "-."


def _copy_database(source: Path, copy: Path, shown: str) -> None:
    if not source.exists():
        raise InvalidInput("TANDEM_DATA", str(source.parent), "has no database")
    compact = copy.with_name(f"{copy.name}.compact")
    try:
        with (
            closing(sqlite3.connect(source, timeout=BUSY_TIMEOUT_S)) as live,
            closing(sqlite3.connect(copy)) as database,
        ):
            live.backup(database)
            database.execute("PRAGMA journal_mode = DELETE")  # one file
            _check_database(copy, shown)
            database.execute("PRAGMA auto_vacuum = INCREMENTAL")  # as of a new file
            database.execute("VACUUM INTO ?", (str(compact),))
        compact.replace(copy)
    except sqlite3.OperationalError:
        raise
    except sqlite3.DatabaseError as error:
        raise StorageDamaged(shown, str(error)) from error


def _check_database(path: Path, shown: str) -> None:
    try:
        with closing(sqlite3.connect(path)) as database:
            (found,) = database.execute("PRAGMA integrity_check(1)").fetchone()
    except sqlite3.DatabaseError as error:
        raise StorageDamaged(shown, str(error)) from error
    if found != "ok":
        raise StorageDamaged(shown, found.replace("\n", " "))


def _row_counts(database: sqlite3.Connection) -> dict[str, int]:
    query = "SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name"
    tables = [name for (name,) in database.execute(query)]
    return {
        name: int(database.execute(f'SELECT count(*) FROM "{name}"').fetchone()[0])
        for name in tables
        if not name.startswith(("sqlite_", "alembic_"))
    }


def _restore_file(
    archive: tarfile.TarFile, head: Mapping[str, Any], name: str, data_dir: Path, database: Path
) -> None:
    target = data_dir / PurePosixPath(name).relative_to("files")
    is_there = target.is_file() and measured(target) == head["files"][name]
    if is_there or _is_of_database(target, database):  # as in backups of earlier versions
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f"{target.name}.part")
    unpack(archive, head, name, part)
    part.replace(target)
    sync_folder(target.parent)


def _keep(target: Path) -> Path | None:
    """Keep the present database, with its write-ahead log, under another name."""
    if not target.exists():
        return None
    try:  # an empty log: the file alone is the database
        with closing(sqlite3.connect(target)) as database:
            database.execute("PRAGMA journal_mode = DELETE")
    except sqlite3.DatabaseError:
        pass  # a damaged one is kept with its log
    kept = target.with_name(f"{target.name}.{datetime.now(UTC):%Y%m%dT%H%M%S%f}.kept")
    for suffix in ("", "-wal"):
        present = target.with_name(target.name + suffix)
        if present.exists():
            _link(present, kept.with_name(kept.name + suffix))
    for suffix in ("-wal", "-shm"):
        target.with_name(target.name + suffix).unlink(missing_ok=True)
    return kept


def _summary(path: Path, head: Mapping[str, Any]) -> BackupSummary:
    return BackupSummary(
        path=path,
        created_at=head["created_at"],
        revision=head["revision"],
        rows=head["rows"],
        n_files=len(head["files"]) - 1,
        size=path.stat().st_size,
    )
