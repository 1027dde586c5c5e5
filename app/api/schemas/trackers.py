"""Trackers of key-points: frames in, estimates of people out."""

from dataclasses import asdict
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field

from app.api.schemas.examples import FRAME, shows
from app.api.schemas.numbers import Answer, Body, Time
from app.api.schemas.people import IMPLAUSIBLE, UNUSABLE, BodyPercentiles, KeypointsSeen
from app.api.tracker_sessions import IDLE_S, TrackedPeople, TrackerSession
from app.sim.perception.bounding_cylinder import SafetyCylinder
from app.sim.perception.multi_person_tracker import MAX_SKELETONS
from app.sim.perception.person_estimator import PersonEstimate


class TrackerCreate(Body):
    """A tracker to be listened to."""

    cell: str = Field(description="name of the work cell", examples=["pick-and-place"])
    n_people: Annotated[int, Field(ge=1, le=4)] = Field(1, description="most people at once")
    body: BodyPercentiles | None = Field(
        None, description="size of these people; the cell's person if null"
    )


class TrackerPublic(Answer):
    """One tracker that is listened to."""

    id: str
    cell: str
    n_people: int
    n_frames: int = Field(description="frames taken in")
    t: float | None = Field(description="time of its newest frame [s]")
    idle_limit_s: float = Field(description="unused for so long it ends [s]")

    @classmethod
    def from_domain(cls, session: TrackerSession) -> Self:
        """Make it from a session."""
        return cls(
            id=session.id,
            cell=session.cell,
            n_people=session.n_people,
            n_frames=session.n_frames,
            t=session.t,
            idle_limit_s=IDLE_S,
        )


class TrackerList(Answer):
    """All trackers that are listened to."""

    items: list[TrackerPublic]


class FrameCreate(Body):
    """One frame of all people, in any order."""

    model_config = shows(FRAME)

    t: Time = Field(description="when the frame was taken, on the tracker's clock [s]")
    people: list[KeypointsSeen] = Field(
        max_length=MAX_SKELETONS,
        description="people in the frame; nobody: an empty list; of more than the tracker "
        "follows, the nearest to the robot's base are followed",
    )


class CylinderPublic(Answer):
    """The safety cylinder of METHOD 2.8."""

    center: list[float] = Field(description="x, y of the axis [m]")
    radius: float = Field(description="radius with factor and flesh margin [m]")
    bottom: float = Field(description="lowest point of what is seen [m]")
    top: float = Field(description="highest point with the flesh margin [m]")
    velocity: list[float] = Field(description="velocity of the axis [m/s]")

    @classmethod
    def from_domain(cls, cylinder: SafetyCylinder) -> Self:
        """Make it from the estimate's."""
        return cls(
            center=cylinder.center.tolist(),
            radius=cylinder.radius,
            bottom=cylinder.bottom,
            top=cylinder.top,
            velocity=cylinder.velocity.tolist(),
        )


class EstimatePublic(Answer):
    """What is known of one person."""

    person: int = Field(description="which of the tracker's people")
    q: list[float] | None = Field(
        description="joint positions [m, rad]; null: not known yet, or the model does not fit"
    )
    qd: list[float] | None = Field(description="joint speeds [m/s, rad/s]")
    cylinder: CylinderPublic | None = Field(description="null where nobody was ever seen")
    age_s: float | None = Field(
        description="time since the newest credible key-point [s]; null where there was none"
    )
    stale: bool = Field(description="whether nothing credible was seen lately")
    flags: list[str] = Field(description="how the estimate is degraded; empty where it is not")
    held: list[str] = Field(description="joints that keep their angle: nothing shows them")
    missing: list[str] = Field(description="key-points unseen for longer than the hold time")
    strays: list[str] = Field(description="key-points dropped: too far from all others")
    unusable: list[str] = Field(description=UNUSABLE)
    implausible: str | None = Field(description=IMPLAUSIBLE)
    misfit_m: float | None = Field(
        description="median distance of the model's joints from the key-points [m]"
    )

    @classmethod
    def from_domain(cls, index: int, estimate: PersonEstimate) -> Self:
        """Make it from the estimate."""
        person, cylinder = estimate.person, estimate.cylinder
        return cls(
            person=index,
            q=None if person is None else person.q.tolist(),
            qd=None if person is None else person.qd.tolist(),
            cylinder=None if cylinder is None else CylinderPublic.from_domain(cylinder),
            age_s=estimate.age_s if np.isfinite(estimate.age_s) else None,
            stale=estimate.stale,
            flags=list(estimate.flags),
            held=list(estimate.held),
            missing=list(estimate.missing),
            strays=list(estimate.strays),
            unusable=list(estimate.unusable),
            implausible=estimate.implausible,
            misfit_m=estimate.misfit_m if np.isfinite(estimate.misfit_m) else None,
        )


class UnfollowedPublic(Answer):
    """A person in the newest frame that the tracker does not follow."""

    index: int = Field(description="place in the frame's `people`")
    reason: Literal["farther", "jump", "foreign-frame"] = Field(
        description="farther away than those who are followed are, or may be where they are "
        "not seen; not credible yet, as in `jump`; another frame or unit"
    )
    distance_m: float | None = Field(
        description="horizontal distance of the nearest key-point to the robot's base [m]; "
        "null: unknown"
    )
    detail: str | None = Field(description=IMPLAUSIBLE)


class EstimatesPublic(Answer):
    """What is known of a tracker's people at one time."""

    tracker: str
    t: float | None = Field(
        description="time the estimates are for, on the tracker's clock [s]; null before the "
        "first frame"
    )
    people: list[EstimatePublic]
    unfollowed: list[UnfollowedPublic] = Field(
        description="people in the newest frame that are not followed, nearest first"
    )

    @classmethod
    def from_domain(cls, tracker: str, known: TrackedPeople) -> Self:
        """Make it from what is known of a tracker's people."""
        people = [EstimatePublic.from_domain(i, one) for i, one in enumerate(known.estimates)]
        rest = [UnfollowedPublic(**asdict(one)) for one in known.unfollowed]
        return cls(tracker=tracker, t=known.t, people=people, unfollowed=rest)
