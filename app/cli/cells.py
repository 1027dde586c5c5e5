"""The command group ``cells``: list, show, check, add and remove work cells."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from app.cli.options import Json, prepared_settings
from app.cli.output import every_fault_printed, print_result
from app.errors import InvalidInput

if TYPE_CHECKING:
    from app.settings import Settings
    from app.sim.cells.cell import Cell

app = typer.Typer(help="List, show, check, add or remove work cells.")
File = Annotated[Path, typer.Argument(show_default=False)]
Name = Annotated[str, typer.Argument(show_default=False)]
NOUN = "cell of your own"


@app.command("list")
def list_cells(as_json: Json = False) -> None:
    """List the shipped cells and your own."""
    settings = prepared_settings()
    from app.cli.database import has_database, opened
    from app.sim.cells.cell import cell_names, lacks_for_pick, load_cell
    from jobs.cell_catalog import CellCatalog

    cells = [load_cell(name) for name in cell_names()]
    if has_database(settings):
        with opened(settings, NOUN) as store:
            cells = CellCatalog(store).all()
    rows = [
        {
            "name": cell.name,
            "title": cell.title,
            "shipped": cell.name in cell_names(),
            "pick": lacks_for_pick(cell) is None,
        }
        for cell in cells
    ]
    text = "\n".join(f"{cell.name:20} {cell.title}" for cell in cells)
    print_result(text, {"cells": rows}, as_json=as_json)


@app.command()
def show(name: Name, as_json: Json = False) -> None:
    """Print the definition of a cell."""
    definition = named_cell(name, prepared_settings()).definition()
    print_result(json.dumps(definition, indent=2), definition, as_json=as_json)


@app.command()
def check(file: File, as_json: Json = False) -> None:
    """Check a file; print one line per fault."""
    prepared_settings()
    _print_description(_read(file, as_json), "is a valid work cell", as_json)


@app.command()
def add(file: File, as_json: Json = False) -> None:
    """Check a file and store its cell."""
    settings = prepared_settings()
    from app.cli.database import opened
    from jobs.cell_catalog import CellCatalog

    cell = _read(file, as_json)
    with opened(settings, NOUN, create=True) as store:
        new = CellCatalog(store).add(cell)
    _print_description(cell, "is stored" if new else "was stored already", as_json)


@app.command()
def remove(name: Name, as_json: Json = False) -> None:
    """Remove a cell of your own."""
    settings = prepared_settings()
    from app.cli.database import opened
    from jobs.cell_catalog import CellCatalog

    with opened(settings, NOUN) as store:
        CellCatalog(store).remove(name)
    print_result(f"{name} is removed", {"name": name, "removed": True}, as_json=as_json)


def named_cell(name: str, settings: "Settings") -> "Cell":
    """Return a shipped cell or one of the database.

    Raises:
        NotFound: No cell has that name.
    """
    from app.cli.database import has_database, opened
    from app.sim.cells.cell import cell_names, load_cell
    from jobs.cell_catalog import CellCatalog

    if name in cell_names() or not has_database(settings):
        return load_cell(name)
    with opened(settings, NOUN) as store:
        return CellCatalog(store).get(name)


def file_content(path: Path, limit: int) -> bytes:
    """Return the content of a file, at most one byte more than the limit.

    Raises:
        InvalidInput: The file cannot be read.
    """
    try:
        with path.open("rb") as file:
            return file.read(limit + 1)
    except OSError as error:
        raise InvalidInput("FILE", str(path), f"cannot be read: {error.strerror}") from error


def _read(path: Path, as_json: bool) -> "Cell":
    from app.sim.cell_validation.reader import MAX_BYTES, read_cell

    with every_fault_printed(f"{path}: ", as_json=as_json):
        return read_cell(file_content(path, MAX_BYTES))


def _print_description(cell: "Cell", verdict: str, as_json: bool) -> None:
    from app.live.factory import lacks_for_live
    from app.sim.cells.cell import lacks_for_pick, lacks_for_reach
    from app.sim.sorting.layout import lacks_for_tasks

    n_targets = 0 if cell.goal_region is None else len(cell.goal_region.targets())
    counted = (
        (len(cell.stations), "station", "stations"),
        (n_targets, "grid target", "grid targets"),
        (len(cell.obstacles), "obstacle", "obstacles"),
        (len(cell.people), "person", "people"),
    )
    parts = [f"{n} {one if n == 1 else more}" for n, one, more in counted if n]
    lacks = {
        "pick": lacks_for_pick(cell),
        "reach": lacks_for_reach(cell),
        "sorting": lacks_for_tasks(cell),
        "live": lacks_for_live(cell),
    }
    lines = [f"{cell.name} {verdict}: {', '.join(parts)}"]
    for use, lack in lacks.items():
        lines.append(f"{use}: " + ("yes" if lack is None else f"no, it {lack}"))
    data: dict[str, Any] = {
        "name": cell.name,
        "ok": True,
        "stations": list(cell.station_ids),
        "sha256": cell.sha256,
        **{f"lacks_for_{use}": lack for use, lack in lacks.items()},
    }
    print_result("\n".join(lines), data, as_json=as_json)
