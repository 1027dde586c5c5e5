"""Backups of a data folder with a SQLite database, also while the server runs.

A backup is a tar archive: a JSON member with size and SHA-256 of every other member, the
database as one file, and the other files of the data folder. The database is copied by SQLite's
online backup, which sees one consistent state and blocks no writer; the files beside it never
change once they have their name, and are held by links until they are copied.
"""

import errno
import hashlib
import io
import json
import os
import shutil
import sqlite3
import tarfile
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import IO, Any

from app.errors import Conflict, InvalidInput
from app.storage_errors import StorageDamaged, StorageFull, StorageUnavailable
from app.store.database.lock import ServerLock
from app.store.database.schema import REVISION
from app.store.engine import BUSY_TIMEOUT_S, Store

HEAD, HEAD_DIGEST = "backup.json", "backup.json.sha256"
DATABASE = "tandem.db"
FORMAT = 1
NOT_KEPT = (
    "kernels",
    "logs",
    "*.lock",
    ".backup-*",
    "*.db",
    "*.db-*",
    "*.db.*",
    "*.part",
    "*.unfinished",
)
"""Names in the data folder that no backup contains, as patterns."""
CHUNK = 1 << 20


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
    """Write a backup; the file appears when it is complete.

    Args:
        store: A SQLite database.
        path: The new file.

    Raises:
        InvalidInput: The file exists, its folder cannot be written to, or the database is no
            SQLite file.
        StorageDamaged: The database is damaged; no backup is written.
        StorageFull: The disk of the backup is full.
    """
    source = _sqlite_file(store)
    if path.exists():
        raise InvalidInput("FILE", str(path), "exists: name a new file")
    part = path.with_name(f"{path.name}.part")
    copy = path.with_name(f"{path.name}.db.part")
    try:
        with (
            _file_errors(path),
            tempfile.TemporaryDirectory(dir=data_dir, prefix=".backup-") as held,
        ):
            _link_files(data_dir, Path(held), source)
            _copy_database(source, copy, store.shown_url)
            created_at = datetime.now(UTC).isoformat(timespec="seconds")
            _link_files(data_dir, Path(held), source)
            files = {DATABASE: copy} | {
                f"files/{name}": file for name, file in _files(Path(held), source)
            }
            with closing(sqlite3.connect(copy)) as database:
                rows = _row_counts(database)
                (revision,) = database.execute(
                    "SELECT version_num FROM alembic_version"
                ).fetchone()
            head = {
                "format": FORMAT,
                "created_at": created_at,
                "revision": revision,
                "rows": rows,
                "files": {name: _measured(file) for name, file in files.items()},
            }
            _write_archive(part, head, files)
            part.replace(path)
            _sync(path.parent)
    finally:
        for unfinished in (part, copy):
            unfinished.unlink(missing_ok=True)
    return _summary(path, head)


def restore_backup(
    store: Store, data_dir: Path, path: Path
) -> tuple[BackupSummary, Path | None]:
    """Replace the database by that of a backup; the present one is kept beside it.

    Nothing changes unless the whole backup is sound.

    Args:
        store: A SQLite database; it need not exist, or may be damaged.

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
    part = target.with_name(f"{target.name}.part")
    try:
        with _file_errors(target), _opened(path) as (archive, head):
            if head["revision"] > REVISION:
                raise Conflict(
                    f"{path} has schema {head['revision']}, this version of Tandem knows "
                    f"{REVISION} at most: restore it with the version that wrote it"
                )
            _unpack(archive, head, DATABASE, part)
            _check_database(part, str(path))
            for name in head["files"]:
                if name != DATABASE:
                    _restore_file(archive, head, name, data_dir, target)
            kept = _keep(target)
            part.replace(target)
            _sync(target.parent)
    finally:
        part.unlink(missing_ok=True)
        lock.release()
    return _summary(path, head), kept


def _sqlite_file(store: Store) -> Path:
    if store.sqlite_path is None:
        rule = "is no SQLite file: use pg_dump and pg_restore"
        raise InvalidInput("TANDEM_DATABASE_URL", store.shown_url, rule)
    return store.sqlite_path


@contextmanager
def _file_errors(place: Path) -> Iterator[None]:
    """Raise the project's error of a file or database error."""
    try:
        yield
    except sqlite3.OperationalError as error:
        if "full" in str(error):
            raise StorageFull(str(place.parent)) from error
        raise StorageUnavailable(str(place), str(error)) from error
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise StorageFull(str(place.parent)) from error
        raise InvalidInput("FILE", str(place), f"cannot be written: {error}") from error


def _link_files(folder: Path, held: Path, database: Path) -> None:
    """Hold the files of the data folder, so that a running job cannot remove them."""
    for name, file in _files(folder, database):
        link = held / name
        if link.exists():
            continue
        link.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.link(file, link)
        except FileNotFoundError:
            continue  # removed since, and not referred to by a later state
        except OSError:  # a file system without links
            shutil.copyfile(file, link)


def _files(folder: Path, database: Path) -> Iterator[tuple[str, Path]]:
    """Yield the files of a folder that a backup contains, each with its relative name."""
    for file in sorted(folder.rglob("*")):
        name = file.relative_to(folder)
        kept = not any(
            PurePosixPath(part).match(one) for part in name.parts for one in NOT_KEPT
        )
        kept = kept and file.is_file() and not file.is_symlink()
        if kept and not _is_of_database(file, database) and not _is_backup(file):
            yield name.as_posix(), file


def _is_of_database(file: Path, database: Path) -> bool:
    """Return whether a file is the database, its log, or one that was kept beside it."""
    database = database.resolve()
    before, name, rest = file.name.partition(database.name)
    same = file.parent.resolve() == database.parent and bool(name) and not before
    return same and rest[:1] in "-."


def _is_backup(file: Path) -> bool:
    """Return whether a file is an earlier backup: a tar archive that begins with its head."""
    try:
        with file.open("rb") as content:
            return content.read(len(HEAD) + 1) == f"{HEAD}\0".encode()
    except FileNotFoundError:
        return False  # removed since


def _copy_database(source: Path, copy: Path, shown: str) -> None:
    if not source.exists():
        raise InvalidInput("TANDEM_DATA", str(source.parent), "has no database")
    copy.unlink(missing_ok=True)
    try:
        with (
            closing(sqlite3.connect(source, timeout=BUSY_TIMEOUT_S)) as live,
            closing(sqlite3.connect(copy)) as database,
        ):
            live.backup(database)
            database.execute("PRAGMA journal_mode = DELETE")  # one file
        _check_database(copy, shown)
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


def _sha256(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()


def _measured(path: Path) -> dict[str, Any]:
    digest, size = hashlib.sha256(), 0
    with path.open("rb") as file:
        while chunk := file.read(CHUNK):
            digest.update(chunk)
            size += len(chunk)
    return {"size": size, "sha256": digest.hexdigest()}


def _write_archive(part: Path, head: Mapping[str, Any], files: Mapping[str, Path]) -> None:
    text = json.dumps(head, indent=1).encode()
    with part.open("wb") as output:
        with tarfile.open(fileobj=output, mode="w", format=tarfile.PAX_FORMAT) as archive:
            for name, content in ((HEAD, text), (HEAD_DIGEST, _sha256(text))):
                member = tarfile.TarInfo(name)
                member.size = len(content)
                archive.addfile(member, io.BytesIO(content))
            for name, file in files.items():
                member = tarfile.TarInfo(name)
                member.size = head["files"][name]["size"]
                with file.open("rb") as opened:
                    archive.addfile(member, opened)
        output.flush()
        os.fsync(output.fileno())


@contextmanager
def _opened(path: Path) -> Iterator[tuple[tarfile.TarFile, dict[str, Any]]]:
    """Open a backup and check that every member is there, whole and unchanged."""
    try:
        archive = tarfile.open(path, "r:")
    except (tarfile.TarError, OSError) as error:
        raise InvalidInput("FILE", str(path), f"is no backup of Tandem: {error}") from error
    with archive:
        try:
            text = _member(archive, HEAD, path).read()
            if _member(archive, HEAD_DIGEST, path).read() != _sha256(text):
                raise ValueError(f"{HEAD} does not have its checksum")
            head = json.loads(text)
            if head["format"] != FORMAT or DATABASE not in head["files"]:
                raise KeyError(DATABASE)
            for name, expected in head["files"].items():
                with _member(archive, name, path) as content:
                    _read_checked(content, name, expected, path, lambda _: None)
        except (tarfile.TarError, OSError, ValueError, KeyError, TypeError) as error:
            raise InvalidInput("FILE", str(path), f"is torn or no backup: {error}") from error
        yield archive, head


def _member(archive: tarfile.TarFile, name: str, path: Path) -> IO[bytes]:
    content = archive.extractfile(name)
    if content is None or ".." in PurePosixPath(name).parts or name.startswith("/"):
        raise InvalidInput("FILE", str(path), f"has an unusable member {name!r}")
    return content


def _read_checked(
    content: IO[bytes],
    name: str,
    expected: Mapping[str, Any],
    path: Path,
    use: Callable[[bytes], object],
) -> None:
    digest, size = hashlib.sha256(), 0
    while chunk := content.read(CHUNK):
        digest.update(chunk)
        size += len(chunk)
        use(chunk)
    if size != expected["size"] or digest.hexdigest() != expected["sha256"]:
        rule = f"is damaged: its member {name!r} does not have its checksum; use another backup"
        raise InvalidInput("FILE", str(path), rule)


def _unpack(archive: tarfile.TarFile, head: Mapping[str, Any], name: str, target: Path) -> None:
    source = Path(str(archive.name))
    with target.open("wb") as output, _member(archive, name, source) as content:
        _read_checked(content, name, head["files"][name], source, output.write)
        output.flush()
        os.fsync(output.fileno())


def _restore_file(
    archive: tarfile.TarFile, head: Mapping[str, Any], name: str, data_dir: Path, database: Path
) -> None:
    target = data_dir / PurePosixPath(name).relative_to("files")
    is_there = target.is_file() and _measured(target) == head["files"][name]
    if is_there or _is_of_database(target, database):  # as in backups of earlier versions
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    part = target.with_name(f"{target.name}.part")
    _unpack(archive, head, name, part)
    part.replace(target)
    _sync(target.parent)


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
            os.link(present, kept.with_name(kept.name + suffix))
    for suffix in ("-wal", "-shm"):
        target.with_name(target.name + suffix).unlink(missing_ok=True)
    return kept


def _sync(folder: Path) -> None:
    file = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)


def _summary(path: Path, head: Mapping[str, Any]) -> BackupSummary:
    return BackupSummary(
        path=path,
        created_at=head["created_at"],
        revision=head["revision"],
        rows=head["rows"],
        n_files=len(head["files"]) - 1,
        size=path.stat().st_size,
    )
