"""Printing of results, as text or as one JSON object."""

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import typer

from app.durable_files import write_durably
from app.errors import BadCell, BadRecording, InvalidInput

UNITS = ("_s", "_m", "_rad")
"""Ends of the names of means of quantities with a unit."""
COUNTS = frozenset(
    {"attempts_over_expected", "moves_over_minimum", "parts_per_hour"}
    | {"contacts_at_rest", "grasps", "late_motions", "moving_contacts"}
)
"""Names of means of counts, and of ratios that are not shares; all other means are rates."""


def print_result(text: str, data: Mapping[str, Any], *, as_json: bool) -> None:
    """Print a result for people or as JSON."""
    print(json.dumps(data) if as_json else text)


def write_output(path: Path, content: bytes) -> None:
    """Write the file of the option ``--output``, in a folder that exists.

    A file is replaced as a whole; content also goes to devices and pipes.

    Raises:
        InvalidInput: It cannot be written.
        StorageFull: No room is left; the present file stays.
    """
    try:
        if path.exists() and not path.is_file():
            path.write_bytes(content)
        else:
            target = path.resolve()
            target.parent.stat()
            write_durably(target, content)
    except OSError as error:
        rule = f"cannot be written: {error.strerror}"
        raise InvalidInput("--output", str(path), rule) from error


@contextmanager
def every_fault_printed(prefix: str, *, as_json: bool) -> Iterator[None]:
    """End the command with status 2 where a file has faults, each printed on a line.

    Args:
        prefix: Text before each fault, such as ``"cell.json: "``.
        as_json: Whether the faults are printed as one JSON object, too.
    """
    try:
        yield
    except (BadCell, BadRecording) as error:
        for fault in error.faults:
            print(f"{prefix}{fault.text}", file=sys.stderr)
        if as_json:
            print(json.dumps({"ok": False, "faults": [asdict(one) for one in error.faults]}))
        raise typer.Exit(2) from error


def table(result: Mapping[str, Any]) -> str:
    """Return the result of an evaluation as a table of its rows, without nested lists."""
    rows: Sequence[Mapping[str, Any]] = result["results"]
    columns = list(
        dict.fromkeys(key for row in rows for key in row if not isinstance(row[key], list))
    )
    lines = [columns, *([_cell(key, row.get(key)) for key in columns] for row in rows)]
    widths = [max(len(line[k]) for line in lines) for k in range(len(columns))]
    texts = [
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    ]
    head = f"{result['protocol']}, seed {result['seed']}, {result['episodes']} episodes"
    tested = [f"checkpoint {result['checkpoint']}"] if "checkpoint" in result else []
    return "\n".join([head, *tested, "", *texts])


def _cell(name: str, value: Any) -> str:
    """Return a value as text: a mean with its interval, a number, or the text.

    Args:
        name: Key of the value; the mean is a rate, in percent, unless it names a quantity.
    """
    if isinstance(value, Mapping) and {"mean", "low", "high"} <= value.keys():
        ends = (value[key] for key in ("mean", "low", "high"))
        if name in COUNTS or name.endswith(UNITS):
            return "{:.3g} [{:.3g}, {:.3g}]".format(*ends)
        return "{:.1f} % [{:.1f}, {:.1f}]".format(*(100.0 * one for one in ends))
    if isinstance(value, Mapping):
        known = ((key, one) for key, one in value.items() if one is not None)
        return ", ".join(f"{key} {_cell(key, one)}" for key, one in known)
    if isinstance(value, list):
        return " to ".join("any" if one is None else _cell(name, one) for one in value)
    if isinstance(value, float):
        return f"{value:.3g}"
    return "" if value is None else str(value)
