"""From the people of a request to the people a policy decides beside.

Whatever describes them becomes a :class:`~app.sim.ports.Person`, with a note of how good that
is. Key-points take some milliseconds: away from the event loop.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from app.api.schemas.people import (
    CylinderPerson,
    KeypointsPerson,
    PersonInput,
    PersonState,
    PersonUse,
    Source,
    Speeds,
    TrackedPerson,
)
from app.api.tracker_sessions import IDLE_S, TrackerSessions
from app.errors import InvalidInput, NotFound
from app.sim import human
from app.sim.cells import Cell
from app.sim.keypoints import keypoints_of
from app.sim.person_estimate import PersonEstimate
from app.sim.ports import Person
from app.sim.scene import arm_of, people_of
from app.sim.seen_people import as_person, nearest_index, standing_in
from app.sim.single_frame import estimate_once


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownPerson:
    """One person as a policy takes them, and where that is from."""

    person: Person
    """Joints, size, perhaps a cylinder."""
    source: Source
    """What the request told."""
    speeds: Speeds
    """Where the speeds are from."""
    estimate: PersonEstimate | None = None
    """What key-points told; None where there were none."""

    def use(self, seen: bool) -> PersonUse:
        """Return what the answer says of this person."""
        return PersonUse.from_domain(self.source, seen, self.speeds, self.person, self.estimate)


def known_people(
    entries: Sequence[PersonInput], cell: Cell, trackers: TrackerSessions
) -> tuple[KnownPerson, ...]:
    """Return the people of a request.

    Args:
        entries: As the request has them.
        cell: The work cell it names.
        trackers: Those that are listened to.

    Raises:
        InvalidInput: Somebody who cannot be, with the place in the request.
    """
    return tuple(
        _known(entry, f"people[{i}].", cell, trackers) for i, entry in enumerate(entries)
    )


def take_time(entries: Sequence[PersonInput]) -> bool:
    """Return whether making persons of these takes more than a moment."""
    return any(isinstance(entry, KeypointsPerson | TrackedPerson) for entry in entries)


def _known(
    entry: PersonInput, place: str, cell: Cell, trackers: TrackerSessions
) -> KnownPerson:
    if isinstance(entry, PersonState):
        person = entry.to_domain(cell, place)
        return KnownPerson(person=person, source="joint-angles", speeds="given")
    if isinstance(entry, CylinderPerson):
        seen = entry.x, entry.y, entry.vx, entry.vy, entry.r, entry.growth
        person = standing_in(*seen, past=entry.remembered())
        return KnownPerson(person=person, source="cylinder", speeds="given")
    if isinstance(entry, KeypointsPerson):
        return _from_keypoints(entry, place, cell)
    return _from_tracker(entry, place, cell, trackers)


def _from_keypoints(entry: KeypointsPerson, place: str, cell: Cell) -> KnownPerson:
    points, trust = entry.points()
    size = cell.body if entry.body is None else entry.body.size(cell)
    speeds = entry.speeds()
    estimate = estimate_once(points, size, trust, speeds, place, cell.floor_z)
    person = as_person(estimate)
    assert person is not None  # estimate_once always tells a cylinder
    said: Speeds = "zero" if speeds is None else "given"
    return KnownPerson(person=person, source="keypoints", speeds=said, estimate=estimate)


def _from_tracker(
    entry: TrackedPerson, place: str, cell: Cell, trackers: TrackerSessions
) -> KnownPerson:
    def refused(member: str, value: object, rule: str) -> InvalidInput:
        return InvalidInput(f"{place}{member}", value, rule)

    try:
        session = trackers.get(entry.tracker)
    except NotFound:
        rule = f"is no open tracker; one that nobody uses ends after {IDLE_S:g} s"
        raise refused("tracker", entry.tracker, rule) from None
    if session.cell != cell.name:
        rule = f"must watch the cell {cell.name}, not {session.cell}"
        raise refused("tracker", entry.tracker, rule)
    if entry.person >= session.n_people:
        rule = f"must be less than {session.n_people}, the people this tracker follows"
        raise refused("person", entry.person, rule)
    try:
        _, estimates = session.estimates(entry.t)
    except InvalidInput as error:
        raise refused(error.field, error.value, error.rule) from None
    estimate = estimates[entry.person]
    person = as_person(estimate)
    if person is None:
        raise refused("person", entry.person, "has never been seen by this tracker")
    return KnownPerson(person=person, source="tracker", speeds="estimated", estimate=estimate)


def warm_up(cell: Cell) -> None:
    """Compile what key-points and several people need, before the first request."""
    q = human.rest_posture(0.0, 1.5, -1.5)
    points = keypoints_of(q, cell.body, cell.floor_z)
    seen = as_person(estimate_once(points, cell.body, velocities=np.zeros_like(points)))
    assert seen is not None
    people = (seen, standing_in(1.0, 1.5, 0.0, 0.0, 0.4))
    nearest_index(arm_of(cell), people_of(cell), np.array(cell.robot.home_q), people)
