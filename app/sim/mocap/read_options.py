"""What a caller states about a recording, and how it was read: units, axis, names.

Every reader takes a :class:`ReadOptions`. What is not stated is found from the file; where two
readings fit, the file is refused, and the caller states which one is meant.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from app.errors import InvalidInput, interval

UNITS: Mapping[str, float] = {
    "m": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "inch": 0.0254,
    "foot": 0.3048,
    "cmu": 0.0254 / 0.45,
}
"""Lengths that skeletons are written in [m]; ``cmu`` is an inch over 0.45."""
UP_AXES = ("x", "y", "z", "-x", "-y", "-z")
"""Directions of a file that can point up."""
MAX_NAMES = 100
"""Most names that are stated."""
MIN_UNIT, MAX_UNIT = 1e-6, 10.0
"""Range of a unit that is stated as a number [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """What is stated about a recording; None and an empty map state nothing.

    Raises:
        InvalidInput: A unit is neither one of UNITS nor a number, the axis is none, or two of
            the file's names stand for one of ours.
    """

    unit: str | None = None
    """Unit of the skeleton's lengths: one of UNITS, or metres per unit as ``"0.045"``."""
    root_unit: str | None = None
    """Unit of the root's path, where it is not the skeleton's."""
    up: str | None = None
    """Direction of the file that points up, one of UP_AXES."""
    names: Mapping[str, str] = field(default_factory=dict)
    """The file's names of joints or columns, and ours for them."""

    def __post_init__(self) -> None:
        for name in ("unit", "root_unit"):
            stated = getattr(self, name)
            if stated is not None:
                metres(stated, name)
        if self.up is not None and self.up not in UP_AXES:
            raise InvalidInput("up", self.up[:40], "must be the axis that points up", UP_AXES)
        ours = list(self.names.values())
        for theirs, own in self.names.items():
            if ours.count(own) > 1:
                rule = f"must be the only name for {own[:40]}, which has {ours.count(own)}"
                raise InvalidInput("map", f"{theirs[:60]}={own[:40]}", rule)

    def stated(self) -> dict[str, Any]:
        """Return what is stated, by field, as JSON data."""
        return {name: value for name, value in asdict(self).items() if value}


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """How a file was read: what was stated and what was found."""

    unit: str
    """Of lengths."""
    root_unit: str
    """Of the root's path."""
    up: str
    """Direction of the file that points up."""
    rate_hz: float
    """Frames per second, those that repeat counted once."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Joints or columns of the file, by our names."""
    stature: float | None = None
    """Of the recorded person [m]; None where only angles are given."""
    notes: tuple[str, ...] = ()
    """What else was found, in sentences."""


def name_map(pairs: Sequence[str]) -> dict[str, str]:
    """Return a name map from pairs as they are written.

    Args:
        pairs: ``"theirs=ours"`` each; the last ``=`` counts.

    Raises:
        InvalidInput: One is no pair, a name is mapped twice, or there are too many.
    """
    if len(pairs) > MAX_NAMES:
        raise InvalidInput("map", f"<{len(pairs)} names>", f"must be at most {MAX_NAMES}")
    names: dict[str, str] = {}
    for pair in pairs:
        if not pair.isprintable():
            raise InvalidInput("map", pair[:80], "must have only characters that can be shown")
        theirs, _, own = (part.strip() for part in pair.rpartition("="))
        if not theirs or not own:
            rule = "must be theirs=ours, such as LeftForeArm2=elbow_l"
            raise InvalidInput("map", pair[:80], rule)
        if theirs in names:
            raise InvalidInput("map", pair[:80], "must map a name once")
        names[theirs] = own
    return names


NOTHING_STATED = ReadOptions()
"""Everything is found from the file."""


def metres(unit: str, place: str = "unit") -> float:
    """Return the length of a unit [m].

    Args:
        unit: One of UNITS, or metres per unit as a number.
        place: Field that states it, for the message.

    Raises:
        InvalidInput: It is neither.
    """
    try:
        length = UNITS[unit] if unit in UNITS else float(unit)
    except ValueError:
        length = 0.0
    if not MIN_UNIT <= length <= MAX_UNIT:
        rule = f"must be a unit, or metres per unit in {interval(MIN_UNIT, MAX_UNIT)}"
        raise InvalidInput(place, unit[:40], rule, tuple(UNITS))
    return length
