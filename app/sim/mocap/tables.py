"""Tables of joint angles of other programs, with columns by name and missing values.

Names of columns are compared without case, punctuation and a unit in brackets. A *name map*
assigns other names of a file to the names of this project.
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from app.errors import BadRecording, Fault, digits
from app.sim.core.arrays import Vec
from app.sim.mocap.artifacts import Artifact
from app.sim.mocap.bvh import MAX_FRAMES, MAX_NUMBER, as_number
from app.sim.mocap.faults import MAX_FAULTS, bad, shown

PADDING = ',;|\t "'
"""Separators, quotes and blanks."""
MAX_COLUMNS = 400
"""Largest number of columns."""
MAX_NAME = 200
"""Number of characters of a name that are compared."""
MIN_LIKENESS = 0.6
"""Least ``difflib`` ratio of similar names."""
MAX_OTHERS = 12
"""Largest number of unknown columns in a hint."""
MAX_PAIRS = 6
"""Largest number of pairs of similar names in a hint."""

MAX_STAMP = 1e19
"""Largest number in a column of times: nanoseconds since 1970, whose unit is then named."""

MISSING = frozenset(
    ("", "-", "--", "–", "—", ".", "?", "nan", "na", "n/a", "null", "none", "missing")
    + ("#n/a", "#na", "#value!", "#div/0!", "#num!", "#null!", "#ref!")
)
"""Markers of missing values, in lower case."""

_THOUSANDS = re.compile(r"[+-]?\d{1,3}([.,'’_\s]\d{3})+([.,]\d+)?|[+-]?\d+[.,]\d+[.,]\d+")
_UNIT = re.compile(r"\s*[(\[{][^)\]}]*[)\]}]\s*$")


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """A table as text, with the names of its columns."""

    names: tuple[str, ...]
    """Names of the columns in the file."""
    labels: tuple[str, ...]
    """The same without path; empty for columns that are ignored."""
    line: int
    """Line number of the names."""
    rows: Sequence[tuple[int, str]]
    """Line numbers and texts of the rows."""
    split: Callable[[str, int], list[str]]
    """Function of a row and a largest number of splits that returns its cells."""
    decimal: str = "."
    """Decimal sign, a point or a comma."""

    def __post_init__(self) -> None:
        if len(self.rows) > MAX_FRAMES:
            rule = f"must be at most {MAX_FRAMES}"
            raise bad("frames", f"<{len(self.rows)} frames>", rule, "cut the file into parts")

    def columns(self, ours: Iterable[str], names: Mapping[str, str]) -> dict[str, int]:
        """Return the index of each column that exists, by our name.

        Args:
            ours: Names of the project.
            names: Name map, theirs to ours; takes precedence over equal names.

        Raises:
            BadRecording: The map names a column that does not exist or a name outside ``ours``,
                or a name occurs twice.
        """
        ours = list(ours)
        check_map(names, ours)
        keys = [plain(label) for label in self.labels]
        found = {own: self._mapped(theirs, keys) for theirs, own in names.items()}
        taken = set(found.values())
        if len(taken) < len(found):
            raise bad("map", shown(str(dict(names))), "must map each column once")
        for own in ours:
            here = [k for k, key in enumerate(keys) if key == plain(own) and k not in taken]
            if own in found or not here:
                continue
            if len(here) > 1:
                raise bad(f"line {self.line}", shown(own), "is the name of two columns")
            found[own] = here[0]
        return found

    def values(self, columns: Mapping[str, int]) -> dict[str, Vec]:
        """Return the values of at least two columns, each of shape (n,); missing ones are NaN.

        Raises:
            BadRecording: A row has a wrong number of cells, or a cell is not a number.
        """
        found = np.empty((len(self.rows), len(columns)))
        most = np.array([_most(name) for name in columns])
        pick = itemgetter(*columns.values())
        faults: list[Fault] = []
        for k, (line, text) in enumerate(self.rows):
            cells = self._cells(text)
            if cells is None:
                faults.append(self._wrong_count(line, text))
            else:
                chosen = pick(cells)
                found[k] = self._numbers(chosen, text)
                if not (np.abs(found[k]) <= most).all():
                    faults.extend(self._bad_cells(line, columns, chosen))
            if len(faults) >= MAX_FAULTS:
                break
        if faults:
            raise BadRecording(faults[:MAX_FAULTS])
        return dict(zip(columns, found.T, strict=True))

    def foreign(self, columns: Mapping[str, int]) -> dict[str, str]:
        """Return the names in the file that differ from ours, by our name."""
        names = {own: self.names[k][:MAX_NAME] for own, k in columns.items()}
        return {own: theirs for own, theirs in names.items() if theirs != own}

    def near(self, missing: Iterable[str], columns: Mapping[str, int]) -> str:
        """Return a hint that pairs missing names with columns of similar names.

        Args:
            missing: Our names without a column.
            columns: Indices of the known columns, by our name.
        """
        known = set(columns.values())
        free = [name for k, name in enumerate(self.labels) if name and k not in known]
        pairs = near_names(missing, [name for name in free if len(name) <= MAX_NAME])
        if not pairs and free:
            others = ", ".join(free[:MAX_OTHERS])[:300]
            return f"other columns: {others}; a name map says what they are: theirs=ours"
        if not pairs:
            return ""
        listed = ", ".join(f"{theirs}={own}" for theirs, own in pairs[:MAX_PAIRS])
        more = f" and {len(pairs) - MAX_PAIRS} more" if len(pairs) > MAX_PAIRS else ""
        return f"nearly known; if it is meant, give the name map {listed}{more}"

    def _mapped(self, theirs: str, keys: Sequence[str]) -> int:
        for said in (self.names, self.labels):
            if said.count(theirs) == 1:
                return said.index(theirs)
        if keys.count(plain(theirs)) == 1 and plain(theirs):
            return keys.index(plain(theirs))
        raise no_such_name(theirs, [one for one in self.labels if one])

    def _cells(self, text: str) -> list[str] | None:
        """Return the cells of a row; None if their number is wrong."""
        cells = self.split(text, len(self.names))
        beyond = cells[len(self.names) :]
        del cells[len(self.names) :]
        is_padded = not any(cell.strip(PADDING) for cell in beyond)
        return cells if is_padded and len(cells) == len(self.names) else None

    def _numbers(self, cells: Sequence[str], text: str) -> list[float]:
        """Return numbers; NaN for missing values, infinity for text."""
        if (self.decimal == "." or "." not in text) and "_" not in text:
            is_pointed = self.decimal == "."
            try:
                return [float(one if is_pointed else one.replace(",", ".")) for one in cells]
            except ValueError:
                pass
        return [number(one, self.decimal) for one in cells]

    def _wrong_count(self, line: int, text: str) -> Fault:
        count = len(self.split(text, 2 * MAX_COLUMNS))
        rule = f"must hold {len(self.names)} values, one per column"
        hint = ""
        if count == len(self.names) + 1:
            hint = "a column without a name? the line of names needs an empty one for it"
        elif count > len(self.names) and self.split("0,0", 1) == ["0", "0"]:
            hint = "decimal commas? write points, or separate the columns by semicolons"
        return Fault(place=f"line {line}", value=f"<{count}>", rule=rule, hint=hint)

    def _bad_cells(
        self, line: int, columns: Mapping[str, int], cells: Sequence[str]
    ) -> Iterable[Fault]:
        for name, cell in zip(columns, cells, strict=True):
            value = number(cell, self.decimal)
            if np.isnan(value) or abs(value) <= _most(name):
                continue
            rule, hint = "must be a number", ""
            if as_number(cell.replace(self.decimal, ".")) is not None:
                rule = f"must be a finite number of at most {digits(_most(name))}"
            if _THOUSANDS.fullmatch(cell.strip()[:MAX_NAME]) or (
                self.decimal == "," and "." in cell
            ):
                hint = "write numbers without thousands separators, all with one decimal sign"
            place = f"line {line}, column {name}"
            yield Fault(place=place, value=shown(cell.strip()), rule=rule, hint=hint)


def named_columns(cells: Sequence[str], line: int) -> tuple[str, ...]:
    """Return the names of columns, without empty ones at the end.

    Raises:
        BadRecording: The number of columns exceeds MAX_COLUMNS.
    """
    last = max((k for k, cell in enumerate(cells) if cell.strip()), default=-1)
    if last >= MAX_COLUMNS:
        raise bad(f"line {line}", "", f"must have at most {MAX_COLUMNS} columns")
    return tuple(cell.strip().strip("'").strip() for cell in cells[: last + 1])


def plain(name: str) -> str:
    """Return a name in lower case without punctuation and unit in brackets."""
    return re.sub(r"[\W_]", "", _UNIT.sub("", name[:MAX_NAME]).lower())


def near_names(missing: Iterable[str], there: Iterable[str]) -> list[tuple[str, str]]:
    """Return pairs of similar names, theirs and ours, each name at most once."""
    there = list(there)
    likeness = sorted(
        (
            (_likeness(theirs, own), theirs, own)
            for own in missing
            for theirs in there
            if _side(theirs) == _side(own)
        ),
        key=itemgetter(0),
        reverse=True,
    )
    pairs: dict[str, str] = {}
    for ratio, theirs, own in likeness:
        if ratio >= MIN_LIKENESS and theirs not in pairs and own not in pairs.values():
            pairs[theirs] = own
    return list(pairs.items())


def check_map(names: Mapping[str, str], ours: Sequence[str]) -> None:
    """Raise BadRecording if a name map, theirs to ours, maps to a name outside ``ours``."""
    for theirs, own in names.items():
        if own not in ours:
            hint = f"choices: {', '.join(ours)}"
            raise bad("map", shown(f"{theirs}={own}"), "must end with one of ours", hint)


def no_such_name(theirs: str, there: Sequence[str]) -> BadRecording:
    """Return the error of a name map with a column that is not among those of the file."""
    likeness = {one: _likeness(theirs, one) for one in there}
    near = sorted(likeness, key=likeness.__getitem__, reverse=True)
    close = [one for one in near if likeness[one] >= MIN_LIKENESS]
    said = "nearly the same" if close else "the file's columns"
    hint = f"{said}: {', '.join((close[:3] or list(there))[:40])[:300]}"
    return bad("map", shown(theirs), "is the name of no column, or of several", hint)


def number(cell: str, decimal: str = ".") -> float:
    """Return the number in a cell; NaN if it is missing, infinity for text."""
    word = cell.strip().replace("\u2212", "-")
    if word.lower() in MISSING:
        return np.nan
    if decimal == ",":
        word = "" if "." in word else word.replace(",", ".")
    value = as_number(word)
    return np.inf if value is None else value


def complete_rows(
    columns: Mapping[str, Vec],
) -> tuple[dict[str, Vec], NDArray[np.bool_], tuple[Artifact, ...]]:
    """Return columns without incomplete rows, which rows are complete, and the others.

    Args:
        columns: Values by name, each of shape (n,), missing ones NaN.

    Returns:
        Values by name, each of shape (n_complete,); whether each row has all values, shape
        (n,); and the runs of incomplete rows, with their columns without a value.

    Raises:
        BadRecording: A column has no value, or fewer than two rows are complete.
    """
    empty = [name for name, column in columns.items() if np.isnan(column).all()]
    if empty and len(columns[empty[0]]):
        raise bad(f"column {empty[0]}", "", "has no value in any row")
    good = ~np.isnan(np.column_stack(list(columns.values()))).any(axis=1)
    if good.sum() < 2:
        value = f"<{int(good.sum())}>"
        rule = "must be at least 2 that have all values"
        raise bad("frames", value, rule, "one frame is not a motion")
    rows = np.flatnonzero(~good)
    missing = []
    for group in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if rows.size else ():
        parts = tuple(name for name, one in columns.items() if np.isnan(one[group]).any())
        also = f" and {len(parts) - 3} more" if len(parts) > 3 else ""
        reason = f"no value of {', '.join(parts[:3])}{also}"
        first, last = int(group[0]), int(group[-1])
        missing.append(Artifact(first=first, last=last, parts=parts, speed=0.0, reason=reason))
    sound = {name: column[good] for name, column in columns.items()}
    return sound, np.asarray(good), tuple(missing)


def _most(name: str) -> float:
    """Return the largest number of a column, by our name."""
    return MAX_STAMP if name == "time" else MAX_NUMBER


def _likeness(one: str, other: str) -> float:
    return SequenceMatcher(None, plain(one), plain(other)).ratio()


def _side(name: str) -> str:
    """Return the side in a name, ``"r"`` or ``"l"``; empty without a side."""
    words = re.split(r"[\W_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name[:MAX_NAME]).lower())
    for letter, word in (("r", "right"), ("l", "left")):
        if letter in words or any(one.startswith(word) or one.endswith(word) for one in words):
            return letter
    return ""
