"""The commands ``backup`` and ``restore``."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.options import Json, prepared_settings
from app.cli.output import print_result

if TYPE_CHECKING:
    from app.store.database.backup import BackupSummary

File = Annotated[Path, typer.Argument(help="File of the backup.", show_default=False)]


def backup(file: File, as_json: Json = False) -> None:
    """Copy the database and the files of the jobs into one file; the server may run."""
    settings = prepared_settings()
    from app.store.database.backup import write_backup
    from app.store.engine import Store

    store = Store(settings.database)
    try:
        found = write_backup(store, settings.data, file)
    finally:
        store.close()
    print_result(f"{_text(found)}\nwritten to {file}", _data(found), as_json=as_json)


def restore(file: File, as_json: Json = False) -> None:
    """Replace the database by that of a backup; the server must be stopped."""
    settings = prepared_settings()
    from app.store.database.backup import restore_backup
    from app.store.engine import Store

    settings.data.mkdir(parents=True, exist_ok=True)
    store = Store(settings.database)
    try:
        found, kept = restore_backup(store, settings.data, file)
    finally:
        store.close()
    text = f"{_text(found)}\nrestored to {store.shown_url}"
    if kept is not None:
        text += f"\nprevious database kept as {kept}"
    data = {**_data(found), "kept": None if kept is None else str(kept)}
    print_result(text, data, as_json=as_json)


def _text(found: "BackupSummary") -> str:
    rows = found.rows
    return (
        f"backup of {found.created_at}: {rows.get('jobs', 0)} jobs, "
        f"{rows.get('checkpoints', 0)} checkpoints, {rows.get('cells', 0)} cells, "
        f"{rows.get('recordings', 0)} recordings, {found.n_files} files, "
        f"{found.size / 1e6:.1f} MB"
    )


def _data(found: "BackupSummary") -> dict[str, Any]:
    return {"ok": True, **asdict(found), "path": str(found.path)}
