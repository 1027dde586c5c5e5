"""People in a request, and their use by a policy.

The members of an entry give its kind: ``q`` (joint angles), ``keypoints`` (BODY_25), ``r`` (a
cylinder) or ``tracker`` (a track of ``/v1/trackers``).

Source: docs/method.md 2.8.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError

from app.api.schemas.numbers import Answer, Body, Finite, Time, Vector18
from app.errors import InvalidInput
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.human import model as human
from app.sim.human.anthropometry import NAMES, PERCENTILES, percentile_body
from app.sim.human.kernels.kinematics import N_SIZE
from app.sim.human.person import Person
from app.sim.perception.keypoints import BODY_25, FARTHEST_M, N_KEYPOINTS
from app.sim.perception.observed_people import FASTEST, MOST_REMEMBERED

Source = Literal["joint-angles", "keypoints", "cylinder", "tracker"]
Speeds = Literal["given", "zero", "estimated"]
Percentile = Annotated[float, Field(ge=PERCENTILES[0], le=PERCENTILES[1])]
Speed = Annotated[float, Field(ge=-FASTEST, le=FASTEST)]
Place = Annotated[float, Field(ge=-FARTHEST_M, le=FARTHEST_M)]
Radius = Annotated[float, Field(ge=0.0, le=FARTHEST_M)]
Walk = Annotated[float, Field(ge=0.0, le=FASTEST)]
Coordinate = Annotated[
    Annotated[float, Field(allow_inf_nan=True)] | None,
    BeforeValidator(
        lambda value: None if value == "NaN" else value,
        json_schema_input_type=float | Literal["NaN"] | None,
    ),
]
"""A number, or missing; NaN also as text, which JSON has no number for."""
Keypoint = Annotated[list[Coordinate], Field(max_length=8)] | None
KeypointName = Annotated[str, Field(json_schema_extra={"enum": list(BODY_25)})]
Lengths = Annotated[list[Finite], Field(min_length=N_SIZE, max_length=N_SIZE)]
ORDER = ", ".join(BODY_25)
UNUSABLE = (
    "key-points dropped: only some coordinates, infinite, beyond 100 m, or a confidence "
    "outside [0, 1]"
)
IMPLAUSIBLE = (
    "reason why the key-points cannot be positions in `base_link` in metres "
    "(`foreign-frame`): another coordinate frame or unit, or no usable key-point; null where "
    "they can"
)


def _in_order(value: object) -> object:
    """Return named key-points as a list in the order of BODY_25, None where absent."""
    if not isinstance(value, Mapping):
        return value
    unknown = [name for name in value if name not in BODY_25]
    if unknown:
        text = "has the name {name}; must be one of {names}"
        given = {"name": str(unknown[0])[:64], "names": ORDER}
        raise PydanticCustomError("keypoint_name", text, given)
    return [value.get(name) for name in BODY_25]


_ListOfKeypoints = Annotated[
    list[Keypoint], Field(min_length=N_KEYPOINTS, max_length=N_KEYPOINTS)
]
OfKeypoints = Annotated[
    _ListOfKeypoints,
    BeforeValidator(
        _in_order, json_schema_input_type=_ListOfKeypoints | dict[KeypointName, Keypoint]
    ),
]
"""A list in the order of BODY_25, or a mapping of some of its names."""


def _rows(values: list[Keypoint], width: int) -> Vec:
    """Return rows of numbers, shape (25, width), NaN where missing.

    A row of another length than 3 to ``width`` is unusable: its coordinates become infinite,
    which differs from missing.
    """
    rows = np.full((N_KEYPOINTS, width), np.nan)
    for k, value in enumerate(values):
        numbers = [np.nan if number is None else number for number in value or ()]
        if 3 <= len(numbers) <= width:
            rows[k, : len(numbers)] = numbers
        elif not np.isnan(numbers).all():
            rows[k, :3] = np.inf
    return rows


class BodyPercentiles(Body):
    """A person's size, as percentiles of adults."""

    stature: Percentile = Field(50.0, description="percentile of the stature")
    arms: Percentile = Field(50.0, description="of the arm length, at that stature")
    shoulders: Percentile = Field(50.0, description="of the shoulder width, at that stature")

    def size(self, cell: Cell) -> Vec:
        """Return the body lengths in a cell [m], shape (12,)."""
        workers = cell.workers
        pelvis = workers[0].pelvis_height if workers else 0.95
        body = percentile_body(self.stature, self.arms, self.shoulders, pelvis)
        return body.vector(cell.floor_z)


class PersonState(Body):
    """A person as 18 joint angles of the human model."""

    q: Vector18 = Field(
        description="joint positions [m, rad]; the pelvis in the robot's `base_link`: "
        + ", ".join(human.JOINT_NAMES)
    )
    qd: Vector18 = Field(description="joint speeds [m/s, rad/s]")
    body: Annotated[
        BodyPercentiles | None,
        Field(description="the person's size; that of the cell's person if null"),
    ] = None
    size: Annotated[
        Lengths | None,
        Field(
            description=f"body dimensions in place of percentiles: {', '.join(NAMES)}. "
            "`pelvis` is the height of the standing pelvis above the table (z in the robot's "
            "`base_link`) [m], `girth` a ratio to the median person, the others are lengths [m]"
        ),
    ] = None

    def to_domain(self, cell: Cell, place: str) -> Person:
        """Return the person as arrays.

        Raises:
            InvalidInput: ``body`` and ``size`` are both given.
        """
        if self.size is not None and self.body is not None:
            raise InvalidInput(f"{place}size", "given", "must be left out beside `body`")
        size = None if self.body is None else self.body.size(cell)
        if self.size is not None:
            size = np.array(self.size)
        return Person(q=np.array(self.q), qd=np.array(self.qd), size=size)


class KeypointDetection(Body):
    """A person in one frame of a key-point tracker."""

    keypoints: OfKeypoints = Field(
        description="[x, y, z] in m, in the robot's `base_link`, or [x, y, z, confidence] with "
        "a confidence in [0, 1]. Missing: null, [], null or NaN in all coordinates, 0 or -1 in "
        "all three, confidence below 0.1. Other unusable points are dropped and named. In the "
        f"order of BODY_25: {ORDER}; or a mapping of these names, absent where missing"
    )

    def points(self) -> tuple[Vec, Vec]:
        """Return key-points [m], (25, 3), NaN where missing, and confidences, (25,)."""
        rows = _rows(self.keypoints, 4)
        given = np.array([value is not None and len(value) == 4 for value in self.keypoints])
        return rows[:, :3], np.where(given, rows[:, 3], 1.0)


class KeypointsPerson(KeypointDetection):
    """A person as the key-points of a single frame."""

    velocities: OfKeypoints | None = Field(
        None,
        description="velocities of the key-points [m/s], in the same form; null, [] or NaN "
        "where unknown, replaced by zero",
    )
    body: BodyPercentiles | None = Field(
        None, description="the person's size; that of the cell's person if null"
    )

    def speeds(self) -> Vec | None:
        """Return the velocities [m/s], (25, 3), NaN where unknown; None if all are unknown."""
        rows = None if self.velocities is None else _rows(self.velocities, 3)
        return None if rows is None or np.isnan(rows).all() else rows


class CylinderPerson(Body):
    """A person as an upright cylinder.

    Policies for people of 18 joints observe a standing person of the cell's body dimensions on
    its axis, who faces the robot's base.
    """

    x: Place = Field(description="x of the axis in the robot's `base_link` [m]")
    y: Place = Field(description="y of the axis in the robot's `base_link` [m]")
    vx: Speed = Field(description="velocity [m/s]")
    vy: Speed = Field(description="velocity [m/s]")
    r: Annotated[float, Field(ge=0.01, le=FARTHEST_M)] = Field(description="radius [m]")
    growth: Speed = Field(0.0, description="rate of the radius [m/s]; used by reach policies")
    past: Annotated[
        list[Annotated[tuple[Radius, Walk], Field(strict=False)]],
        Field(max_length=MOST_REMEMBERED),
    ] = Field(
        [],
        description="radius [m] and walking speed [m/s] 0.1 s, 0.2 s, ... ago, the newest "
        "first; constant before the last; used by policies with motion prediction",
    )

    def remembered(self) -> Vec | None:
        """Return the past, shape (n, 2); None where it is empty."""
        return np.array(self.past) if self.past else None


class TrackedPerson(Body):
    """A track of `/v1/trackers`; a motion request names all tracks of a tracker."""

    tracker: str = Field(max_length=64, description="id of the tracker")
    person: Annotated[int, Field(ge=0, le=3)] = Field(description="index of the track")
    t: Time | None = Field(
        None,
        description="current time on the tracker's clock [s]; used if the age that it gives "
        "exceeds the time since the newest frame arrived",
    )


_MARKS: dict[str, Source] = {
    "q": "joint-angles",
    "qd": "joint-angles",
    "keypoints": "keypoints",
    "tracker": "tracker",
    "r": "cylinder",
    "x": "cylinder",
}


def source_of(entry: Any) -> Source | None:
    """Return the kind of an entry from its members."""
    if type(entry) is dict or isinstance(entry, Mapping):  # the second takes long
        for name, source in _MARKS.items():
            if name in entry:
                return source
        return None
    kinds: dict[type, Source] = {
        PersonState: "joint-angles",
        KeypointsPerson: "keypoints",
        CylinderPerson: "cylinder",
        TrackedPerson: "tracker",
    }
    return kinds.get(type(entry))


PersonInput = Annotated[
    Annotated[PersonState, Tag("joint-angles")]
    | Annotated[KeypointsPerson, Tag("keypoints")]
    | Annotated[CylinderPerson, Tag("cylinder")]
    | Annotated[TrackedPerson, Tag("tracker")],
    Discriminator(
        source_of,
        custom_error_type="person_source",
        custom_error_message="must be a person, by `q` and `qd`, by `keypoints`, by a cylinder "
        "`x`, `y`, `vx`, `vy`, `r`, or by `tracker` and `person`",
    ),
]


class PersonUse(Answer):
    """Use of one person of a request."""

    by: Source
    used: bool = Field(
        description="whether this person is the nearest, which every policy observes; some "
        "policies observe another one for each candidate, too"
    )
    as_cylinder: bool = Field(
        description="whether no joint angles are known and a cylinder is used"
    )
    monitored_as_cylinder: bool = Field(
        description="whether speed and separation monitoring uses a cylinder: no joint angles "
        "are known, an arm is not observed, or a hand is not where they place it"
    )
    speeds: Speeds = Field(description="origin of the speeds; zero: unknown")
    flags: list[str] = Field(
        description="degradations of the estimate; `far`: the policy uses this person at 5 m, "
        "or not at all; `clamped`: angles, radius, growth or past are at their bounds; "
        "`dropped`: the policy does not observe this person, because there are more than four"
    )
    held: list[str] = Field(description="unobserved joints, at rest or at their last angle")
    missing: list[str] = Field(description="unknown key-points")
    outliers: list[str] = Field(description="key-points dropped: too far from all others")
    unusable: list[str] = Field(description=UNUSABLE)
    implausible: str | None = Field(description=IMPLAUSIBLE)
    age_s: float | None = Field(
        description="time since the newest credible key-point [s]; null where there was none"
    )
