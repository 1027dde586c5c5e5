"""Commands to a live world: one message each, in Python and as JSON.

The page, the HTTP API and the tests change a world only by these commands; the thread of the
world applies them between two control periods. A command is a pydantic model with a ``tag``:
``{"tag": "toggle-candidate", "id": "cube1"}``. Field checks are part of the models;
``command_checks.py`` compares a command with the work cell and the state of the world.
"""

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, PrivateAttr
from pydantic_core import PydanticCustomError

from app.sim.human.anthropometry import PERCENTILES
from app.sim.perception.keypoints import FARTHEST_M

Mode = Literal["manual", "auto", "still", "recorded"]
"""Motion source of a person: dragging; the work loop or a case study; none; a recording."""
PlainMode = Literal["manual", "auto", "still"]
"""Motion sources without further data; ``recorded`` is set by :class:`SetMotion`."""
FIRST = 0
"""Id of the first person, the default of person commands."""

Name = Annotated[str, Field(min_length=1, max_length=64)]
Coordinate = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M)]
Point = Annotated[tuple[Coordinate, Coordinate, Coordinate], Field(strict=False)]
Percentile = Annotated[float, Field(ge=PERCENTILES[0], le=PERCENTILES[1])]


def _no_boolean(value: object) -> object:
    """Refuse ``true``, which equals 1."""
    if isinstance(value, bool):
        raise PydanticCustomError("number", "must be a number")
    return value


def _require_tag(schema: dict[str, Any]) -> None:
    schema["required"] = ["tag", *schema.get("required", ())]


class LiveCommand(BaseModel):
    """Base class of commands: immutable, finite numbers, strict types, no unknown fields."""

    model_config = ConfigDict(
        extra="forbid",
        allow_inf_nan=False,
        frozen=True,
        strict=True,
        use_attribute_docstrings=True,
        json_schema_extra=_require_tag,
    )
    tag: str


class LoadingCommand(LiveCommand):
    """Base class of commands that name a stored object, which the service loads first."""

    _loaded: Any = PrivateAttr(None)

    @property
    def loaded(self) -> Any:
        """The object behind the name; None without one."""
        return self._loaded

    def with_loaded(self, loaded: object) -> Self:
        """Return the command together with the object behind its name."""
        copy = self.model_copy()
        copy._loaded = loaded
        return copy


class PersonCommand(LiveCommand):
    """Base class of commands to one person."""

    person: int = FIRST
    """id of the person; the first is 0"""


class MovePerson(PersonCommand):
    """Set target positions of a person; null fields keep theirs.

    The person follows at limited speed to the nearest reachable posture and changes to manual
    mode.
    """

    tag: Literal["move-person"] = "move-person"
    pelvis: Point | None = None
    """pelvis x [m], y [m], yaw [rad]"""
    right: Point | None = None
    """target of the right hand [m]"""
    left: Point | None = None
    """target of the left hand [m]"""


class SetMode(PersonCommand):
    """Set the motion source of a person; ends a case study."""

    tag: Literal["set-mode"] = "set-mode"
    mode: PlainMode


class SetMotion(LoadingCommand, PersonCommand):
    """Move a person along a recording, repeatedly, with the recorded body lengths.

    The loaded object is a ``playback.Recording``.
    """

    tag: Literal["set-motion"] = "set-motion"
    name: Name
    """name of a stored recording"""
    run: Annotated[int, Field(ge=0)] = 0
    """index of one of its clean runs"""


class SetAnthropometry(PersonCommand):
    """Change the body dimensions of a person within half a second; null fields keep theirs."""

    tag: Literal["set-anthropometry"] = "set-anthropometry"
    stature: Percentile | None = None
    """percentile of adults"""
    arms: Percentile | None = None
    """percentile of the arm length at that stature"""
    shoulders: Percentile | None = None
    """percentile of the shoulder width at that stature"""
    recorded: bool = False
    """use the recorded person's lengths while a recording is played"""


class AddPerson(LiveCommand):
    """Add a person who works at a part of the table; the others move up."""

    tag: Literal["add-person"] = "add-person"


class RemovePerson(LiveCommand):
    """Remove a person; the others keep their ids."""

    tag: Literal["remove-person"] = "remove-person"
    person: int
    """id of the person"""


class PauseClock(LiveCommand):
    """Stop the clock; people can still be dragged, and the values follow."""

    tag: Literal["pause"] = "pause"


class ResumeClock(LiveCommand):
    """Start the clock."""

    tag: Literal["resume"] = "resume"


class StepOnce(LiveCommand):
    """Advance by one control period and stay paused."""

    tag: Literal["step"] = "step"


class SetSpeed(LiveCommand):
    """Set the ratio of simulated to real time; a busy machine may not reach it."""

    tag: Literal["set-speed"] = "set-speed"
    factor: Annotated[Literal[1, 2, 4, 8], BeforeValidator(_no_boolean)]
    """simulated seconds per second"""


class Reset(LiveCommand):
    """Return robot, counters and people to the start; people in manual mode stay."""

    tag: Literal["reset"] = "reset"


class SetPolicy(LoadingCommand):
    """Replace the policy of the robot.

    The loaded object is a task policy; in a reach cell it is a reach policy.
    """

    tag: Literal["set-policy"] = "set-policy"
    checkpoint: Name | None
    """SHA-256 or alias; null: the robot is idle; in a reach cell: straight to the goal"""


class SetSafety(LiveCommand):
    """Enable or disable the safety layer, and change its settings; null keeps a setting."""

    tag: Literal["set-safety"] = "set-safety"
    on: bool | None = None
    """whether the robot obeys the safety layer"""
    protective_distance: Annotated[float, Field(ge=0.0, le=2.0)] | None = None
    """least distance to people while the robot moves [m]"""
    human_speed: Annotated[float, Field(ge=0.0, le=10.0)] | None = None
    """assumed speed of people v_h; parts observed faster count at their speed [m/s]"""
    reaction_time: Annotated[float, Field(ge=0.0, le=2.0)] | None = None
    """reaction time, a part of T_r [s]"""
    pfl: bool | None = None
    """whether power and force limiting permits contacts at admissible speeds"""
    use_measured_velocity: bool | None = None
    """whether S_p uses people's measured velocities instead of an assumed speed in every
    direction; in reach cells"""


class SetCandidates(LiveCommand):
    """Set the stations among which the robot chooses."""

    tag: Literal["set-candidates"] = "set-candidates"
    ids: Annotated[tuple[str, ...], Field(max_length=1000, strict=False)]
    """station ids; empty: the robot is idle"""


class ToggleCandidate(LiveCommand):
    """Add a station to the candidates, or remove it."""

    tag: Literal["toggle-candidate"] = "toggle-candidate"
    id: str
    """station id"""


class StartCase(LiveCommand):
    """Start one of the four case studies (thesis table 5.3), with the first person alone."""

    tag: Literal["start-case"] = "start-case"
    id: str
    """case-1 to case-4"""


ClockCommand = PauseClock | ResumeClock | StepOnce | Reset | SetSpeed
CylinderCommand = MovePerson | SetMode | AddPerson | RemovePerson
"""Commands to people that are known as walking cylinders."""
PeopleCommand = CylinderCommand | SetMotion | SetAnthropometry
PickCommand = (
    PeopleCommand
    | ClockCommand
    | SetPolicy
    | SetSafety
    | SetCandidates
    | ToggleCandidate
    | StartCase
)
