"""The error hierarchy.

    ServiceError
    ├── NotFound             no object with that name or id
    ├── InvalidInput         a value breaks a rule: field, value, rule, choices
    │   ├── BadCell          faults of a work cell, each with its place
    │   ├── BadRecording     faults of a motion file, each with its place
    │   └── GoalOutside      a goal outside the targets: axes and distances
    ├── Conflict             the request contradicts the present state
    │   ├── WrongState       an object is in another state: field, value, rule, choices
    │   ├── ClockJump        a frame's stamp does not continue those before
    │   ├── LeaseLost        a server no longer runs the jobs of its database
    │   └── StaleAttempt     a worker no longer holds its job
    ├── StorageUnavailable   the database does not answer for now
    │   ├── ServerUnreachable  the server does not answer a worker on another machine
    │   └── StorageDamaged   its file has damaged pages: the remedy is a backup
    ├── StorageFull          the database or the disk is full
    ├── Damaged              stored data with a wrong digest: kind, name, remedy
    ├── NotReady             the service cannot answer yet, or not now
    ├── MissingPackage       an optional library is not installed
    ├── SimulationError      the simulator reached an impossible state
    └── CheckpointMismatch   a checkpoint does not fit its use

Every error has its data as attributes and as ``problem()``, the members of an RFC 9457 problem.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Protocol


def digits(value: float) -> str:
    """Return a number with all its digits, without an exponent below 1e21."""
    number = value if isinstance(value, int) else float(value)
    if math.isfinite(number) and abs(number) < 1e21:
        return f"{Decimal(repr(number or 0)).normalize():f}"
    return repr(number)


def interval(low: float, high: float) -> str:
    """Return a closed interval with all digits of its bounds."""
    return f"[{digits(low)}, {digits(high)}]"


class ServiceError(Exception):
    """Base of all errors of Tandem.

    Args:
        message: A sentence with the value, the rule and the choices.
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.message = message

    def problem(self) -> dict[str, object]:
        """Return the error's data as extension members of a problem document."""
        return {}


class NotFound(ServiceError):
    """No object has that name or id.

    Args:
        what: Kind of object, such as ``"preset"``.
        name: The unknown name.
        known: Existing names, where there are few.
    """

    def __init__(self, what: str, name: str, known: Sequence[str] = ()) -> None:
        choices = f"; known: {', '.join(known)}" if known else ""
        super().__init__(f"no {what} {name!r}{choices}")
        self.what, self.name, self.known = what, name, tuple(known)

    def problem(self) -> dict[str, object]:
        """Return kind, name and the known names."""
        return {"what": self.what, "name": self.name, "known": list(self.known)}


class _BrokenRule(ServiceError):
    """A field whose value breaks a rule; see the subclasses."""

    def __init__(
        self, message: str, field: str, value: object, rule: str, choices: Sequence[str]
    ) -> None:
        super().__init__(message)
        self.field, self.value, self.rule = field, value, rule
        self.choices = tuple(choices)

    def problem(self) -> dict[str, object]:
        """Return field, value, rule and choices."""
        return {
            "field": self.field,
            "value": repr(self.value),
            "rule": self.rule,
            "choices": list(self.choices),
        }


class InvalidInput(_BrokenRule):
    """A value breaks a rule.

    Args:
        field: Dotted path of the field, such as ``"robot.q[3]"``.
        value: The offending value.
        rule: The rule it breaks, as a sentence part: ``"must lie in [-3.1, 3.1] rad"``.
        choices: Allowed values, where there are few.
    """

    def __init__(
        self, field: str, value: object, rule: str, choices: Sequence[str] = ()
    ) -> None:
        listed = f"; choices: {', '.join(choices)}" if choices else ""
        message = f"{field} = {value!r} {rule}{listed}"
        super().__init__(message, field, value, rule, choices)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A fault of a work cell or a file."""

    place: str
    """Its place: ``"stations.cube3.position[2]"``, ``"line 57"``."""
    value: str
    """The value there as text; empty where there is none."""
    rule: str
    """The rule it breaks, as a sentence part: ``"must lie in [-3, 3] m"``."""
    hint: str = ""
    """Probable intention or remedy; may be empty."""

    @property
    def text(self) -> str:
        """The fault as a sentence."""
        given = f" = {self.value}" if self.value else ""
        return f"{self.place}{given} {self.rule}" + (f" ({self.hint})" if self.hint else "")


class _Faulty(InvalidInput):
    """A file has faults.

    Args:
        faults: All of them, at least one.
    """

    def __init__(self, faults: Sequence[Fault]) -> None:
        first = faults[0]
        more = f"; and {len(faults) - 1} more" if len(faults) > 1 else ""
        ServiceError.__init__(self, first.text + more)
        self.field, self.value, self.rule = first.place, first.value, first.rule
        self.choices, self.faults = (), tuple(faults)

    def problem(self) -> dict[str, object]:
        """Return the first fault's data and the list of all."""
        errors = [
            {
                "field": fault.place,
                "value": fault.value,
                "rule": fault.rule,
                "hint": fault.hint,
                "choices": [],
            }
            for fault in self.faults
        ]
        return {**errors[0], "errors": errors}


class BadCell(_Faulty):
    """Faults of a work cell."""


class BadRecording(_Faulty):
    """Faults of a file of human motion, each with its line or column."""


class OutOfRangeCoordinate(Protocol):
    """One coordinate outside its range, such as an ``OutOfRangeValue`` of ``app.sim.core``."""

    @property
    def field(self) -> str: ...  # noqa: D102
    @property
    def value(self) -> float: ...  # noqa: D102
    @property
    def low(self) -> float: ...  # noqa: D102
    @property
    def high(self) -> float: ...  # noqa: D102


class GoalOutside(InvalidInput):
    """A goal outside the targets of a policy.

    Args:
        field: Path of the goal.
        value: The goal [m].
        beyond: Its coordinates outside the range, at least one.
    """

    def __init__(
        self, field: str, value: Sequence[float], beyond: Sequence[OutOfRangeCoordinate]
    ) -> None:
        self.beyond = tuple(
            {
                "axis": one.field.rpartition(".")[2],
                "by_m": one.low - one.value if one.value < one.low else one.value - one.high,
                "low": one.low,
                "high": one.high,
            }
            for one in beyond
        )
        part = "{by_m:.3g} m outside along {axis}, which must lie in [{low:g}, {high:g}] m"
        parts = [part.format(**one) for one in self.beyond]
        super().__init__(field, list(value), "lies " + "; ".join(parts))

    def problem(self) -> dict[str, object]:
        """Return field, value and rule, and each axis with its distance outside [m]."""
        return {**super().problem(), "outside": [dict(one) for one in self.beyond]}


class Conflict(ServiceError):
    """The request contradicts the present state."""


class WrongState(_BrokenRule, Conflict):
    """An object is not in the state that an action requires.

    Args:
        field: The member of the object that contradicts the action, such as ``"state"``.
        value: Its present value.
        rule: The rule, as a sentence part: ``"must be failed to retry job 5"``.
        choices: Values that the action accepts, where there are few.
    """

    def __init__(
        self, field: str, value: object, rule: str, choices: Sequence[str] = ()
    ) -> None:
        super().__init__(f"{field} = {value!r} {rule}", field, value, rule, choices)


class ClockJump(Conflict):
    """The stamp of a refused frame does not continue the stamps before it.

    Args:
        stamp: Stamp of the frame, on the tracker's clock [s].
        newest: Stamp of the newest accepted frame [s].
        silence: Time since the arrival of that frame [s].
        count: Number of consecutive frames that continue each other.
        needed: Number of them that is accepted as a change of the clock.
    """

    def __init__(
        self, stamp: float, newest: float, silence: float, count: int, needed: int
    ) -> None:
        self.stamp, self.newest, self.silence = stamp, newest, silence
        self.count, self.needed = count, needed
        self.rule = (
            f"must be about {silence:.3g} s later than {newest!r} s, the stamp of the newest "
            "frame"
        )
        super().__init__(
            f"t = {stamp!r} {self.rule}; this frame is refused, and people are stale. After "
            f"{needed} frames in a row with stamps (in seconds) that continue each other a "
            f"change of the clock is accepted; this is number {count}. Or delete the tracker "
            "and open a new one"
        )

    def problem(self) -> dict[str, object]:
        """Return field, value and rule, and the state of the resynchronisation."""
        return {
            "field": "t",
            "value": repr(self.stamp),
            "rule": self.rule,
            "choices": [],
            "newest_t": self.newest,
            "consistent_frames": self.count,
            "needed_frames": self.needed,
        }


class Damaged(ServiceError):
    """Stored data do not have their checksum.

    Args:
        what: Kind of object, such as ``"checkpoint"``.
        name: Its name or id.
        remedy: What to do.
    """

    def __init__(self, what: str, name: str, remedy: str, sha256: str = "") -> None:
        super().__init__(
            f"{what} {name!r} is damaged: its content does not match its checksum and is not "
            f"used; {remedy}"
        )
        self.what, self.name, self.remedy, self.sha256 = what, name, remedy, sha256

    def problem(self) -> dict[str, object]:
        """Return kind, name, checksum and remedy."""
        return {
            "what": self.what,
            "name": self.name,
            "sha256": self.sha256 or None,
            "remedy": self.remedy,
        }


class NotReady(ServiceError):
    """The service cannot answer yet, or not now; a later request may succeed."""


class MissingPackage(ServiceError):
    """An optional library is not installed.

    Args:
        what: The feature, such as ``"planning"``.
        remedy: What to do.
    """

    def __init__(self, package: str, what: str, remedy: str) -> None:
        super().__init__(f"{what} needs the package {package!r}: {remedy}")
        self.package, self.what, self.remedy = package, what, remedy

    def problem(self) -> dict[str, object]:
        """Return package, feature and remedy."""
        return {"package": self.package, "what": self.what, "remedy": self.remedy}


class SimulationError(ServiceError):
    """The simulator reached an impossible state: a bug, with the seed to reproduce it."""


class CheckpointMismatch(ServiceError):
    """A checkpoint does not fit its use.

    Args:
        field: The differing property of the checkpoint, such as ``"cell"``.
        expected: The required value.
        actual: The checkpoint's value.
        member: Member of the request that names the checkpoint.
    """

    def __init__(
        self, field: str, expected: object, actual: object, *, member: str = "checkpoint"
    ) -> None:
        super().__init__(f"checkpoint {field} is {actual!r}, expected {expected!r}")
        self.field, self.expected, self.actual = field, expected, actual
        self.member = member

    def problem(self) -> dict[str, object]:
        """Return the checkpoint as the faulty field, its property and both values."""
        return {
            "field": self.member,
            "value": f"<{self.field} {self.actual!r}>",
            "rule": f"must have the {self.field} {self.expected!r}",
            "choices": [],
            "property": self.field,
            "expected": repr(self.expected),
            "actual": repr(self.actual),
        }
