"""Damage to a SQLite database, as disks and copies make it: byte by byte."""

import sqlite3
from collections.abc import Callable
from pathlib import Path

Change = Callable[[bytes], bytes]


def flip(place: int, bit: int = 0) -> Change:
    """Return what flips one bit of a byte; a place below 0 counts from the end."""

    def change(content: bytes) -> bytes:
        changed = bytearray(content)
        changed[place] ^= 1 << bit
        return bytes(changed)

    return change


def cut(content: bytes) -> bytes:
    """Return the first half."""
    return content[: len(content) // 2]


TENSORS: dict[str, Change] = {
    "one bit of the length of the header": flip(0),
    "one bit of a tensor's name": flip(12),
    "one bit of a weight": flip(-5, 6),
    "a weight that is no number": lambda content: content[:-4] + b"\x00\x00\xc0\x7f",
    "cut": cut,
    "longer": lambda content: content + b"\x00",
    "gone": lambda _: b"",
}
JSON: dict[str, Change] = {
    "one bit of a name": flip(3),
    "a bit that leaves UTF-8": flip(3, 7),
    "cut": cut,
    "another kind of JSON": lambda _: b"[1, 2]",
    "a number that is none": lambda content: content.replace(b": 1", b": NaN"),
    "another number": lambda content: content.replace(b": 1", b": 2"),
    "gone": lambda _: b"",
}


def damage(path: Path, table: str, column: str, row: str, change: Change) -> None:
    """Change a value of one row, given by an SQL condition, whatever its type."""
    connection = sqlite3.connect(path)
    try:
        kind, content = connection.execute(
            f"SELECT typeof({column}), CAST({column} AS BLOB) FROM {table} WHERE {row}"
        ).fetchone()
        changed = change(content)
        assert changed != content
        connection.execute(
            f"UPDATE {table} SET {column} = CAST(? AS {kind}) WHERE {row}", (changed,)
        )
        connection.commit()
    finally:
        connection.close()
