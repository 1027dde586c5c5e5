"""The errors of Tandem, as one tree.

    ServiceError
    ├── NotFound             nothing has that name or id
    ├── InvalidInput         a value breaks a rule: field, value, rule, choices
    │   ├── BadCell          a work cell has faults: all of them, each with its place
    │   ├── BadRecording        a motion file has faults: each with its place
    │   └── GoalOutside      a goal lies beyond what can be answered for: axes and by how much
    ├── Conflict             the request contradicts the present state
    │   ├── ClockJump        a frame's stamp does not continue those before
    │   └── StaleAttempt     a worker writes about a job that is no longer its own
    ├── StorageUnavailable   the database does not answer for now
    ├── StorageFull          the database or the disk has no room left
    ├── Damaged              stored data are not what was stored: what, name, remedy
    ├── NotReady             the service cannot answer yet, or not now
    ├── MissingPackage       an optional library is not installed
    ├── SimulationError      the simulator met a state it must never meet
    └── CheckpointMismatch   a checkpoint does not fit what it is asked to do

Every error keeps its data as attributes and gives them by ``problem()``, from which the HTTP
border builds an RFC 9457 problem.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Protocol


def digits(value: float) -> str:
    """Return a number as it is compared: all its digits, without an exponent where they fit.

    Args:
        value: A bound, or another number of a rule.
    """
    number = value if isinstance(value, int) else float(value)
    if math.isfinite(number) and abs(number) < 1e21:
        return f"{Decimal(repr(number or 0)).normalize():f}"
    return repr(number)


def interval(low: float, high: float) -> str:
    """Return a closed interval with all digits of its bounds."""
    return f"[{digits(low)}, {digits(high)}]"


class ServiceError(Exception):
    """Root of every error that Tandem raises on purpose.

    Args:
        message: One sentence for people, with the value, the rule and the choices.
    """

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.message = message

    def problem(self) -> dict[str, object]:
        """Return the error's data, as extension members of a problem document."""
        return {}


class NotFound(ServiceError):
    """Nothing has that name or id.

    Args:
        what: The noun, such as ``"preset"``.
        name: The name that was asked for.
        known: Names that exist, where the list is short enough to print.
    """

    def __init__(self, what: str, name: str, known: Sequence[str] = ()) -> None:
        choices = f"; known: {', '.join(known)}" if known else ""
        super().__init__(f"no {what} {name!r}{choices}")
        self.what, self.name, self.known = what, name, tuple(known)

    def problem(self) -> dict[str, object]:
        """Return noun, name and the known names."""
        return {"what": self.what, "name": self.name, "known": list(self.known)}


class InvalidInput(ServiceError):
    """A value breaks a rule.

    Args:
        field: Dotted path of the field, such as ``"robot.q[3]"``.
        value: The offending value.
        rule: The rule it breaks, as a sentence part: ``"must lie in [-3.1, 3.1] rad"``.
        choices: Allowed values, where they can be listed.
    """

    def __init__(
        self, field: str, value: object, rule: str, choices: Sequence[str] = ()
    ) -> None:
        listed = f"; choices: {', '.join(choices)}" if choices else ""
        super().__init__(f"{field} = {value!r} {rule}{listed}")
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One thing that is wrong with a work cell or a file, for its author to mend."""

    place: str
    """Where: ``"stations.cube3.position[2]"``, ``"line 57"``."""
    value: str
    """What stands there, as text; empty where nothing does."""
    rule: str
    """The rule it breaks, as a sentence part: ``"must lie in [-3, 3] m"``."""
    hint: str = ""
    """What is probably meant, or what would do; may be empty."""

    @property
    def text(self) -> str:
        """One sentence."""
        given = f" = {self.value}" if self.value else ""
        return f"{self.place}{given} {self.rule}" + (f" ({self.hint})" if self.hint else "")


class _Faulty(InvalidInput):
    """Something that people wrote has faults.

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
    """A work cell has faults: all of them, at least one."""


class BadRecording(_Faulty):
    """A file of human motion has faults: at least one, each with its line or column."""


class Beyond(Protocol):
    """One coordinate that lies outside its range; ``app.sim.ports.OutsideField`` is one."""

    @property
    def field(self) -> str: ...  # noqa: D102
    @property
    def value(self) -> float: ...  # noqa: D102
    @property
    def low(self) -> float: ...  # noqa: D102
    @property
    def high(self) -> float: ...  # noqa: D102


class GoalOutside(InvalidInput):
    """A goal lies outside the targets that an answer is made from.

    Args:
        field: Path of the goal.
        value: The goal [m].
        beyond: The coordinates that lie outside, at least one.
    """

    def __init__(self, field: str, value: Sequence[float], beyond: Sequence[Beyond]) -> None:
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
        told = [part.format(**one) for one in self.beyond]
        super().__init__(field, list(value), "lies " + "; ".join(told))

    def problem(self) -> dict[str, object]:
        """Return field, value and rule, and each axis with how far outside it is [m]."""
        return {**super().problem(), "outside": [dict(one) for one in self.beyond]}


class Conflict(ServiceError):
    """The request contradicts the present state."""


class ClockJump(Conflict):
    """The stamp of a frame does not continue the stamps before it; the frame is not taken.

    Args:
        stamp: Stamp of the frame, on the tracker's clock [s].
        newest: Stamp of the newest frame taken [s].
        silence: How long ago that frame arrived [s].
        count: How many frames in a row continue each other like this.
        needed: How many of them make the tracker's clock count as changed.
    """

    def __init__(
        self, stamp: float, newest: float, silence: float, count: int, needed: int
    ) -> None:
        self.stamp, self.newest, self.silence = stamp, newest, silence
        self.count, self.needed = count, needed
        self.rule = (
            f"must be later than {newest!r} s, the stamp of the frame taken {silence:.3g} s "
            "ago, by about as much"
        )
        super().__init__(
            f"t = {stamp!r} {self.rule}; this frame is not taken, and people count as stale. "
            f"Send on: {needed} frames in a row whose stamps (in seconds) continue each other "
            f"are taken as a change of the clock; this is number {count}. Or delete the "
            "tracker and open a new one"
        )

    def problem(self) -> dict[str, object]:
        """Return field, value and rule, and how far the resynchronisation is."""
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
    """Stored data do not have the checksum that was stored with them.

    Args:
        what: The noun, such as ``"checkpoint"``.
        name: Its name or id.
        remedy: What to do about it.
        sha256: The checksum that it should have.
    """

    def __init__(self, what: str, name: str, remedy: str, sha256: str = "") -> None:
        super().__init__(
            f"{what} {name!r} is damaged: its content does not have its checksum and is not "
            f"used; {remedy}"
        )
        self.what, self.name, self.remedy, self.sha256 = what, name, remedy, sha256

    def problem(self) -> dict[str, object]:
        """Return noun, name, checksum and remedy."""
        return {
            "what": self.what,
            "name": self.name,
            "sha256": self.sha256 or None,
            "remedy": self.remedy,
        }


class NotReady(ServiceError):
    """The service cannot answer yet, or not now; asking again later may help."""


class StaleAttempt(Conflict):
    """A worker writes about a job that is no longer its own: the write is refused.

    Args:
        job_id: The job.
        attempt: The attempt that tried to write.
    """

    def __init__(self, job_id: str, attempt: int) -> None:
        super().__init__(
            f"attempt {attempt} no longer holds job {job_id}: it was cancelled, ended or "
            "started again, and this write is refused"
        )
        self.job_id, self.attempt = job_id, attempt

    def problem(self) -> dict[str, object]:
        """Return the job and the attempt."""
        return {"job": self.job_id, "attempt": self.attempt}


class StorageUnavailable(ServiceError):
    """The database does not answer for now: locked for too long, unreachable, unreadable.

    Args:
        database: Which one, as a URL without its password.
        reason: What the database said.
    """

    def __init__(self, database: str, reason: str) -> None:
        super().__init__(f"{database} cannot be used for now: {reason}")
        self.database, self.reason = database, reason

    def problem(self) -> dict[str, object]:
        """Return the database and its reason."""
        return {"database": self.database, "reason": self.reason}


class StorageFull(ServiceError):
    """The database or the disk has no room left.

    Args:
        database: What is full, as a URL without its password.
    """

    def __init__(self, database: str) -> None:
        super().__init__(
            f"no room left in {database} (database or disk is full): free some space or point "
            "TANDEM_DATA to a larger disk"
        )
        self.database = database

    def problem(self) -> dict[str, object]:
        """Return what is full."""
        return {"database": self.database}


class MissingPackage(ServiceError):
    """An optional library is not installed on this machine.

    Args:
        package: Its name.
        what: What needs it, such as ``"planning"``.
        remedy: What to do about it.
    """

    def __init__(self, package: str, what: str, remedy: str) -> None:
        super().__init__(f"{what} needs the package {package!r}: {remedy}")
        self.package, self.what, self.remedy = package, what, remedy

    def problem(self) -> dict[str, object]:
        """Return the package, what needs it and the remedy."""
        return {"package": self.package, "what": self.what, "remedy": self.remedy}


class SimulationError(ServiceError):
    """The simulator met a state it must never meet; a bug, with the seed to reproduce it."""


class CheckpointMismatch(ServiceError):
    """A checkpoint does not fit what it is asked to do.

    Args:
        field: The property that differs, such as ``"cell"``.
        expected: What is asked for.
        actual: What the checkpoint says.
    """

    def __init__(self, field: str, expected: object, actual: object) -> None:
        super().__init__(f"checkpoint {field} is {actual!r}, expected {expected!r}")
        self.field, self.expected, self.actual = field, expected, actual

    def problem(self) -> dict[str, object]:
        """Return the property and both values."""
        return {
            "field": self.field,
            "expected": repr(self.expected),
            "actual": repr(self.actual),
        }
