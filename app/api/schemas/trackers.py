"""Trackers of key-points: frames in, estimates of people out."""

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field

from app.api.schemas.examples import FRAME, TRACKER, shows
from app.api.schemas.numbers import Answer, Body, Listed, Time
from app.api.schemas.people import IMPLAUSIBLE, UNUSABLE, BodyPercentiles, KeypointDetection
from app.api.tracker_sessions import TrackedPeople
from app.sim.perception.multi_person_tracker import MAX_SKELETONS
from app.sim.perception.person_estimator import PersonEstimate


class TrackerCreate(Body):
    """A tracker to open."""

    model_config = shows(TRACKER)

    cell: str = Field(description="name of the work cell", examples=["pick-and-place"])
    n_people: Annotated[int, Field(ge=1, le=4)] = Field(
        1, description="largest number of people"
    )
    body: BodyPercentiles | None = Field(
        None, description="size of these people; that of the cell's person if null"
    )


class TrackerPublic(Answer):
    """An open tracker."""

    id: str
    cell: str
    n_people: int
    n_frames: int = Field(description="number of accepted frames")
    t: float | None = Field(description="time of its newest frame [s]")
    idle_limit_s: float = Field(description="time until an unused tracker is deleted [s]")


class TrackerList(Answer):
    """All open trackers."""

    items: list[TrackerPublic]


class FrameCreate(Body):
    """A frame of all people, in any order."""

    model_config = shows(FRAME)

    t: Time = Field(description="time of the frame, on the tracker's clock [s]")
    people: list[KeypointDetection] = Field(
        max_length=MAX_SKELETONS,
        description="people in the frame, may be empty; of more people than tracks, the "
        "nearest to the robot's base are followed",
    )


class CylinderPublic(Answer):
    """Safety cylinder of a person (docs/method.md 2.8)."""

    center: Listed = Field(description="x, y of the axis [m]")
    radius: float = Field(description="radius with factor and flesh margin [m]")
    bottom: float = Field(description="lowest corner of the box of the observed body [m]")
    top: float = Field(
        description="highest corner of this box with the flesh margin, or the height that "
        "unseen points may reach [m]"
    )
    velocity: Listed = Field(description="velocity of the axis [m/s]")


class EstimatePublic(Answer):
    """Estimate of one person."""

    person: int = Field(description="index of the track")
    q: Listed | None = Field(
        description="joint positions [m, rad]; null: unknown yet, or the model does not fit"
    )
    qd: Listed | None = Field(description="joint speeds [m/s, rad/s]")
    cylinder: CylinderPublic | None = Field(description="null before the first observation")
    age_s: float | None = Field(
        description="time since the newest credible key-point [s]; null where there was none"
    )
    stale: bool = Field(description="whether the last credible observation is too old")
    flags: list[str] = Field(description="degradations of the estimate")
    held: list[str] = Field(description="unobserved joints at their last angle")
    missing: list[str] = Field(description="key-points missing for longer than the hold time")
    outliers: list[str] = Field(description="key-points dropped: too far from all others")
    unusable: list[str] = Field(description=UNUSABLE)
    implausible: str | None = Field(description=IMPLAUSIBLE)
    misfit_m: float | None = Field(
        description="median distance of the model's joints from the key-points [m]"
    )

    @classmethod
    def from_domain(cls, index: int, estimate: PersonEstimate) -> Self:
        """Return the schema of an estimate."""
        person = estimate.person
        age, misfit = (
            one if np.isfinite(one) else None for one in (estimate.age_s, estimate.misfit_m)
        )
        return cls.from_object(
            estimate,
            person=index,
            q=None if person is None else person.q,
            qd=None if person is None else person.qd,
            age_s=age,
            misfit_m=misfit,
        )


class UnassignedDetectionPublic(Answer):
    """A person of the newest frame without a track."""

    index: int = Field(description="index in the frame's `people`")
    reason: Literal["farther", "jump", "foreign-frame"] = Field(
        description="farther away than all tracks are or may be; not credible yet; another "
        "frame or unit"
    )
    distance_m: float | None = Field(
        description="horizontal distance of the nearest key-point to the robot's base [m]; "
        "null: unknown"
    )
    detail: str | None = Field(description=IMPLAUSIBLE)


class EstimatesPublic(Answer):
    """Estimates of a tracker's people at one time."""

    tracker: str
    t: float | None = Field(
        description="time of the estimates, on the tracker's clock [s]; null before the first "
        "frame"
    )
    people: list[EstimatePublic]
    unassigned: list[UnassignedDetectionPublic] = Field(
        description="people of the newest frame without a track, nearest first"
    )

    @classmethod
    def from_domain(cls, tracker: str, known: TrackedPeople) -> Self:
        """Return the schema of a tracker's people."""
        people = [EstimatePublic.from_domain(i, one) for i, one in enumerate(known.estimates)]
        return cls.from_object(known, tracker=tracker, people=people)
