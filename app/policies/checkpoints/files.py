"""Checkpoints as files: tensors in ``NAME.safetensors``, the manifest in ``NAME.json``.

A reader gets both of one checkpoint, also beside a writer or after an interruption. A writer
stores both under names with ``.next``, then renames the tensors, then the manifest: a next
manifest without next tensors is that of the present tensors.
"""

import json
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from app.durable_files import sync_folder, write_durably
from app.policies.checkpoints.checkpoint import TensorFile

Content = TypeVar("Content")


def write_files(path: Path, checkpoint: TensorFile) -> None:
    """Replace a checkpoint, which has no other writer.

    Args:
        path: File of its tensors.

    Raises:
        StorageFull: No room is left; the present checkpoint stays.
    """
    _finish(path)
    write_durably(_next(path), checkpoint.tensors)
    manifest = json.dumps(checkpoint.manifest, indent=1)
    write_durably(_next(path.with_suffix(".json")), manifest.encode())
    _next(path).replace(path)
    _finish(path)


def read_files(path: Path, read: Callable[[Path], Content]) -> Content:
    """Return what ``read`` makes of the files of one checkpoint.

    Args:
        path: File of its tensors.
        read: Reads them and the manifest, whose path it gets; called again where a writer has
            replaced a file meanwhile.
    """
    while True:
        before = _version(path)
        try:
            content = read(_manifest_of(path))
        except Exception:
            if _version(path) == before:
                raise
        else:
            if _version(path) == before:
                return content


def _finish(path: Path) -> None:
    """Rename the manifest of an interrupted writer, if it has renamed the tensors."""
    manifest = path.with_suffix(".json")
    if _manifest_of(path) != manifest:
        sync_folder(path.parent)  # the new name of the tensors first
        _next(manifest).replace(manifest)


def _manifest_of(path: Path) -> Path:
    """Return the path of the manifest of the present tensors."""
    manifest = path.with_suffix(".json")
    is_renamed = _next(manifest).exists() and not _next(path).exists()
    return _next(manifest) if is_renamed else manifest


def _next(path: Path) -> Path:
    return path.with_name(f"{path.name}.next")


def _version(path: Path) -> list[tuple[int, int] | None]:
    """Return what differs after a file of a checkpoint was replaced."""
    present = (path, path.with_suffix(".json"))
    return [_identity(one) for one in (*present, *map(_next, present))]


def _identity(path: Path) -> tuple[int, int] | None:
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns
