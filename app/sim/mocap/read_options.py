"""Stated properties of a recording and its interpretation: units, axis, names.

Properties that are not stated are found from the file. If two interpretations fit, the file is
rejected and one must be stated.
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
"""Units of skeletons [m]; ``cmu`` is an inch divided by 0.45."""
UP_AXES = ("x", "y", "z", "-x", "-y", "-z")
"""Directions of a file that can point up."""
MAX_NAMES = 100
"""Largest number of stated names."""
MIN_UNIT, MAX_UNIT = 1e-6, 10.0
"""Range of a unit stated as a number [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """Stated properties of a recording; None and an empty map state nothing.

    Raises:
        InvalidInput: A unit is neither one of UNITS nor a number, the axis is unknown, or two
            names of the file map to one of ours.
    """

    unit: str | None = None
    """Unit of the skeleton's lengths: one of UNITS, or metres per unit as ``"0.045"``."""
    root_unit: str | None = None
    """Unit of the root's path, if it differs."""
    up: str | None = None
    """Direction of the file that points up, one of UP_AXES."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Our names of joints or columns, by the names in the file."""

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
        """Return the stated fields as JSON data."""
        return {name: value for name, value in asdict(self).items() if value}


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Interpretation of a file: stated and found properties."""

    unit: str
    """Unit of lengths."""
    root_unit: str
    """Unit of the root's path."""
    up: str
    """Direction of the file that points up."""
    rate_hz: float
    """Frame rate without repeated frames [Hz]."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Joints or columns of the file, by our names."""
    stature: float | None = None
    """Stature of the recorded person [m]; None for files of angles."""
    notes: tuple[str, ...] = ()
    """Further findings, as sentences."""


def name_map(pairs: Sequence[str]) -> dict[str, str]:
    """Return a name map from pairs ``"theirs=ours"``, split at the last ``=``.

    Raises:
        InvalidInput: A pair is invalid, a name is mapped twice, or there are too many.
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
"""Options without stated properties."""


def metres(unit: str, place: str = "unit") -> float:
    """Return the length of a unit [m].

    Args:
        unit: One of UNITS, or metres per unit as a number.
        place: Name of the field, for the message.

    Raises:
        InvalidInput: The unit is neither.
    """
    try:
        length = UNITS[unit] if unit in UNITS else float(unit)
    except ValueError:
        length = 0.0
    if not MIN_UNIT <= length <= MAX_UNIT:
        rule = f"must be a unit, or metres per unit in {interval(MIN_UNIT, MAX_UNIT)}"
        raise InvalidInput(place, unit[:40], rule, tuple(UNITS))
    return length
