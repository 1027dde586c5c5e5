"""Bounds of the numbers of a work cell, with a guess of the unit.

Lengths in millimetres and angles in degrees are the most common mistakes, so numbers outside
their bounds are also tried in these units.
"""

import math
from collections.abc import Iterator

from pydantic import BaseModel

from app.errors import Fault, digits, interval
from app.sim.cells.parts import Each, Within

MAX_SHOWN = 60
"""Longest value that a message repeats [characters]."""


def shown(value: object) -> str:
    """Write a value as a user would, cut where it is long."""
    if isinstance(value, float):
        return digits(value)
    if isinstance(value, tuple | list):
        return f"[{', '.join(shown(one) for one in value)}]"
    return cut(str(value))


def cut(text: str) -> str:
    """Return a text of at most MAX_SHOWN characters."""
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}..."


def fault(place: str, value: object, rule: str, hint: str = "") -> Fault:
    """Return a fault with the value as :func:`shown` writes it."""
    return Fault(place=place, value=shown(value), rule=rule, hint=hint)


def unit_hint(value: float, within: Within) -> str:
    """Return a hint about the unit of a number outside its bounds; empty if unclear."""
    if within.unit.startswith("rad") and within.low <= math.radians(value) <= within.high:
        unit = within.unit.replace("rad", "degrees", 1)
        return f"looks like {unit}: in {within.unit} that is {math.radians(value):.4g}"
    if not within.unit or value == 0.0:
        return ""
    milli = {"m": "millimetres", "s": "milliseconds", "m/s": "mm/s"}.get(within.unit)
    if milli and within.low <= value / 1000.0 <= within.high and abs(value) >= 5.0:
        return f"looks like {milli}: in {within.unit} that is {value / 1000.0:g}"
    if milli and within.low <= value * 1000.0 <= within.high:
        return f"looks 1000 times too small: {value * 1000.0:g} {within.unit}?"
    return ""


def numbers(model: BaseModel, place: str = "") -> Iterator[Fault]:
    """Return the faults of all numbers of a model and of its parts against their bounds.

    Args:
        model: A cell, or a part of one.
        place: Path of the model, with a dot at its end; empty for a cell.
    """
    for name, field in type(model).model_fields.items():
        value, path = getattr(model, name), f"{place}{name}"
        if isinstance(value, BaseModel):
            yield from numbers(value, f"{path}.")
        elif isinstance(value, tuple) and value and isinstance(value[0], BaseModel):
            for index, one in enumerate(value):
                inner = f"{path}.{one.id}" if hasattr(one, "id") else f"{path}[{index}]"
                yield from numbers(one, f"{inner}.")
        elif value is not None:
            for rule in field.metadata:
                yield from _against(rule, value, path)


def _against(rule: object, value: object, path: str) -> Iterator[Fault]:
    if isinstance(rule, Each) and isinstance(value, tuple):
        for index, (part, one) in enumerate(zip(rule.parts, value, strict=True)):
            yield from _against(part, one, f"{path}[{index}]")
    elif isinstance(rule, Within) and isinstance(value, tuple):
        for index, one in enumerate(value):
            yield from _against(rule, one, f"{path}[{index}]")
    elif isinstance(rule, Within) and isinstance(value, int | float):
        if not rule.low <= value <= rule.high:
            text = f"must lie in {interval(rule.low, rule.high)} {rule.unit}".rstrip()
            yield fault(path, value, text, unit_hint(value, rule))
