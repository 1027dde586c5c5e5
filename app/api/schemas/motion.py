"""``POST /v1/motion``: state, people and goal in, the next piece of motion out."""

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
from app.sim.pick.batch import Piece
from app.sim.reach.motion_types import Beside, Met, MotionDecision, MotionQuestion, Way
from app.sim.safety.decision import SafetyDecision, SeparationTerms, powers_of_time
from app.sim.safety.layer import SafetySettings

Metres = Annotated[float, Field(ge=0.0, le=5.0)]
Seconds = Annotated[float, Field(ge=0.0, le=5.0)]


class ArmState(RobotState):
    """The robot as measured."""

    qdd: Vector6 | None = Field(
        None,
        description="joint accelerations [rad/s^2], in the same order; needed by a policy that "
        "limits jerk",
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
        default=None, description="least distance to anyone while the robot moves, on top [m]"
    )
    pfl: bool | None = Field(
        default=None,
        description="whether people may be touched, as slowly as their parts allow",
    )

    def to_domain(self, own: SafetySettings) -> SafetySettings:
        """Return the settings of the cell with the given values in their place."""
        given = self.model_dump(exclude_none=True)
        return replace(own, **given) if given else own


class MotionRequest(Body):
    """A state and a goal at this moment; nothing is remembered of the request before."""

    model_config = shows(MOTION)

    cell: str = Field(
        max_length=64, description="name of the work cell", examples=["shared-workspace"]
    )
    frame: FrameName = Field("robot-base", description=FRAME_TEXT)
    stamp: Stamp = Field(None, description="your time of the state; comes back unchanged")
    robot: ArmState
    people: Sequence[PersonInput] = Field(
        max_length=MAX_SKELETONS,
        description="the people in the cell, each by joint angles, key-points, a cylinder or a "
        "tracker; of more than four the nearest four count, the others are flagged `dropped`",
    )
    goal: Vector3 = Field(description="where the tool shall be, in `frame` [m]")
    way: Way | None = Field(
        None,
        description="`interpolated`: the mean of the policy's actions for the training targets "
        "around the goal; `direct`: its action for the goal itself; null interpolates where "
        "the policy has targets",
    )
    beside: Beside = Field(
        "nearest",
        description="several people: the policy sees the nearest, or its actions beside each "
        "of them alone are averaged by their distances",
    )
    ahead: bool | None = Field(
        None,
        description="whether the decision is played ahead with the policy, beside people who "
        "go on as forecast, and changed where that ends in a contact; null does where the "
        "policy allows it",
    )
    time_left_s: Annotated[float, Field(ge=-1e9, le=1e9)] = Field(
        5.0,
        description="time left to reach the goal [s]; the policy sees 0 to 5",
    )
    elapsed_s: Annotated[float, Field(ge=0.0, le=1e9)] = Field(
        0.0,
        description="time for which this goal has been sought [s]: from 1 on, other ways are "
        "tried, too, where the policy's leads neither to the goal nor into a contact",
    )
    safety: SafetyInput | None = Field(
        SafetyInput(),
        description="speed and separation monitoring: by default as the cell says; null leaves "
        "it out, and people inside the robot are then refused",
    )
    age_s: Annotated[float, Field(ge=0.0, le=1e9)] = Field(
        0.0,
        description="how old the people are beyond `tracker_delay` [s]; the age of a tracker's "
        "observation, which counts from the arrival of its frame, is added",
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
            people: Those of the request, as the policy sees them.
            observed: As last observed; None: like ``people``.
            own: What the cell says about safety.
            age_s: Age of the oldest observation, by its tracker [s].
        """
        robot = self.robot
        return MotionQuestion(
            q=robot.joints(robot.q),
            qd=robot.joints(robot.qd),
            qdd=None if robot.qdd is None else robot.joints(robot.qdd),
            goal=np.array(self.goal),
            people=people,
            observed=observed,
            way=self.way,
            beside=self.beside,
            ahead=self.ahead,
            time_left_s=self.time_left_s,
            elapsed_s=self.elapsed_s,
            safety=None if self.safety is None else self.safety.to_domain(own),
            age_s=self.age_s + age_s,
        )


class MotionPiece(Answer):
    """One control period of the robot as polynomials in time, and where it ends."""

    coefficients: list[list[float]] = Field(
        description="per joint, base to wrist 3, the coefficients of t^0, t^1, ... [rad/s^n]"
    )
    until: float = Field(
        description="time up to which they hold [s]: the period, or less where the robot comes "
        "to rest in it and stays there"
    )
    q: Vector6 = Field(description="joint positions at the end of the period [rad]")
    qd: Vector6 = Field(description="joint speeds there [rad/s]")
    qdd: Vector6 = Field(description="joint accelerations there [rad/s^2]")

    @classmethod
    def commanded(cls, piece: Piece, question: MotionQuestion, dt: float) -> Self:
        """Make it from what the policy commands."""
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
        """Make it from what monitoring lets through."""
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
    """One training target that the action is made from."""

    position: Vector3 = Field(description="[m]")
    weight: float = Field(description="its share of the action; all together are 1")


class Terms(Answer):
    """S_p of the standard, term by term, for one person and one link."""

    person: int = Field(description="whose: place in `people`")
    link: str = Field(description="the robot's link that is nearest")
    separation: float = Field(description="distance as seen [m]")
    required: float = Field(
        description="v_h (T_r + T_s) + v_r T_r + B + C + Z_d + Z_r + protective distance [m]"
    )
    human_speed: float = Field(
        description="v_h [m/s]; of a measured velocity what leads to the link, and "
        "`speed_change`"
    )
    robot_speed: float = Field(description="v_r, a bound on that link's speed [m/s]")
    reaction_time: float = Field(description="T_r: period, reaction, delay and age [s]")
    stop_time: float = Field(description="T_s [s]")
    braking: float = Field(description="B [m]")
    intrusion: float = Field(description="C [m]")
    person_uncertainty: float = Field(description="Z_d [m]")
    robot_uncertainty: float = Field(description="Z_r [m]")
    protective_distance: float = Field(description="least distance, on top [m]")

    @classmethod
    def from_domain(cls, person: int, terms: SeparationTerms) -> Self:
        """Make it from the simulator's data."""
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
    """How much of the commanded motion monitoring lets through, and why."""

    override: float = Field(description="rate at the end of the period, 0 (a stop) to 1")
    set_by: int | None = Field(description="who set it: place in `people`; null: nobody did")
    part: str | None = Field(description="which part of that person; null for a cylinder")
    lacking: float = Field(
        description="by how much that person could have come too near on the motion that was "
        "refused [m]"
    )
    stop_distance: float = Field(
        description="bound on how far any point of the robot goes in a stop from now [m]"
    )
    terms: Terms | None = Field(
        description="S_p for who set it, else for the nearest person; null for nobody"
    )

    @classmethod
    def from_domain(cls, decision: MotionDecision) -> Self | None:
        """Make it from a decision; None without monitoring."""
        safe, whose, terms = decision.safe, decision.terms_of, decision.terms
        if safe is None:
            return None
        told = None if whose is None or terms is None else Terms.from_domain(whose, terms)
        return cls(
            override=safe.override,
            set_by=None if safe.person is None else whose,
            part=None if safe.part is None else CAPSULE_NAMES[safe.part],
            lacking=safe.lacking,
            stop_distance=safe.stop_distance,
            terms=told,
        )


class Distances(Answer):
    """Distances of the robot as it stands [m]; 1000 where there is nobody."""

    people: float
    cell: float
    robot: float = Field(description="of its own links to each other")


class PersonMet(PersonUse):
    """What was made of one person, and how near."""

    separation: float | None = Field(
        description="distance to the robot [m]; below 0: inside it; null: never seen, or "
        "dropped"
    )
    weight: float = Field(description="share of the action beside this person")

    @classmethod
    def from_use(cls, use: PersonUse, met: Met | None) -> Self:
        """Make it from what was made of a person; ``met`` is None without distance."""
        separation, weight = (None, 0.0) if met is None else met
        return cls(**dict(use), separation=separation, weight=weight)


class MotionAnswer(Answer):
    """The next piece of motion and all that explains it."""

    joints: list[str] = Field(
        default=list(ROS_NAMES),
        description="the joints in the order of all vectors of this answer",
    )
    dt: float = Field(description="control period [s]")
    piece: MotionPiece = Field(description="what the robot shall execute")
    commanded: MotionPiece = Field(description="what the policy asked for, before scaling")
    act: Vector6 = Field(
        description="the action, -1 to 1 per joint: the policy's, or the first of the way begun"
    )
    way: Way
    ahead: bool = Field(description="whether the decision was played ahead")
    began: str | None = Field(
        description="the way begun instead of the policy's action, by where it leads first and "
        "for how long, or what pan, shoulder and elbow do (f: forward, b: back, h: held); "
        "null: the policy's action passed"
    )
    targets: list[Target] = Field(description="what was interpolated; empty for `direct`")
    safety: Override | None = Field(description="null where monitoring was left out")
    people: list[PersonMet] = Field(description="what was made of each person")
    clearance: Distances
    distance: float = Field(description="tool to goal [m]")
    beyond_reach: float = Field(
        description="by how much the goal is farther away than the arm is long [m]"
    )
    unfeasible: bool = Field(
        description="whether a joint cannot keep its limits from this state: it brakes, or "
        "returns to them"
    )
    state_outside: list[Outside] = Field(
        description="measured joints outside their limits: the policy sees them clamped; "
        "`piece` starts at the measured positions and speeds, and monitoring goes by those"
    )
    outside: list[Outside] = Field(description="inputs outside what was met in training")
    checkpoint: str = Field(description="SHA-256 of the checkpoint that decided")
    elapsed_ms: float = Field(description="time the decision took [ms]")
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
        """Make it from a decision, what was asked and what was made of the people."""
        commanded = MotionPiece.commanded(decision.piece, question, dt)
        piece, safe = commanded, decision.safe
        if safe is not None and safe.override < 1.0:
            piece = MotionPiece.executed(safe, question, dt)
        to_people, to_cell, to_itself = decision.clearance
        return cls(
            dt=dt,
            piece=piece,
            commanded=commanded,
            act=_numbers(decision.act),
            way=decision.way,
            ahead=decision.ahead,
            began=decision.began,
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
