"""Fields of presets: bounds, units and explanations, and how overrides are held against them.

This module imports no learning library, so that the service can check and describe presets
cheaply.
"""

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from app.errors import InvalidInput, interval


def number(default: float, low: float, high: float, unit: str, text: str) -> Any:
    """Declare a field with its bounds, unit and explanation."""
    return field(
        default=default, metadata={"low": low, "high": high, "unit": unit, "help": text}
    )


def choice(default: str, choices: Iterable[str], text: str) -> Any:
    """Declare a field that takes one of several names, with its explanation."""
    return field(default=default, metadata={"choices": tuple(choices), "help": text})


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldInfo:
    """One field of a preset that a job may override."""

    name: str
    """Name of the field."""
    type: str
    """``"int"``, ``"float"`` or ``"choice"``."""
    default: float | str
    """Value in the preset."""
    minimum: float | None
    """Least allowed value; None for a choice."""
    maximum: float | None
    """Greatest allowed value; None for a choice."""
    choices: tuple[str, ...] | None
    """Allowed names; None for a number."""
    unit: str
    """Unit; empty for a plain number."""
    help: str
    """What it does, for people."""


def describe(entry: "dataclasses.Field[Any]", preset: Any) -> FieldInfo:
    """Return what a field of a preset takes."""
    default, choices = getattr(preset, entry.name), entry.metadata.get("choices")
    kind = "int" if isinstance(default, int) else "float"
    return FieldInfo(
        name=entry.name,
        type="choice" if choices else kind,
        default=default,
        minimum=entry.metadata.get("low"),
        maximum=entry.metadata.get("high"),
        choices=choices,
        unit=entry.metadata.get("unit", ""),
        help=entry.metadata["help"],
    )


def checked(info: FieldInfo, value: object) -> int | float | str:
    """Return an override that its field takes.

    Raises:
        InvalidInput: It does not.
    """
    path = f"overrides.{info.name}"
    if info.minimum is None or info.maximum is None:
        if not isinstance(value, str) or value not in (info.choices or ()):
            raise InvalidInput(path, value, "must be one of the choices", info.choices or ())
        return value
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InvalidInput(path, value, "must be a number")
    if not math.isfinite(value):
        raise InvalidInput(path, value, "must be finite")
    if info.type == "int" and value != int(value):
        raise InvalidInput(path, value, "must be a whole number")
    if not info.minimum <= value <= info.maximum:
        unit = f" {info.unit}" if info.unit else ""
        raise InvalidInput(
            path, value, f"must lie in {interval(info.minimum, info.maximum)}{unit}"
        )
    return int(value) if info.type == "int" else float(value)


def check_rounds(
    total_steps: int, progress_steps: int, checkpoint_steps: int, n_envs: int
) -> None:
    """Check that the numbers of steps are whole numbers of what they are made of.

    Raises:
        InvalidInput: One is not.
    """
    rounds = (
        ("total_steps", total_steps, n_envs, "n_envs"),
        ("progress_steps", progress_steps, n_envs, "n_envs"),
        ("checkpoint_steps", checkpoint_steps, progress_steps, "progress_steps"),
    )
    for name, value, unit, of in rounds:
        if value % unit:
            near = max(unit, round(value / unit) * unit)
            raise InvalidInput(
                f"overrides.{name}", value, f"must be a multiple of {of} = {unit}, say {near}"
            )


def check_learning(
    learning_starts: int, total_steps: int, buffer_size: int, n_envs: int
) -> None:
    """Check that learning starts before the end and that the replay memory has some room.

    Raises:
        InvalidInput: It does not, or has none.
    """
    if buffer_size < 16 * n_envs:
        raise InvalidInput(
            "overrides.buffer_size",
            buffer_size,
            f"must be at least 16 n_envs = {16 * n_envs}",
        )
    if learning_starts >= total_steps:
        raise InvalidInput(
            "overrides.learning_starts",
            learning_starts,
            f"must be below total_steps = {total_steps}",
        )
