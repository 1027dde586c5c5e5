"""``POST /v1/motion``: state, people and goal in, the next trajectory segment out."""

from collections.abc import Sequence
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from app.api.schemas.examples import MOTION, shows
from app.api.schemas.numbers import Answer, Body, Data, Vector3, Vector6, Word
from app.api.schemas.people import PersonInput, PersonUse
from app.api.schemas.robot_state import ROS_NAMES, ArmState
from app.api.schemas.separation import Override, SafetyInput
from app.api.schemas.task_selection import (
    FRAME_TEXT,
    FrameName,
    OutOfRangeInput,
    Stamp,
    TimeLeft,
)
from app.sim.core.arrays import Vec
from app.sim.human.person import Person
from app.sim.perception.multi_person_tracker import MAX_SKELETONS
from app.sim.reach.motion_types import (
    MotionDecision,
    MotionMode,
    MotionQuery,
    PersonWeighting,
)
from app.sim.robot.trajectory_segment import TrajectorySegment
from app.sim.safety.decision import SafetyDecision, powers_of_time
from app.sim.safety.layer import SafetySettings


class MotionRequest(Body):
    """A state and a goal; requests are independent."""

    model_config = shows(MOTION)

    cell: str = Field(
        max_length=64, description="name of the work cell", examples=["shared-workspace"]
    )
    frame: FrameName = Field("robot-base", description=FRAME_TEXT)
    stamp: Stamp = Field(None, description="your time of the state; returned unchanged")
    robot: ArmState
    people: list[PersonInput] = Field(
        max_length=MAX_SKELETONS,
        description="people in the cell, each as joint angles, key-points, a cylinder or a "
        "track; of more than four the policy uses the nearest four, the others are flagged "
        "`dropped`; the safety layer monitors all",
    )
    goal: Vector3 = Field(description="goal of the tool, in `frame` [m]")
    inference_mode: MotionMode | None = Field(
        None,
        description="`interpolated`: weighted mean of the policy's actions for the training "
        "targets around the goal; `direct`: its action for the goal itself; null: interpolated "
        "where the policy has targets",
    )
    person_weighting: PersonWeighting = Field(
        "nearest",
        description="several people: the policy's action for the nearest, or the mean of its "
        "actions for each, weighted by distance",
    )
    rollout: bool | None = Field(
        None,
        description="whether the decision is simulated forward with the policy beside people "
        "of predicted motion, and replaced where that ends in a contact; null: where the "
        "policy supports it",
    )
    time_left_s: TimeLeft = Field(
        5.0,
        description="time left to reach the goal [s]; clamped to 0 to 5 for the policy; up to "
        "4, alternatives are simulated as with `elapsed_s` from 1 on",
    )
    elapsed_s: Annotated[float, Field(ge=0.0, le=1e9)] = Field(
        0.0,
        description="time since this goal was set [s]; from 1 on, alternatives are simulated "
        "also where the policy's motion neither succeeds nor collides",
    )
    safety: SafetyInput | None = Field(
        SafetyInput(),
        description="speed and separation monitoring: the cell's settings by default; null "
        "disables it, and people who overlap the robot are then refused",
    )
    age_s: Annotated[float, Field(ge=0.0, le=1e9)] = Field(
        0.0,
        description="age of the observations beyond `tracker_delay` [s]; the age of a "
        "tracker's observation is added",
    )
    checkpoint: Word | None = Field(
        None, description="SHA-256 or alias; the shipped policy if null"
    )

    def to_domain(
        self,
        people: Sequence[Person],
        observed: Sequence[Person] | None,
        own: SafetySettings,
        age_s: float,
        displaced_m: float,
    ) -> MotionQuery:
        """Return the query.

        Args:
            people: The people for the policy.
            observed: The people as last observed; None: like ``people``.
            own: The cell's safety settings.
            age_s: Age of the oldest observation of a tracker [s].
            displaced_m: Distance of people from where they were observed [m]; it counts as
                the time in which they move as far, unless the settings say that they stand.
        """
        robot = self.robot
        safety = None if self.safety is None else self.safety.to_domain(own)
        if safety is not None and safety.human_speed > 0.0:
            age_s += displaced_m / safety.human_speed
        return MotionQuery(
            q=robot.joints(robot.q),
            qd=robot.joints(robot.qd),
            qdd=None if robot.qdd is None else robot.joints(robot.qdd),
            goal=np.array(self.goal),
            people=people,
            observed=observed,
            inference_mode=self.inference_mode,
            person_weighting=self.person_weighting,
            rollout=self.rollout,
            time_left_s=self.time_left_s,
            elapsed_s=self.elapsed_s,
            safety=safety,
            age_s=self.age_s + age_s,
        )


class SegmentPublic(Answer):
    """Trajectory of one control period as polynomials in time, and its end."""

    coefficients: list[list[float]] = Field(
        description="per joint, base to wrist 3, the coefficients of t^0, t^1, ... [rad/s^n]"
    )
    until: float = Field(
        description="end of their validity [s]: the period, or less where the robot stops in it"
    )
    q: Vector6 = Field(description="joint positions at the end of the period [rad]")
    qd: Vector6 = Field(description="joint speeds there [rad/s]")
    qdd: Vector6 = Field(description="joint accelerations there [rad/s^2]")

    @staticmethod
    def commanded(segment: TrajectorySegment, q: Vec, qd: Vec, dt: float) -> Data:
        """Return the data of the policy's segment from joint positions and speeds."""
        parts = [q, qd, segment.c]
        if segment.d.any():
            parts.append(segment.d)
        return SegmentPublic._data(np.array(parts).T, dt, segment)

    @staticmethod
    def executed(safe: SafetyDecision, query: MotionQuery, dt: float) -> Data:
        """Return the data of the segment scaled by monitoring."""
        powers = powers_of_time(safe, query.q, query.qd)
        used = np.flatnonzero(powers.any(axis=0))
        n = max(3, int(used[-1]) + 1 if used.size else 0)
        until = dt if safe.path_deceleration * dt <= 1.0 else 1.0 / safe.path_deceleration
        return SegmentPublic._data(powers[:, :n], until, safe)

    @staticmethod
    def _data(powers: Vec, until: float, end: TrajectorySegment | SafetyDecision) -> Data:
        return {
            "coefficients": powers.tolist(),
            "until": until,
            "q": end.q.tolist(),
            "qd": end.qd.tolist(),
            "qdd": end.qdd.tolist(),
        }


class Target(Answer):
    """A training target of the interpolation."""

    position: Vector3 = Field(description="[m]")
    weight: float = Field(description="its weight; the sum is 1")


class Distances(Answer):
    """Clearances of the robot at its position [m]; 1000 without people."""

    people: float
    cell: float
    robot: float = Field(description="between its own links")


class WeightedPerson(PersonUse):
    """Use of one person, with distance and weight."""

    separation: float | None = Field(
        description="distance to the robot [m], negative for an overlap; null: never seen, or "
        "dropped"
    )
    weight: float = Field(description="weight of the action beside this person")


LeftOut = Literal["search", "rollout"]
"""Parts of a decision that a late request on a socket is answered without."""


class StreamUse(Answer):
    """How a request on a socket was served."""

    waited_ms: float = Field(description="time from its arrival to its decision [ms]")
    missed_deadline: bool = Field(description="whether it is answered after its deadline")
    superseded: int = Field(
        description="number of earlier requests that are not answered, since the last answer"
    )
    left_out: list[LeftOut] = Field(
        description="parts left out because it had waited for long: the `search` for "
        "alternatives where the policy's motion collides with nobody, then the whole `rollout`"
    )


class MotionAnswer(Answer):
    """The next trajectory segment with its explanation."""

    joints: list[str] = Field(
        default=list(ROS_NAMES), description="order of the joints in all vectors"
    )
    dt: float = Field(description="control period [s]")
    segment: SegmentPublic = Field(description="trajectory to execute")
    commanded: SegmentPublic = Field(description="trajectory of the policy, before scaling")
    act: Vector6 = Field(
        description="action, -1 to 1 per joint: the policy's, or the first of the alternative"
    )
    inference_mode: MotionMode
    rollout: bool = Field(description="whether the decision was simulated forward")
    alternative: str | None = Field(
        description="candidate executed instead of the policy's action: its first waypoint and "
        "duration, or the motion of pan, shoulder and elbow (f: forward, b: back, h: held); "
        "null: the policy's action"
    )
    targets: list[Target] = Field(description="interpolated targets; empty for `direct`")
    safety: Override | None = Field(description="null where monitoring is disabled")
    people: list[WeightedPerson] = Field(description="use of each person")
    clearance: Distances
    distance: float = Field(description="tool to goal [m]")
    beyond_reach: float = Field(
        description="distance of the goal beyond the reach of the arm [m]"
    )
    unfeasible: bool = Field(
        description="whether a joint cannot keep its limits from this state; it then brakes, "
        "or returns to them"
    )
    state_outside: list[OutOfRangeInput] = Field(
        description="measured joints outside their limits, clamped for the policy; `segment` "
        "and monitoring use the measured positions and speeds"
    )
    outside: list[OutOfRangeInput] = Field(description="inputs outside the training range")
    checkpoint: str = Field(description="SHA-256 of the checkpoint")
    elapsed_ms: float = Field(description="time of the decision [ms]")
    stamp: Stamp = None
    stream: StreamUse | None = Field(default=None, description="null but on a socket")

    @staticmethod
    def data_of(
        decision: MotionDecision,
        query: MotionQuery,
        people: list[Data],
        dt: float,
        stamp: Stamp,
    ) -> Data:
        """Return the data of the answer of a decision."""
        segment = SegmentPublic.commanded(decision.segment, query.q, query.qd, dt)
        commanded, safe = segment, decision.safe
        if safe is not None and safe.override < 1.0:
            segment = SegmentPublic.executed(safe, query, dt)
        to_people, to_cell, to_itself = decision.clearance
        return {
            "joints": ROS_NAMES,
            "dt": dt,
            "segment": segment,
            "commanded": commanded,
            "act": decision.act.tolist(),
            "inference_mode": decision.inference_mode,
            "rollout": decision.rollout,
            "alternative": decision.candidate,
            "targets": [{"position": p, "weight": w} for p, w in decision.targets],
            "safety": Override.data_of(decision),
            "people": people,
            "clearance": {"people": to_people, "cell": to_cell, "robot": to_itself},
            "distance": decision.distance,
            "beyond_reach": decision.beyond_reach,
            "unfeasible": decision.unfeasible,
            "state_outside": decision.state_outside,
            "outside": decision.outside,
            "checkpoint": decision.checkpoint,
            "elapsed_ms": decision.elapsed_ms,
            "stamp": stamp,
            "stream": None,
        }
