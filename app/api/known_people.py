"""Conversion of the people of a request to person states.

A policy uses a person's state estimated for the present; a safety layer uses the last
observation and its age, with worst-case motion since. Key-points take some milliseconds and are
not processed on the event loop.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from app.api.schemas.numbers import Data
from app.api.schemas.people import (
    CylinderPerson,
    KeypointsPerson,
    PersonInput,
    PersonState,
    Source,
    Speeds,
    TrackedPerson,
)
from app.api.tracker_sessions import IDLE_S, TrackerSessions
from app.errors import InvalidInput, NotFound
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.core.out_of_range import OutOfRangeValue
from app.sim.human import model as human
from app.sim.human.person import Person
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.perception.keypoints import keypoints_of
from app.sim.perception.observed_people import (
    as_monitored,
    checked_person,
    degradations,
    nearest_index,
    person_anywhere,
    person_from_cylinder,
    person_from_estimate,
)
from app.sim.perception.person_estimator import PersonEstimate
from app.sim.perception.single_frame import estimate_once
from app.sim.pick.task_policy import Decision
from app.sim.scene.scene import arm_of, people_of

_SAME = tuple(range(MAX_PEOPLE))
_PERSON = re.compile(r"^people\[(\d+)\]")


class KnownPerson(NamedTuple):
    """One person of a request, for a policy and for a safety layer."""

    person: Person | None
    """State at present, for the policy; None: a tracker has never seen this person."""
    observed: Person | None
    """Last observed state, for a safety layer; None: no person."""
    source: Source
    """Kind of description in the request."""
    speeds: Speeds
    """Origin of the speeds."""
    age_s: float = 0.0
    """Age of that observation [s]."""
    displaced_m: float = 0.0
    """Distance of its predicted parts from where they were last measured [m]."""
    estimate: PersonEstimate | None = None
    """Estimate from key-points; None without key-points."""

    def use(self, used: bool, dropped: bool = False) -> Data:
        """Return the data of a :class:`PersonUse`.

        Args:
            used: Whether this person is the nearest of those that the policy observes.
            dropped: Whether this person is left out because the request has too many.
        """
        person, observed, estimate = self.person, self.observed, self.estimate
        return {
            "by": self.source,
            "used": used,
            "as_cylinder": person is not None and person.cylinder is not None,
            "monitored_as_cylinder": observed is not None and observed.cylinder is not None,
            "speeds": self.speeds,
            "flags": [
                *(() if estimate is None else estimate.flags),
                *(() if person is None else degradations(person)),
                *(("dropped",) if dropped else ()),
            ],
            **{
                name: [] if estimate is None else list(getattr(estimate, name))
                for name in ("held", "missing", "outliers", "unusable")
            },
            "implausible": None if estimate is None else estimate.implausible,
            "age_s": estimate.age_s if estimate and math.isfinite(estimate.age_s) else None,
        }


class PeopleForPolicy(NamedTuple):
    """The people of a request that a policy may observe: at most four, the nearest."""

    known: tuple[KnownPerson, ...]
    """All people of the request."""
    places: tuple[int, ...]
    """Index in the request of each person that a policy may observe."""
    people: tuple[Person, ...]
    """Their states."""

    def in_request(self, decision: Decision) -> Decision:
        """Return a decision about them with the request's indices of people."""
        if self.places == _SAME[: len(self.places)]:
            return decision
        nearest = decision.nearest_person
        return replace(
            decision,
            nearest_person=None if nearest is None else self.places[nearest],
            outside=renumbered(decision.outside, self.places),
        )

    def uses(self, nearest: int | None) -> list[Data]:
        """Return the data of the use of each person of the request.

        Args:
            nearest: Index in the request of the observed person nearest to the robot.
        """
        return [
            one.use(i == nearest, one.person is not None and i not in self.places)
            for i, one in enumerate(self.known)
        ]


def people_for_policy(
    entries: Sequence[PersonInput], cell: Cell, trackers: TrackerSessions, q: Vec
) -> PeopleForPolicy:
    """Return the people of a request that a policy may observe.

    Args:
        q: The robot's joint positions [rad], shape (6,).

    Raises:
        InvalidInput: An impossible person, with its place.
    """
    known = tuple(
        _known(entry, f"people[{i}].", cell, trackers) for i, entry in enumerate(entries)
    )
    present = {i: one.person for i, one in enumerate(known) if one.person is not None}
    places = tuple(_nearest_places(present, cell, q))
    return PeopleForPolicy(known=known, places=places, people=tuple(present[i] for i in places))


def _nearest_places(people: Mapping[int, Person], cell: Cell, q: Vec) -> list[int]:
    """Return the indices of at most four people, those nearest to the robot, ascending.

    Args:
        people: People by their index in the request.
        q: The robot's joint positions [rad], shape (6,).

    Raises:
        InvalidInput: An impossible state among more than four, with its place.
    """
    if len(people) <= MAX_PEOPLE:
        return list(people)
    left = {i: checked_person(person, f"people[{i}]") for i, person in people.items()}
    arm, shared, near = arm_of(cell), people_of(cell), list[int]()
    while len(near) < MAX_PEOPLE:
        places = list(left)
        nearest = nearest_index(arm, shared, q, list(left.values()))
        assert nearest is not None  # there are more people than selected
        near.append(places[nearest])
        del left[places[nearest]]
    return sorted(near)


def renumbered(
    outside: Sequence[OutOfRangeValue], places: Sequence[int]
) -> tuple[OutOfRangeValue, ...]:
    """Return fields of a decision with the request's indices of people.

    Args:
        outside: Fields; ``people[i]`` is the ``i``-th person used by the policy.
        places: Index in the request of each person used by the policy.
    """

    def in_request(found: re.Match[str]) -> str:
        i = int(found[1])
        return f"people[{places[i] if i < len(places) else i}]"

    return tuple(
        replace(one, field=_PERSON.sub(in_request, one.field, count=1)) for one in outside
    )


def require_all_tracked(entries: Sequence[PersonInput], trackers: TrackerSessions) -> None:
    """Require that a request names every person of each tracker that it names.

    A safety layer does not monitor people who are not named.

    Raises:
        InvalidInput: A person is missing.
    """
    named: dict[str, set[int]] = {}
    for entry in entries:
        if isinstance(entry, TrackedPerson):
            named.setdefault(entry.tracker, set()).add(entry.person)
    for session in trackers.all() if named else ():
        people = named.get(session.id)
        if people is not None and (missing := set(range(session.n_people)) - people):
            rule = (
                f"must name all {session.n_people} people of the tracker {session.id}, because "
                f"others are not monitored; left out: {', '.join(map(str, sorted(missing)))}"
            )
            raise InvalidInput("people", sorted(people), rule)


def is_slow_conversion(entries: Sequence[PersonInput]) -> bool:
    """Whether the conversion of people takes milliseconds."""
    return any(isinstance(entry, KeypointsPerson | TrackedPerson) for entry in entries)


def _known(
    entry: PersonInput, place: str, cell: Cell, trackers: TrackerSessions
) -> KnownPerson:
    if isinstance(entry, PersonState):
        person = entry.to_domain(cell, place)
        return KnownPerson(
            person=person, observed=person, source="joint-angles", speeds="given"
        )
    if isinstance(entry, CylinderPerson):
        seen = entry.x, entry.y, entry.vx, entry.vy, entry.r, entry.growth
        person = person_from_cylinder(*seen, past=entry.remembered())
        return KnownPerson(person=person, observed=person, source="cylinder", speeds="given")
    if isinstance(entry, KeypointsPerson):
        return _from_keypoints(entry, place, cell)
    return _from_tracker(entry, place, cell, trackers)


def _from_keypoints(entry: KeypointsPerson, place: str, cell: Cell) -> KnownPerson:
    points, trust = entry.points()
    size = cell.body if entry.body is None else entry.body.size(cell)
    speeds = entry.speeds()
    estimate = estimate_once(points, size, trust, speeds, place, cell.floor_z)
    person = person_from_estimate(estimate)
    monitored = as_monitored(estimate)
    assert person is not None and monitored is not None  # there is always a cylinder
    is_same = (monitored.cylinder is None) == (person.cylinder is None)
    return KnownPerson(
        person=person,
        observed=person if is_same else monitored,
        source="keypoints",
        speeds="zero" if speeds is None else "given",
        estimate=estimate,
    )


def _from_tracker(
    entry: TrackedPerson, place: str, cell: Cell, trackers: TrackerSessions
) -> KnownPerson:
    def refused(member: str, value: object, rule: str) -> InvalidInput:
        return InvalidInput(f"{place}{member}", value, rule)

    try:
        session = trackers.get(entry.tracker)
    except NotFound:
        rule = f"is not an open tracker; an unused one is deleted after {IDLE_S:g} s"
        raise refused("tracker", entry.tracker, rule) from None
    if session.cell != cell.name:
        rule = f"must be a tracker of the cell {cell.name}, not {session.cell}"
        raise refused("tracker", entry.tracker, rule)
    if entry.person >= session.n_people:
        rule = f"must be less than {session.n_people}, the tracker's number of people"
        raise refused("person", entry.person, rule)
    known, i = session.people(entry.t), entry.person
    estimate, last = known.estimates[i], known.observed[i]
    observed = None if last is None else as_monitored(last)
    if observed is None and "stale" in estimate.flags:
        observed = person_anywhere()
    return KnownPerson(
        person=person_from_estimate(estimate),
        observed=observed,
        age_s=known.observed_age_s[i],
        displaced_m=0.0 if last is None else last.displaced_m,
        source="tracker",
        speeds="estimated",
        estimate=estimate,
    )


def warm_up(cell: Cell) -> None:
    """Compile the kernels for key-points and several people."""
    q = human.rest_posture(0.0, 1.5, -1.5)
    points = keypoints_of(q, cell.body, cell.floor_z)
    seen = person_from_estimate(
        estimate_once(points, cell.body, velocities=np.zeros_like(points))
    )
    assert seen is not None
    people = (seen, person_from_cylinder(1.0, 1.5, 0.0, 0.0, 0.4))
    nearest_index(arm_of(cell), people_of(cell), np.array(cell.robot.home_q), people)
