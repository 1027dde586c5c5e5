"""Archive of a backup: a tar file that begins with size and SHA-256 of every other member."""

import hashlib
import io
import json
import os
import tarfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import IO, Annotated, Any, Literal

from pydantic import BaseModel, Field

from app.errors import InvalidInput

HEAD, HEAD_DIGEST = "backup.json", "backup.json.sha256"
DATABASE = "tandem.db"
FORMAT = 1
CHUNK = 1 << 20


class _Member(BaseModel):
    """A member as the head states it."""

    size: int
    sha256: str


class _Head(BaseModel):
    """First member of an archive."""

    format: Literal[1]
    created_at: str
    revision: str
    rows: dict[str, int]
    files: dict[Annotated[str, Field(pattern=rf"^({DATABASE}|files/.+)$")], _Member]


def is_backup(file: Path) -> bool:
    """Return whether a file is an earlier backup: a tar archive that begins with its head."""
    try:
        with file.open("rb") as content:
            return content.read(len(HEAD) + 1) == f"{HEAD}\0".encode()
    except FileNotFoundError:
        return False  # removed since


def measured(path: Path) -> dict[str, Any]:
    """Return size [bytes] and SHA-256 of a file, as the head of an archive states them."""
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256")
        return {"size": file.tell(), "sha256": digest.hexdigest()}


def write_archive(part: Path, head: Mapping[str, Any], files: Mapping[str, Path]) -> None:
    """Write an archive and wait until the disk has it.

    Args:
        head: Describes the backup; its ``files`` have size and SHA-256 of each member.
        files: The file of each member.
    """
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
                with file.open("rb") as source:
                    archive.addfile(member, source)
        output.flush()
        os.fsync(output.fileno())


@contextmanager
def opened(path: Path) -> Iterator[tuple[tarfile.TarFile, dict[str, Any]]]:
    """Open a backup and check that every member is there, whole and unchanged."""
    try:
        archive = tarfile.open(path, "r:")
    except OSError as error:
        raise InvalidInput("FILE", str(path), f"cannot be read: {error.strerror}") from error
    except tarfile.TarError as error:
        raise InvalidInput("FILE", str(path), f"is not a backup of Tandem: {error}") from error
    with archive:
        try:
            text = _member(archive, HEAD, path).read()
            if _member(archive, HEAD_DIGEST, path).read() != _sha256(text):
                raise ValueError(f"{HEAD} does not have its checksum")
            head = _Head.model_validate_json(text).model_dump()
            if DATABASE not in head["files"]:
                raise KeyError(DATABASE)
            for name, expected in head["files"].items():
                with _member(archive, name, path) as content:
                    _read_checked(content, name, expected, path, lambda _: None)
        except (tarfile.TarError, OSError, ValueError, KeyError, TypeError) as error:
            raise InvalidInput("FILE", str(path), f"is torn or no backup: {error}") from error
        yield archive, head


def unpack(archive: tarfile.TarFile, head: Mapping[str, Any], name: str, target: Path) -> None:
    """Write a member to a file.

    Raises:
        InvalidInput: It does not have its size and SHA-256.
    """
    source = Path(str(archive.name))
    with target.open("wb") as output, _member(archive, name, source) as content:
        _read_checked(content, name, head["files"][name], source, output.write)
        output.flush()
        os.fsync(output.fileno())


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


def _sha256(content: bytes) -> bytes:
    return hashlib.sha256(content).hexdigest().encode()
