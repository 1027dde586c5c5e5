"""The commands ``backup`` and ``restore``."""

from contextlib import closing
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

    with closing(Store(settings.database)) as store:
        found = write_backup(store, settings.data, file)
    print_result(f"{_text(found)}\nwritten to {file}", _data(found), as_json=as_json)


def restore(file: File, as_json: Json = False) -> None:
    """Replace the database by that of a backup; the server must be stopped."""
    settings = prepared_settings()
    from app.settings import make_data_folder
    from app.store.database.backup import restore_backup
    from app.store.engine import Store

    make_data_folder(settings)
    with closing(Store(settings.database)) as store:
        found, kept = restore_backup(store, settings.data, file)
    text = f"{_text(found)}\nrestored to {store.shown_url}"
    if kept is not None:
        text += f"\nprevious database kept as {kept}"
    data = {**_data(found), "kept": None if kept is None else str(kept)}
    print_result(text, data, as_json=as_json)


def _text(found: "BackupSummary") -> str:
    tables = ("jobs", "checkpoints", "cells", "recordings")
    rows = "".join(f"{found.rows.get(name, 0)} {name}, " for name in tables)
    return (
        f"backup of {found.created_at}: {rows}{found.n_files} files, {found.size / 1e6:.1f} MB"
    )


def _data(found: "BackupSummary") -> dict[str, Any]:
    return {"ok": True, **asdict(found), "path": str(found.path)}
