"""Detection of JSON that no route accepts.

JSON that is not UTF-8 or nested too deeply; characters that cannot be stored or sent (NUL, lone
surrogates); integers beyond the database's range.
"""

import json
import re
import sys
from collections.abc import Iterator, Sequence
from urllib.parse import parse_qsl

import numpy as np

from app.api.validation import Member, dotted, member, shown
from app.store.cursors import MAX_INTEGER

MAX_DEPTH = 64
"""Largest depth of nested lists and objects in a body."""
_TEXT_RULE = "must hold neither NUL nor half of a surrogate pair"
_WRONG = re.compile("[\0\ud800-\udfff]")
# Only bodies with one of these are parsed a second time.
_SUSPECT = re.compile(rb"\\u(?:d[89a-f]|0000)", re.IGNORECASE)
_LONG = b"0" * len(str(MAX_INTEGER))
_AS_DIGITS = bytes(b"0"[0] if one in b"0123456789" else b" "[0] for one in range(256))
# An unterminated string ends with the body, so that matching takes linear time.
_STRING = re.compile(rb'"(?:[^"\\]++|\\.)*+(?:"|\\?\Z)', re.DOTALL)
_STEPS = bytes.maketrans(b"[{]}", b"\x01\x01\xff\xff")
_OTHERS = bytes(set(range(256)) - set(b"[{]}"))


def fault_in_json(body: bytes) -> Member | None:
    """Return field, value, rule and choices of a fault in a JSON body, or None.

    Invalid JSON is left to the parser.
    """
    if not body.isascii() or b"\0" in body:
        try:
            body.decode()
        except UnicodeDecodeError as error:
            return member("body", f"byte {error.start}", "must be text in UTF-8")
        if b"\0" in body:
            return member("body", f"byte {body.index(0)}", "must be text in UTF-8 without NUL")
    if (depth := _depth(body)) > MAX_DEPTH:
        return member("body", f"<{depth} levels>", f"must be nested at most {MAX_DEPTH} deep")
    has_long_number = _LONG in body.translate(_AS_DIGITS)
    if not has_long_number and (b"\\u" not in body or _SUSPECT.search(body) is None):
        return None
    try:
        found = json.loads(body)
    except json.JSONDecodeError:
        return None
    except ValueError:
        limit = f"must have integers of at most {sys.get_int_max_str_digits()} digits"
        return member("body", "<a longer integer>", limit)
    return next(_faults(found, ("body",)), None)


def _depth(body: bytes) -> int:
    """Return the depth of nested lists and objects in a text."""
    if body.count(b"[") + body.count(b"{") <= MAX_DEPTH:
        return 0
    steps = _STRING.sub(b"", body).translate(_STEPS, _OTHERS)
    return int(np.frombuffer(steps, dtype=np.int8).cumsum(dtype=np.int64).max(initial=0))


def _faults(value: object, place: Sequence[str | int]) -> Iterator[Member]:
    """Yield the faults of texts and integers in a JSON value."""
    if isinstance(value, str):
        if _WRONG.search(value):
            yield member(_field(place), shown(value), _TEXT_RULE)
    elif isinstance(value, dict):
        for name, inner in value.items():
            if _WRONG.search(name):
                yield member(_field((*place, name)), shown(name), f"the name {_TEXT_RULE}")
            yield from _faults(inner, (*place, name))
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from _faults(inner, (*place, index))
    elif isinstance(value, int) and not -MAX_INTEGER - 1 <= value <= MAX_INTEGER:
        rule = f"must lie in [{-MAX_INTEGER - 1}, {MAX_INTEGER}]"
        yield member(_field(place), shown(value), rule)


def _field(place: Sequence[str | int]) -> str:
    return dotted(place).encode("utf-8", "backslashreplace").decode()


def fault_in_address(path: str, query: bytes) -> Member | None:
    """Return field, value, rule and choices of a fault in a decoded path or encoded query."""
    if _WRONG.search(path):
        return member("path", shown(path), _TEXT_RULE)
    if b"%00" in query or b"\0" in query:
        for name, value in parse_qsl(query.decode("latin-1"), keep_blank_values=True):
            if _WRONG.search(name + value):
                return member(shown(name).strip("'"), shown(value), _TEXT_RULE)
    return None
