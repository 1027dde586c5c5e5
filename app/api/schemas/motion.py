"""``POST /v1/motion``: state, people and goal in, the next trajectory segment out."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Self

import numpy as np
from pydantic import Field

from app.api.schemas.examples import MOTION, shows
from app.api.schemas.numbers import Answer, Body, Vector3, Vector6
from app.api.schemas.people import PersonInput, PersonUse
from app.api.schemas.robot_state import ROS_NAMES, RobotState
from app.api.schemas.task_selection import FRAME_TEXT, FrameName, Outside, Stamp
from app.sim.core.arrays import Vec
from app.sim.human.model import CAPSULE_NAMES
from app.sim.human.person import Person
from app.sim.perception.multi_person_tracker import MAX_SKELETONS
from app.sim.reach.motion_types import (
    Beside,
    MotionDecision,
    MotionMode,
    MotionQuestion,
    PersonWeight,
)
from app.sim.robot.trajectory_segment import TrajectorySegment
from app.sim.safety.decision import SafetyDecision, SeparationTerms, powers_of_time
from app.sim.safety.layer import SafetySettings

Metres = Annotated[float, Field(ge=0.0, le=5.0)]
Seconds = Annotated[float, Field(ge=0.0, le=5.0)]


class ArmState(RobotState):
    """Measured state of the robot, with accelerations."""

    qdd: Vector6 | None = Field(
        None,
        description="joint accelerations [rad/s^2], in the same order; required by policies "
        "with jerk limits",
    )


class SafetyInput(Body):
    """Assumptions of speed and separation monitoring; null keeps the value of the cell."""

    human_speed: Annotated[float, Field(ge=0.0, le=10.0)] | None = Field(
        default=None, description="greatest speed of any point of a person, v_h [m/s]"
    )
    use_measured_velocity: bool | None = Field(
        default=None,
        description="whether people given as cylinders are extrapolated with their own "
        "velocity (`vx`, `vy`, `growth`), which must then be measured, instead of with "
        "`human_speed` in any direction; people in other forms are not",
    )
    speed_change: Annotated[float, Field(ge=0.0, le=10.0)] | None = Field(
        default=None,
        description="assumed excess over that velocity, in any direction [m/s]",
    )
    reaction_time: Seconds | None = Field(
        default=None, description="time from a decision to its effect, a part of T_r [s]"
    )
    tracker_delay: Seconds | None = Field(
        default=None,
        description="age of the tracker's data on arrival, a part of T_r [s]",
    )
    intrusion_distance: Metres | None = Field(default=None, description="C [m]")
    person_uncertainty: Metres | None = Field(default=None, description="Z_d [m]")
    robot_uncertainty: Metres | None = Field(default=None, description="Z_r [m]")
    protective_distance: Metres | None = Field(
        default=None, description="additional distance to people while the robot moves [m]"
    )
    pfl: bool | None = Field(
        default=None,
        description="power and force limiting: whether contact is allowed at the speed limits "
        "of body parts",
    )

    def to_domain(self, own: SafetySettings) -> SafetySettings:
        """Return the settings of the cell with the given values in their place."""
        given = self.model_dump(exclude_none=True)
        return replace(own, **given) if given else own


class MotionRequest(Body):
    """A state and a goal; requests are independent."""

    model_config = shows(MOTION)

    cell: str = Field(
        max_length=64, description="name of the work cell", examples=["shared-workspace"]
    )
    frame: FrameName = Field("robot-base", description=FRAME_TEXT)
    stamp: Stamp = Field(None, description="your time of the state; returned unchanged")
    robot: ArmState
    people: Sequence[PersonInput] = Field(
        max_length=MAX_SKELETONS,
        description="people in the cell, each as joint angles, key-points, a cylinder or a "
        "track; of more than four the nearest four are used, the others are flagged `dropped`",
    )
    goal: Vector3 = Field(description="goal of the tool, in `frame` [m]")
    inference_mode: MotionMode | None = Field(
        None,
        description="`interpolated`: weighted mean of the policy's actions for the training "
        "targets around the goal; `direct`: its action for the goal itself; null: interpolated "
        "where the policy has targets",
    )
    beside: Beside = Field(
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
    time_left_s: Annotated[float, Field(ge=-1e9, le=1e9)] = Field(
        5.0,
        description="time left to reach the goal [s]; clamped to 0 to 5 for the policy",
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
    checkpoint: str | None = Field(
        None, max_length=64, description="SHA-256 or alias; the shipped policy if null"
    )

    def to_domain(
        self,
        people: Sequence[Person],
        observed: Sequence[Person] | None,
        own: SafetySettings,
        age_s: float,
    ) -> MotionQuestion:
        """Return the question.

        Args:
            people: The people for the policy.
            observed: The people as last observed; None: like ``people``.
            own: The cell's safety settings.
            age_s: Age of the oldest observation of a tracker [s].
        """
        robot = self.robot
        return MotionQuestion(
            q=robot.joints(robot.q),
            qd=robot.joints(robot.qd),
            qdd=None if robot.qdd is None else robot.joints(robot.qdd),
            goal=np.array(self.goal),
            people=people,
            observed=observed,
            inference_mode=self.inference_mode,
            beside=self.beside,
            rollout=self.rollout,
            time_left_s=self.time_left_s,
            elapsed_s=self.elapsed_s,
            safety=None if self.safety is None else self.safety.to_domain(own),
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

    @classmethod
    def commanded(cls, piece: TrajectorySegment, question: MotionQuestion, dt: float) -> Self:
        """Return the segment commanded by the policy."""
        parts = [question.q, question.qd, piece.c]
        if piece.d.any():
            parts.append(piece.d)
        return cls(
            coefficients=np.stack(parts, axis=1).tolist(),
            until=dt,
            q=piece.q.tolist(),
            qd=piece.qd.tolist(),
            qdd=piece.qdd.tolist(),
        )

    @classmethod
    def executed(cls, safe: SafetyDecision, question: MotionQuestion, dt: float) -> Self:
        """Return the segment scaled by monitoring."""
        powers = powers_of_time(safe, question.q, question.qd)
        used = np.flatnonzero(powers.any(axis=0))
        n = max(3, int(used[-1]) + 1 if used.size else 0)
        return cls(
            coefficients=powers[:, :n].tolist(),
            until=dt if safe.path_deceleration * dt <= 1.0 else 1.0 / safe.path_deceleration,
            q=safe.q.tolist(),
            qd=safe.qd.tolist(),
            qdd=safe.qdd.tolist(),
        )


class Target(Answer):
    """A training target of the interpolation."""

    position: Vector3 = Field(description="[m]")
    weight: float = Field(description="its weight; the sum is 1")


class Terms(Answer):
    """Protective separation distance S_p of ISO/TS 15066, term by term."""

    person: int = Field(description="index in `people`")
    link: str = Field(description="nearest link of the robot")
    separation: float = Field(description="observed distance [m]")
    required: float = Field(
        description="v_h (T_r + T_s) + v_r T_r + B + C + Z_d + Z_r + protective distance [m]"
    )
    human_speed: float = Field(
        description="v_h [m/s]; the measured velocity's component toward the link plus "
        "`speed_change`, where velocities are measured"
    )
    robot_speed: float = Field(description="v_r, bound of that link's speed [m/s]")
    reaction_time: float = Field(description="T_r: period, reaction, delay and age [s]")
    stop_time: float = Field(description="T_s [s]")
    braking: float = Field(description="B [m]")
    intrusion: float = Field(description="C [m]")
    person_uncertainty: float = Field(description="Z_d [m]")
    robot_uncertainty: float = Field(description="Z_r [m]")
    protective_distance: float = Field(description="additional distance [m]")

    @classmethod
    def from_domain(cls, person: int, terms: SeparationTerms) -> Self:
        """Return the schema of the simulator's terms."""
        return cls(
            person=person,
            link=terms.link,
            separation=terms.separation,
            required=terms.required,
            human_speed=terms.human_speed,
            robot_speed=terms.robot_speed,
            reaction_time=terms.reaction_time,
            stop_time=terms.stop_time,
            braking=terms.braking,
            intrusion=terms.intrusion,
            person_uncertainty=terms.person_uncertainty,
            robot_uncertainty=terms.robot_uncertainty,
            protective_distance=terms.protective_distance,
        )


class Override(Answer):
    """Speed override by monitoring, and its cause."""

    override: float = Field(description="override at the end of the period, 0 (a stop) to 1")
    set_by: int | None = Field(description="person that limits it: index in `people`, or null")
    part: str | None = Field(description="body part of that person; null for a cylinder")
    lacking: float = Field(
        description="violation of the separation distance on the refused motion [m]"
    )
    stop_distance: float = Field(
        description="bound of the distance of any point of the robot in a stop [m]"
    )
    terms: Terms | None = Field(
        description="S_p of that person, else of the nearest; null without people"
    )

    @classmethod
    def from_domain(cls, decision: MotionDecision) -> Self | None:
        """Return the override of a decision; None without monitoring."""
        safe, whose, terms = decision.safe, decision.terms_of, decision.terms
        if safe is None:
            return None
        public = None if whose is None or terms is None else Terms.from_domain(whose, terms)
        return cls(
            override=safe.override,
            set_by=None if safe.person is None else whose,
            part=None if safe.part is None else CAPSULE_NAMES[safe.part],
            lacking=safe.lacking,
            stop_distance=safe.stop_distance,
            terms=public,
        )


class Distances(Answer):
    """Clearances of the robot at its position [m]; 1000 without people."""

    people: float
    cell: float
    robot: float = Field(description="between its own links")


class PersonMet(PersonUse):
    """Use of one person, with distance and weight."""

    separation: float | None = Field(
        description="distance to the robot [m], negative for an overlap; null: never seen, or "
        "dropped"
    )
    weight: float = Field(description="weight of the action beside this person")

    @classmethod
    def from_use(cls, use: PersonUse, met: PersonWeight | None) -> Self:
        """Return the use of a person with its distance, if known."""
        separation, weight = (None, 0.0) if met is None else met
        return cls(**dict(use), separation=separation, weight=weight)


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
    people: list[PersonMet] = Field(description="use of each person")
    clearance: Distances
    distance: float = Field(description="tool to goal [m]")
    beyond_reach: float = Field(
        description="distance of the goal beyond the reach of the arm [m]"
    )
    unfeasible: bool = Field(
        description="whether a joint cannot keep its limits from this state; it then brakes, "
        "or returns to them"
    )
    state_outside: list[Outside] = Field(
        description="measured joints outside their limits, clamped for the policy; `segment` "
        "and monitoring use the measured positions and speeds"
    )
    outside: list[Outside] = Field(description="inputs outside the training range")
    checkpoint: str = Field(description="SHA-256 of the checkpoint")
    elapsed_ms: float = Field(description="time of the decision [ms]")
    stamp: Stamp = None

    @classmethod
    def from_domain(
        cls,
        decision: MotionDecision,
        question: MotionQuestion,
        people: Sequence[PersonMet],
        dt: float,
        stamp: Stamp,
    ) -> Self:
        """Return the answer of a decision."""
        segment, safe = SegmentPublic.commanded(decision.piece, question, dt), decision.safe
        commanded = segment
        if safe is not None and safe.override < 1.0:
            segment = SegmentPublic.executed(safe, question, dt)
        to_people, to_cell, to_itself = decision.clearance
        return cls(
            dt=dt,
            segment=segment,
            commanded=commanded,
            act=_numbers(decision.act),
            inference_mode=decision.inference_mode,
            rollout=decision.rollout,
            alternative=decision.candidate,
            targets=[
                Target(position=list(one.position), weight=one.weight)
                for one in decision.targets
            ],
            safety=Override.from_domain(decision),
            people=list(people),
            clearance=Distances(people=to_people, cell=to_cell, robot=to_itself),
            distance=decision.distance,
            beyond_reach=decision.beyond_reach,
            unfeasible=decision.unfeasible,
            state_outside=[Outside.from_domain(one) for one in decision.state_outside],
            outside=[Outside.from_domain(one) for one in decision.outside],
            checkpoint=decision.checkpoint,
            elapsed_ms=decision.elapsed_ms,
            stamp=stamp,
        )


def _numbers(values: Vec) -> list[float]:
    return [float(value) for value in values]
