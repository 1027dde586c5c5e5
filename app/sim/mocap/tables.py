"""Tables of joint angles as other programs write them: columns by name, missing values found.

Case, punctuation and a unit in brackets do not count in the names of columns. Where names are
foreign, a *name map* says which column is which: theirs to ours.
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
from app.sim.mocap.bvh import MAX_FAULTS, MAX_FRAMES, MAX_NUMBER, shown

PADDING = ',;|\t "'
"""Separators, quotes and blanks, which hold nothing."""
MAX_COLUMNS = 400
"""Most columns of a table."""
MAX_NAME = 200
"""Characters of a name that count."""
MIN_LIKENESS = 0.6
"""Two names are nearly the same from this ratio of ``difflib`` on."""
MAX_OTHERS = 12
"""Most columns that a hint lists which are not known at all."""
MAX_PAIRS = 6
"""Most pairs of nearly known names that a hint lists."""

MISSING = frozenset(
    ("", "-", "--", "–", "—", ".", "?", "nan", "na", "n/a", "null", "none", "missing")
    + ("#n/a", "#na", "#value!", "#div/0!", "#num!", "#null!", "#ref!")
)
"""What programs write where a value is missing, in lower case."""

_THOUSANDS = re.compile(r"[+-]?\d{1,3}([.,'’\s]\d{3})+([.,]\d+)?|[+-]?\d+[.,]\d+[.,]\d+")
_UNIT = re.compile(r"\s*[(\[{][^)\]}]*[)\]}]\s*$")


@dataclass(frozen=True, slots=True, kw_only=True)
class TextTable:
    """A table as text: its columns are known by name, its values not read yet."""

    names: tuple[str, ...]
    """Names of the columns as in the file."""
    labels: tuple[str, ...]
    """The same without what surrounds a name, such as a path; empty: never read."""
    line: int
    """Line of the names."""
    rows: Sequence[tuple[int, str]]
    """Line numbers and texts."""
    split: Callable[[str, int], list[str]]
    """Splits a row into cells, at so many places at most."""
    decimal: str = "."
    """Decimal sign, a point or a comma."""

    def __post_init__(self) -> None:
        """Refuse a table that is too long."""
        if len(self.rows) > MAX_FRAMES:
            rule = f"must be at most {MAX_FRAMES}"
            raise bad("frames", f"<{len(self.rows)} frames>", rule, "cut the file into parts")

    def columns(self, ours: Iterable[str], names: Mapping[str, str]) -> dict[str, int]:
        """Return the index of each column that is there, by our name.

        Args:
            ours: Names that are looked for.
            names: Name map, theirs to ours; goes before what the names say.

        Raises:
            BadRecording: The map names a column that is not there, or what is none of ours; or
                a name is there twice.
        """
        ours = list(ours)
        check_map(names, ours)
        keys = [plain(label) for label in self.labels]
        found = {own: self._mapped(theirs, keys) for theirs, own in names.items()}
        taken = set(found.values())
        for own in ours:
            here = [k for k, key in enumerate(keys) if key == plain(own) and k not in taken]
            if own in found or not here:
                continue
            if len(here) > 1:
                raise bad(f"line {self.line}", shown(own), "is the name of two columns")
            found[own] = here[0]
        return found

    def values(self, columns: Mapping[str, int]) -> dict[str, Vec]:
        """Return the values of some columns, each of shape (n,); missing ones are NaN.

        Args:
            columns: Indices by our name, at least two.

        Raises:
            BadRecording: A row has too few or too many cells, or a cell is no number.
        """
        found = np.empty((len(self.rows), len(columns)))
        pick = itemgetter(*columns.values())
        faults: list[Fault] = []
        for k, (line, text) in enumerate(self.rows):
            cells = self._cells(text)
            if cells is None:
                faults.append(self._wrong_count(line, text))
            else:
                chosen = pick(cells)
                found[k] = self._numbers(chosen, text)
                if not (np.abs(found[k]) <= MAX_NUMBER).all():
                    faults.extend(self._bad_cells(line, columns, chosen))
            if len(faults) >= MAX_FAULTS:
                break
        if faults:
            raise BadRecording(faults[:MAX_FAULTS])
        return dict(zip(columns, found.T, strict=True))

    def foreign(self, columns: Mapping[str, int]) -> dict[str, str]:
        """Return the names in the file, by our name, that are not ours themselves.

        Args:
            columns: Indices by our name.
        """
        names = {own: self.names[k][:MAX_NAME] for own, k in columns.items()}
        return {own: theirs for own, theirs in names.items() if theirs != own}

    def near(self, missing: Iterable[str], columns: Mapping[str, int]) -> str:
        """Return a hint that pairs names that are missing with nearly known columns.

        Args:
            missing: Our names.
            columns: Indices of the columns that are known, by our name.
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
        raise no_such_name(theirs, [one for one in self.labels if one], "column")

    def _cells(self, text: str) -> list[str] | None:
        """Return the cells of a row, or None where there are too few or too many."""
        cells = self.split(text, len(self.names))
        beyond = cells[len(self.names) :]
        del cells[len(self.names) :]
        is_padded = not any(cell.strip(PADDING) for cell in beyond)
        return cells if is_padded and len(cells) == len(self.names) else None

    def _numbers(self, cells: Sequence[str], text: str) -> list[float]:
        """Return numbers; NaN stands for what is missing, and infinity for what is none."""
        if self.decimal == "." or "." not in text:
            try:
                return [float(one) for one in self._pointed(cells)]
            except ValueError:
                pass
        return [number(one, self.decimal) for one in cells]

    def _pointed(self, cells: Sequence[str]) -> Sequence[str]:
        return cells if self.decimal == "." else [one.replace(",", ".") for one in cells]

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
            if np.isnan(value) or abs(value) <= MAX_NUMBER:
                continue
            rule, hint = "must be a number", ""
            if _number(cell) is not None:
                rule = f"must be a finite number of at most {digits(MAX_NUMBER)}"
            if _THOUSANDS.fullmatch(cell.strip()[:MAX_NAME]) or (
                self.decimal == "," and "." in cell
            ):
                hint = "write numbers without thousands separators, all with one decimal sign"
            place = f"line {line}, column {name}"
            yield Fault(place=place, value=shown(cell.strip()), rule=rule, hint=hint)


def named_columns(cells: Sequence[str], line: int) -> tuple[str, ...]:
    """Return the names of columns, without the empty ones behind the last.

    Raises:
        BadRecording: There are too many.
    """
    last = max((k for k, cell in enumerate(cells) if cell.strip()), default=-1)
    if last >= MAX_COLUMNS:
        raise bad(f"line {line}", "", f"must have at most {MAX_COLUMNS} columns")
    return tuple(cell.strip().strip("'").strip() for cell in cells[: last + 1])


def plain(name: str) -> str:
    """Return a name without case, punctuation and a unit in brackets."""
    return re.sub(r"[\W_]", "", _UNIT.sub("", name[:MAX_NAME]).lower())


def near_names(missing: Iterable[str], there: Iterable[str]) -> list[tuple[str, str]]:
    """Return pairs of theirs and ours that are nearly the same, each name at most once.

    Args:
        missing: Our names.
        there: Theirs.
    """
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
    """Refuse a name map that names what is none of ours.

    Args:
        names: Theirs to ours.
        ours: The choices.

    Raises:
        BadRecording: It does; the hint lists the choices.
    """
    for theirs, own in names.items():
        if own not in ours:
            hint = f"choices: {', '.join(ours)}"
            raise bad("name map", shown(f"{theirs}={own}"), "must end with one of ours", hint)


def no_such_name(theirs: str, there: Sequence[str], what: str) -> BadRecording:
    """Return the fault that a name map names what the file does not have.

    Args:
        theirs: The name.
        there: Those that the file has.
        what: What it is the name of, ``"column"``.
    """
    likeness = {one: _likeness(theirs, one) for one in there}
    near = sorted(likeness, key=likeness.__getitem__, reverse=True)
    close = [one for one in near if likeness[one] >= MIN_LIKENESS]
    said = "nearly the same" if close else f"the file's {what}s"
    hint = f"{said}: {', '.join((close[:3] or list(there))[:40])[:300]}"
    return bad("name map", shown(theirs), f"is the name of no {what}, or of several", hint)


def number(cell: str, decimal: str = ".") -> float:
    """Return a cell's number; NaN where it is missing, infinity where it is no number.

    Args:
        cell: Its text.
        decimal: Decimal sign of the table.
    """
    word = cell.strip().replace("\u2212", "-")
    if word.lower() in MISSING:
        return np.nan
    if decimal == ",":
        word = "" if "." in word else word.replace(",", ".")
    value = _number(word)
    return np.inf if value is None else value


def complete_rows(columns: Mapping[str, Vec], place: str) -> NDArray[np.bool_]:
    """Return which rows have all values, shape (n,).

    Args:
        columns: Values by name, each of shape (n,), missing ones NaN.
        place: Where the table stands, for the message.

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
        raise bad(place, value, rule, "one frame is no motion")
    return np.asarray(good)


def missing_values(columns: Mapping[str, Vec], good: NDArray[np.bool_]) -> tuple[Artifact, ...]:
    """Return the runs of rows that lack a value, with the columns that lack it.

    Args:
        columns: Values by name, each of shape (n,), missing ones NaN.
        good: Which rows have all values, shape (n,).
    """
    rows = np.flatnonzero(~good)
    found = []
    for group in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if rows.size else ():
        parts = tuple(name for name, one in columns.items() if np.isnan(one[group]).any())
        also = f" and {len(parts) - 3} more" if len(parts) > 3 else ""
        reason = f"no value of {', '.join(parts[:3])}{also}"
        first, last = int(group[0]), int(group[-1])
        found.append(Artifact(first=first, last=last, parts=parts, speed=0.0, reason=reason))
    return tuple(found)


def bad(place: str, value: str, rule: str, hint: str = "") -> BadRecording:
    """Return the error of one fault."""
    return BadRecording([Fault(place=place, value=value, rule=rule, hint=hint)])


def _likeness(one: str, other: str) -> float:
    return SequenceMatcher(None, plain(one), plain(other)).ratio()


def _number(word: str) -> float | None:
    try:
        return float(word)
    except ValueError:
        return None


def _side(name: str) -> str:
    """Return ``"r"`` or ``"l"`` of a name that tells its side, and nothing of another."""
    words = re.split(r"[\W_]+", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name[:MAX_NAME]).lower())
    for letter, word in (("r", "right"), ("l", "left")):
        if letter in words or any(one.startswith(word) or one.endswith(word) for one in words):
            return letter
    return ""
