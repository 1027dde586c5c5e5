"""Reader of CSV text of spreadsheets and statistics programs.

The separator is the one that yields most known names of columns. ``csv.Sniffer``, which uses
the rows instead, confuses decimal commas with separators. Source: RFC 4180; spreadsheets
deviate from it by ``;`` and tabs, decimal commas, padding and a line ``sep=;``.
"""

import csv
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from app.sim.mocap.bvh import lines_of
from app.sim.mocap.faults import bad, shown
from app.sim.mocap.tables import MAX_COLUMNS, MISSING, PADDING, TextTable, named_columns, plain

SEPARATORS = (",", ";", "\t", "|")
"""Separators of columns; white space if a file has none of them."""
INDEX_NAMES = frozenset(("index", "idx", "frame", "frameno", "framenumber", "row", "nr", "no"))
"""Plain names of columns with row numbers, which are ignored."""

_ERRORS = tuple(word for word in MISSING if word.startswith("#"))
"""Error values of spreadsheets, which begin like a comment."""

_NUMBER = re.compile(r"\s*[+-]?[\d.,'\s]*\d(?:[eE][+-]?\d+)?\s*")
"""A number with either decimal sign, and with any thousands separators."""

DECLARED = ("angles", "rate_hz")
"""Declarations that are read."""

Split = Callable[[str, int], list[str]]
"""Function of a line and a largest number of splits that returns the cells."""
Lines = list[tuple[int, str]]
"""Line numbers and texts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CsvText:
    """Declarations and table of a CSV file."""

    declared: Mapping[str, str]
    """Declarations in comments, ``# key = value``, in lower case."""
    table: TextTable
    """Columns and rows, without the row of units."""
    units: Mapping[int, str]
    """Unit of a column, by index, stated in its name or in a row of units."""


def read_csv_text(text: str, known: Sequence[str]) -> CsvText:
    """Return the declarations and the table of a CSV file.

    Args:
        known: Names of columns that identify the line of names and the separator.

    Raises:
        BadRecording: The file has no table.
    """
    comments, table = _lines(text)
    if not table:
        raise bad("file", "", "holds no table")
    keys = frozenset(plain(name) for name in known)
    head, rows = table[0], table[1:]
    if not _splitter(head[1], keys)[1]:  # numpy.savetxt writes the names as a comment
        named = [one for one in comments if _splitter(one[1].lstrip("# "), keys)[1] > 2]
        head, rows = (named[-1], table) if named else (head, rows)
    header = head[1].lstrip("# ").rstrip(",;|\t ")
    split, _ = _splitter(header, keys)
    names = named_columns(split(header, MAX_COLUMNS), head[0])
    units = {k: unit for k, name in enumerate(names) if (unit := _bracketed(name))}
    if rows and (below := _units_row(split(rows[0][1], len(names)))):
        units, rows = {**units, **below}, rows[1:]
    return CsvText(
        declared=_declared(comments),
        table=TextTable(
            names=names,
            labels=tuple("" if _is_index(name) else name for name in names),
            line=head[0],
            rows=rows,
            split=split,
            decimal=_decimal(split(line, len(names)) for _, line in rows),
        ),
        units=units,
    )


def _lines(text: str) -> tuple[Lines, Lines]:
    """Return comments and table, without empty lines around the table."""
    lines = [(k, line) for k, line in enumerate(lines_of(text), 1) if line.strip()]
    comments = [one for one in lines if _is_comment(one[1])]
    table = [one for one in lines if not _is_comment(one[1])]
    held = [k for k, (_, line) in enumerate(table) if line.strip(PADDING)]
    if held and table[held[0]][1].strip(PADDING).startswith("sep="):
        del held[0]
    return comments, table[held[0] : held[-1] + 1] if held else []


def _is_comment(line: str) -> bool:
    start = line.lstrip(PADDING)[:10].lower()
    return start.startswith("#") and not start.startswith(_ERRORS)


def _splitter(line: str, keys: frozenset[str]) -> tuple[Split, int]:
    """Return the function that splits lines at the separator and removes quotes.

    Also return the number of known names in the line.
    """

    def score(split: Split) -> tuple[int, int]:
        cells = split(line, MAX_COLUMNS)
        return sum(plain(cell) in keys for cell in cells), len(cells)

    best = max(map(_split_at, SEPARATORS), key=score)
    if score(best)[1] == 1 and len(line.split(None, 2)) > 2:
        best = _split_at(None)
    return best, score(best)[0]


def _split_at(separator: str | None) -> Split:
    def split(line: str, most: int) -> list[str]:
        if '"' not in line or separator is None:
            return line.split(separator, most)
        try:
            return next(csv.reader([line], delimiter=separator, skipinitialspace=True))
        except csv.Error:  # a cell of more than 128 kB
            return line.split(separator, most)

    return split


def _declared(comments: Lines) -> dict[str, str]:
    """Return the declarations in comments.

    Raises:
        BadRecording: Two comments declare different angles or rates.
    """
    found: dict[str, str] = {}
    for number, line in comments:
        sides = line.replace(":", "=").strip(PADDING).lstrip("# ").partition("=")
        key, _, value = (side.strip(PADDING).lower() for side in sides)
        if found.setdefault(key, value) != value and key in DECLARED:
            rule = f"must be {found[key][:40]}, as {key} is declared before"
            raise bad(f"line {number}, {key}", shown(value), rule)
    return found


def _is_index(name: str) -> bool:
    return not plain(name) or plain(name) in INDEX_NAMES or name.startswith("Unnamed:")


def _bracketed(name: str) -> str:
    """Return the unit in brackets after a column's name."""
    found = re.search(r"[(\[{]([^)\]}]{1,20})[)\]}]\s*$", name[-30:])
    return found.group(1).strip().lower() if found else ""


def _units_row(cells: Sequence[str]) -> dict[int, str]:
    """Return the units in a row; none if it holds numbers or is empty."""
    words = {k: cell.strip().strip("()[]{}").lower() for k, cell in enumerate(cells)}
    stated = {k: word for k, word in words.items() if word not in MISSING}
    sound = all(re.fullmatch("[a-z°/^]{1,10}", one) for one in stated.values())
    return stated if sound else {}


def _decimal(rows: Iterable[Sequence[str]]) -> str:
    """Return the decimal sign of a table: the last sign of its first non-integer number."""
    for cells in rows:
        for cell in cells:
            is_whole = "." not in cell and "," not in cell
            if not is_whole and _NUMBER.fullmatch(cell[:60]):
                return max(".,", key=cell.rfind)
    return "."
