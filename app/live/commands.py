"""What may be done to a live world, as data.

The page, the HTTP interface and the tests change a world through these commands only; the
world's one owner applies them between two ticks (:meth:`app.live.pick.world.World.apply`).
Every command has a ``tag``, so that it can travel as JSON: ``{"tag": "toggle-candidate",
"id": "cube1"}``.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

from app.errors import InvalidInput, NotFound, digits, interval
from app.live.reach.commands import REACH_COMMANDS, ReachCommand, check_reaching, is_reaching
from app.live.sorting.commands import SORTING_COMMANDS, SortingCommand, check_sorting
from app.sim.cells.cell import LIMITS, Cell
from app.sim.human.anthropometry import PERCENTILES
from app.sim.mocap.importer import Motion
from app.sim.perception.keypoints import FARTHEST_M
from app.sim.pick.cases import cases_of
from app.sim.pick.task_policy import TaskPolicy
from app.sim.sorting.layout import is_sorting

Mode = Literal["manual", "auto", "still", "recorded"]
"""Who moves a person: the visitor; the work cycle or a case study; nobody, so that the person
stands at home; or a recorded motion."""
PlainMode = Literal["manual", "auto", "still"]
PLAIN_MODES: tuple[PlainMode, ...] = ("manual", "auto", "still")
"""Modes that need nothing else; ``recorded`` comes with :class:`SetMotion`."""
MAX_PEOPLE = LIMITS["people"]
"""Most people in a live cell."""
SPEEDS = (1, 2, 4, 8)
"""How many times faster than the clock on the wall a live world can run."""
FIRST = 0
"""Id of the person who is meant where none is named."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveHuman:
    """Ask the person to take a posture; what is None stays where it is.

    The person follows with bounded speed and the posture is the nearest reachable one. A world
    whose person works by itself goes over to manual mode.
    """

    tag: ClassVar[str] = "move-human"
    person: int = FIRST
    """Id of the person."""
    pelvis: tuple[float, float, float] | None = None
    """Position and yaw of the pelvis: x [m], y [m], yaw [rad]."""
    right: tuple[float, float, float] | None = None
    """Point for the right hand, world frame [m]."""
    left: tuple[float, float, float] | None = None
    """Point for the left hand, world frame [m]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetMode:
    """Say who moves a person: the visitor, the work cycle or nobody; leaves a case study."""

    tag: ClassVar[str] = "set-mode"
    mode: PlainMode
    """The new mode."""
    person: int = FIRST
    """Id of the person."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetMotion:
    """Let a person move as one was recorded; the person has the recorded lengths at first.

    Over HTTP the command carries the motion's name; the service finds it and queues this one.
    """

    tag: ClassVar[str] = "set-motion"
    motion: Motion
    """The run that is played, again and again."""
    name: str
    """Name of the stored motion."""
    run: int = 0
    """Which of its runs, from 0."""
    n_runs: int = 1
    """How many it has."""
    person: int = FIRST
    """Id of the person."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SetBody:
    """Give a person another size; it is there after half a second. What is None stays."""

    tag: ClassVar[str] = "set-body"
    stature: float | None = None
    """Percentile of adults, in PERCENTILES."""
    arms: float | None = None
    """Percentile of the arms' length at that stature."""
    shoulders: float | None = None
    """Percentile of the shoulders' width at that stature."""
    recorded: bool = False
    """Whether the recorded person's lengths hold while a recorded motion is played."""
    person: int = FIRST
    """Id of the person."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AddPerson:
    """Let another person come in, who works at a part of the table; the others move up."""

    tag: ClassVar[str] = "add-person"


@dataclass(frozen=True, slots=True, kw_only=True)
class RemovePerson:
    """Let a person leave; the others keep their ids."""

    tag: ClassVar[str] = "remove-person"
    person: int
    """Id of the person."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pause:
    """Stop the clock; people can still be dragged and the values follow."""

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
class SetSpeed:
    """Let the clock run faster than the one on the wall; whoever steps the world obeys it."""

    tag: ClassVar[str] = "set-speed"
    factor: int
    """Simulated seconds per second, one of SPEEDS; a busy machine may not hold it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Reset:
    """Put robot, counters and people back to the start; who is dragged stays."""

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
    """Start one of the four case studies of the source's table 5.3; one person stays."""

    tag: ClassVar[str] = "start-case"
    id: str
    """``case-1`` to ``case-4``."""


Command = (
    MoveHuman
    | SetMode
    | SetMotion
    | SetBody
    | AddPerson
    | RemovePerson
    | Pause
    | Resume
    | StepOnce
    | SetSpeed
    | Reset
    | SetCandidates
    | ToggleCandidate
    | SetPolicy
    | StartCase
    | SortingCommand
    | ReachCommand
)

COMMANDS: tuple[type[Command], ...] = (
    MoveHuman,
    SetMode,
    SetMotion,
    SetBody,
    AddPerson,
    RemovePerson,
    Pause,
    Resume,
    StepOnce,
    SetSpeed,
    Reset,
    SetCandidates,
    ToggleCandidate,
    SetPolicy,
    StartCase,
    *SORTING_COMMANDS,
    *REACH_COMMANDS,
)


def check(command: Command, cell: Cell, people: Sequence[int]) -> None:
    """Refuse a command that the world could not carry out.

    Args:
        command: What shall be done.
        cell: Where.
        people: Ids of the people who are there.

    Raises:
        InvalidInput: A number or mode out of range, nobody of that id, or no room.
        NotFound: The cell has no such station, or no such case study.
    """
    if isinstance(command, SORTING_COMMANDS):
        check_sorting(command, cell)
        return
    if isinstance(command, REACH_COMMANDS):
        check_reaching(command, cell)
        return
    match command:
        case MoveHuman() | SetMode() | SetMotion() | SetBody() | RemovePerson() | AddPerson():
            _check_person(command, people)
            if is_reaching(cell):
                _check_cylinder(command, cell)
        case SetCandidates() | ToggleCandidate() | StartCase():
            _check_stations(command, cell)
        case SetPolicy() if is_reaching(cell) and command.policy is not None:
            rule = "needs a policy that reaches goals: this one chooses tasks"
            raise InvalidInput("checkpoint", command.policy.checkpoint, rule)
        case SetSpeed():
            _check_speed(command)
        case _:
            pass


def _check_stations(command: SetCandidates | ToggleCandidate | StartCase, cell: Cell) -> None:
    rule = f"needs a pick-and-place cell: {cell.name}"
    if is_sorting(cell):
        raise InvalidInput("tag", command.tag, f"{rule} is a sorting cell")
    if is_reaching(cell):
        raise InvalidInput("tag", command.tag, f"{rule} has goals to reach instead")
    match command:
        case SetCandidates():
            for name in command.ids:
                cell.station(name)
        case ToggleCandidate():
            cell.station(command.id)
        case StartCase():
            names = tuple(case.id for case in cases_of(cell))
            if command.id not in names:
                raise NotFound("case study of this cell", command.id, names)


def _check_speed(command: SetSpeed) -> None:
    if command.factor not in SPEEDS:
        choices = [str(one) for one in SPEEDS]
        raise InvalidInput("factor", command.factor, "is no speed of the clock", choices)


def _check_person(
    command: MoveHuman | SetMode | SetMotion | SetBody | RemovePerson | AddPerson,
    people: Sequence[int],
) -> None:
    if isinstance(command, AddPerson):
        if len(people) >= MAX_PEOPLE:
            raise InvalidInput("people", len(people), f"are {MAX_PEOPLE} at most")
        return
    if command.person not in people:
        rule = "is nobody in this cell" if people else "is nobody: the cell is empty"
        raise InvalidInput("person", command.person, rule, [str(one) for one in people])
    if isinstance(command, MoveHuman):
        for name in ("pelvis", "right", "left"):
            values = getattr(command, name)
            # Written so that NaN is refused, too.
            if values is not None and not all(abs(one) <= FARTHEST_M for one in values):
                most = f"{digits(FARTHEST_M)}"
                rule = f"must be finite, within {most} m of the robot (yaw: {most} rad)"
                raise InvalidInput(name, values, rule)
    elif isinstance(command, SetMode) and command.mode not in PLAIN_MODES:
        raise InvalidInput("mode", command.mode, "cannot be set", PLAIN_MODES)
    elif isinstance(command, SetBody):
        _check_percentiles(command)


def _check_cylinder(command: Command, cell: Cell) -> None:
    """Refuse what can be done only to a person with joints."""
    rule = f"needs a person with joints: those of {cell.name} are walking cylinders"
    if isinstance(command, SetMotion | SetBody):
        raise InvalidInput("tag", command.tag, rule)
    if isinstance(command, MoveHuman):
        for name in ("right", "left"):
            if (value := getattr(command, name)) is not None:
                raise InvalidInput(name, value, rule)


def _check_percentiles(command: SetBody) -> None:
    low, high = PERCENTILES
    for name in ("stature", "arms", "shoulders"):
        value = getattr(command, name)
        if value is not None and not low <= value <= high:
            rule = f"must be a percentile in {interval(low, high)}"
            raise InvalidInput(name, value, rule)


def people_after(command: Command, people: tuple[int, ...]) -> tuple[int, ...]:
    """Return the ids of the people who are there after a command, in order.

    Args:
        command: What is done; it fits, see :func:`check`.
        people: Ids of the people who are there before.
    """
    match command:
        case AddPerson():
            free = next(id for id in range(MAX_PEOPLE) if id not in people)
            return tuple(sorted((*people, free)))
        case RemovePerson():
            return tuple(id for id in people if id != command.person)
        case StartCase():
            return (FIRST,)
        case _:
            return people
