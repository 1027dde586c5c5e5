"""Errors of recordings: a place in the file, the value found there and the rule it breaks."""

from app.errors import BadRecording, Fault

MAX_FAULTS = 20
"""Largest number of faults that one error lists."""


def bad(place: int | str, value: str, rule: str, hint: str = "") -> BadRecording:
    """Return the error of one fault; an integer place is a line."""
    where = f"line {place}" if isinstance(place, int) else place
    return BadRecording([Fault(place=where, value=value, rule=rule, hint=hint)])


def shown(text: str) -> str:
    """Return an excerpt of a file, short enough for a message."""
    return repr(text if len(text) <= 40 else f"{text[:37]}...")
