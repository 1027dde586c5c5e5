"""What may be done to a live world, as data.

The page, the HTTP interface and the tests change a world through these commands only; the
world's one owner applies them between two ticks (:meth:`app.sim.world.World.apply`). Every
command has a ``tag``, so that it can travel as JSON: ``{"tag": "toggle-candidate",
"id": "cube1"}``.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

from app.errors import InvalidInput, NotFound
from app.sim.cases import cases_of
from app.sim.cells import Cell
from app.sim.ports import TaskPolicy

Mode = Literal["manual", "auto"]
MODES: tuple[Mode, ...] = ("manual", "auto")


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveHuman:
    """Ask the person to take a posture; what is None stays where it is.

    The person follows with bounded speed and the posture is the nearest reachable one. A world
    whose person works by itself goes over to manual mode.
    """

    tag: ClassVar[str] = "move-human"
    pelvis: tuple[float, float, float] | None = None
    """Position and yaw of the pelvis: x [m], y [m], yaw [rad]."""
    right: tuple[float, float, float] | None = None
    """Point for the right hand, world frame [m]."""
    left: tuple[float, float, float] | None = None
    """Point for the left hand, world frame [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetMode:
    """Say who moves the person: the visitor (``manual``) or the work cycle (``auto``)."""

    tag: ClassVar[str] = "set-mode"
    mode: Mode
    """The new mode; leaves a running case study."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pause:
    """Stop the clock; the person can still be dragged and the values follow."""

    tag: ClassVar[str] = "pause"


@dataclass(frozen=True, slots=True, kw_only=True)
class Resume:
    """Let the clock run."""

    tag: ClassVar[str] = "resume"


@dataclass(frozen=True, slots=True, kw_only=True)
class StepOnce:
    """Advance by exactly one control period, and stay paused."""

    tag: ClassVar[str] = "step"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reset:
    """Put robot, counters and a working person back to the start; a dragged person stays."""

    tag: ClassVar[str] = "reset"


@dataclass(frozen=True, slots=True, kw_only=True)
class SetCandidates:
    """Say which stations the robot may choose among."""

    tag: ClassVar[str] = "set-candidates"
    ids: tuple[str, ...]
    """Station ids of the cell; an empty tuple lets the robot rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ToggleCandidate:
    """Add a station to the candidates, or take it out."""

    tag: ClassVar[str] = "toggle-candidate"
    id: str
    """Station id of the cell."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPolicy:
    """Give the robot another policy.

    Over HTTP the command carries the checkpoint's id or alias; the service loads it and queues
    this object.
    """

    tag: ClassVar[str] = "set-policy"
    policy: TaskPolicy | None
    """What decides from now on; None lets the robot rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StartCase:
    """Start one of the four case studies of the source's table 5.3."""

    tag: ClassVar[str] = "start-case"
    id: str
    """``case-1`` to ``case-4``."""


Command = (
    MoveHuman
    | SetMode
    | Pause
    | Resume
    | StepOnce
    | Reset
    | SetCandidates
    | ToggleCandidate
    | SetPolicy
    | StartCase
)

COMMANDS: tuple[type[Command], ...] = (
    MoveHuman,
    SetMode,
    Pause,
    Resume,
    StepOnce,
    Reset,
    SetCandidates,
    ToggleCandidate,
    SetPolicy,
    StartCase,
)


def check(command: Command, cell: Cell) -> None:
    """Refuse a command that the world could not carry out.

    Raises:
        InvalidInput: A number is not finite, or a mode is unknown.
        NotFound: The cell has no such station, or no such case study.
    """
    match command:
        case MoveHuman():
            for name in ("pelvis", "right", "left"):
                values = getattr(command, name)
                if values is not None and not all(map(math.isfinite, values)):
                    raise InvalidInput(name, values, "must be finite")
        case SetMode() if command.mode not in MODES:
            raise InvalidInput("mode", command.mode, "is unknown", MODES)
        case SetCandidates():
            for name in command.ids:
                cell.station(name)
        case ToggleCandidate():
            cell.station(command.id)
        case StartCase():
            names = tuple(case.id for case in cases_of(cell))
            if command.id not in names:
                raise NotFound("case study of this cell", command.id, names)
        case _:
            pass
