"""``POST /v1/task-selection``: state in, decision out."""

from collections.abc import Sequence
from typing import Annotated, Literal, get_args

import numpy as np
from pydantic import Field

from app.api.schemas.examples import TASK_SELECTION, shows
from app.api.schemas.numbers import Answer, Body, Data, Finite, Vector3, Vector6, Word
from app.api.schemas.people import PersonInput, PersonUse
from app.api.schemas.people import PersonState as PersonState
from app.api.schemas.robot_state import RobotState
from app.errors import InvalidInput
from app.policies.inference.task_selection import MAX_CANDIDATES
from app.sim.core.arrays import Vec
from app.sim.core.pick_depth import PICK_DEPTH_M
from app.sim.perception.multi_person_tracker import MAX_SKELETONS
from app.sim.pick.task_policy import Candidate, Decision, Objective, PickProgress

FrameName = Literal["robot-base", "base_link"]
"""Two names of one frame."""
FRAME_TEXT = (
    "frame of all positions: ROS's `base_link`, x right, y toward the person, z up, table top "
    "at z = 0; the pendant's `base` is turned by half a turn about z (x and y change sign)"
)

Phase = Literal["approach", "descend", "lift"]
ClosingTime = Annotated[float, Field(ge=0.0, le=60.0)]
TimeLeft = Annotated[float, Field(ge=-1e9, le=1e9)]
Stamp = int | Finite | Annotated[str, Field(max_length=64)] | None
"""Returned unchanged: a float would round nanoseconds since 1970."""


class CandidateState(Body):
    """A task of the robot."""

    id: str = Field(min_length=1, max_length=128, description="your name for it")
    position: Vector3 = Field(
        description="point the tool must reach, in `frame` [m]; for a pick the point over the "
        f"object, {PICK_DEPTH_M:g} m above the grasp"
    )


class TaskSelectionRequest(Body):
    """State of the cell, and the candidate tasks."""

    model_config = shows(TASK_SELECTION)

    cell: str = Field(description="name of the work cell", examples=["pick-and-place"])
    frame: FrameName = Field("robot-base", description=FRAME_TEXT)
    stamp: Stamp = Field(None, description="your time of the state; returned unchanged")
    robot: RobotState
    people: list[PersonInput] = Field(
        max_length=MAX_SKELETONS,
        description="people in the cell, each as joint angles, key-points, a cylinder or a "
        "track; a policy for one person uses the one nearest to the robot; of more than four "
        "the nearest four are used, the others are flagged `dropped`",
    )
    candidates: list[CandidateState] = Field(
        min_length=1, max_length=MAX_CANDIDATES, description="the candidate tasks"
    )
    previous: str | None = Field(
        None,
        min_length=1,
        max_length=128,
        description="last chosen id, for hysteresis; one that is no candidate counts as none, "
        "and is refused in the phase `lift`; null: none",
    )
    phase: Phase = Field(
        "approach",
        description="phase of the pick of `previous`: `approach` of the point over the object, "
        "`descend` to it and close the gripper, `lift` it; while it is lifted it stays chosen",
    )
    closing_s: ClosingTime = Field(
        0.0, description="time for which the tool has been held at the object [s]"
    )
    time_left_s: TimeLeft = Field(
        10.0, description="time left to reach the target [s]; clamped to 0 to 60 for the policy"
    )
    objective: Objective = Field(
        "value",
        description="the choice maximises the critic's `value` (the rule of the thesis, with "
        "hysteresis added), or the probability of `success`, or minimises the expected `time` "
        "per success",
    )
    checkpoint: Word | None = Field(
        None, description="SHA-256 or alias; the shipped policy if null"
    )

    def to_domain(self) -> tuple[Vec, Vec, tuple[Candidate, ...]]:
        """Return q, qd and candidates as arrays; ``known_people`` converts the people.

        Raises:
            InvalidInput: An id occurs twice, or the lifted candidate is missing.
        """
        ids = [one.id for one in self.candidates]
        if len(set(ids)) < len(ids):
            index = next(i for i, name in enumerate(ids) if ids.index(name) < i)
            rule = "must be unique among the candidates"
            raise InvalidInput(f"candidates[{index}].id", ids[index], rule)
        if self.phase == "lift" and self.previous not in ids:
            rule = "must be the id of a candidate in the phase lift"
            raise InvalidInput("previous", self.previous, rule, ids)
        return (
            self.robot.joints(self.robot.q),
            self.robot.joints(self.robot.qd),
            tuple([Candidate(one.id, np.array(one.position)) for one in self.candidates]),
        )

    @property
    def progress(self) -> PickProgress:
        """Progress of the pick of ``previous``."""
        return progress_of(self.phase, self.closing_s)


def progress_of(phase: Phase, closing_s: float) -> PickProgress:
    """Return the progress of a pick from its members in a request."""
    return PickProgress(phase=get_args(Phase).index(phase), closing_s=closing_s)


class OutOfRangeInput(Answer):
    """An input outside the training range, or a joint outside its limits."""

    field: str
    value: float
    low: float = Field(description="least value of training, or the joint's lower limit")
    high: float = Field(description="greatest value of training, or its upper limit")
    of: Literal["training", "limits"] = Field("training", description="kind of the bounds")


class Action(Answer):
    """The policy's action for a candidate."""

    qd_target: Vector6 = Field(
        description="target joint speeds [rad/s]: not monitored, and without bounds on the "
        "acceleration"
    )


class Probability(Answer):
    """A probability, and where the rate lies in 95 % of cells with people of one kind."""

    mean: float
    low: float
    high: float


class Outcome(Answer):
    """Predicted outcome of a candidate, if it is pursued within the time left."""

    success: Probability
    contact: Probability
    time_s: float = Field(description="expected time to success [s]")

    @staticmethod
    def data_of(outcome: Sequence[float] | None) -> Data | None:
        """Return the data of the fields of an ``OutcomeEstimate``, if there is one."""
        if outcome is None:
            return None
        success, low, high, contact, least, most, time_s = outcome
        return {
            "success": {"mean": success, "low": low, "high": high},
            "contact": {"mean": contact, "low": least, "high": most},
            "time_s": time_s,
        }


class CandidateValue(Answer):
    """The critic's value of a candidate."""

    id: str
    value: float = Field(description="expected discounted reward Q(s, pi(s))")
    chosen: bool
    outcome: Outcome | None = Field(
        description="probabilities and time; null where the checkpoint predicts none"
    )
    reachable: bool = Field(
        description="whether a configuration with vertical tool exists, in contact or not; "
        "others are chosen only if no candidate is reachable"
    )
    action: Action
    outside: list[OutOfRangeInput] = Field(description="coordinates outside the training range")


class TaskSelection(Answer):
    """The decision with its explanation."""

    chosen: str = Field(description="id of the chosen candidate")
    candidates: list[CandidateValue]
    people: list[PersonUse] = Field(description="use of each person")
    state_outside: list[OutOfRangeInput] = Field(
        description="measured joints outside their limits, clamped for the policy, and state "
        "fields outside the training range"
    )
    checkpoint: str = Field(description="SHA-256 of the checkpoint")
    elapsed_ms: float = Field(description="time of the decision [ms]")
    stamp: Stamp = None

    @staticmethod
    def data_of(
        decision: Decision, candidates: Sequence[Candidate], people: list[Data], stamp: Stamp
    ) -> Data:
        """Return the data of the answer of a decision."""
        speeds, outcomes = decision.qd_target.tolist(), decision.outcomes
        expected = [None] * len(candidates) if outcomes is None else outcomes.tolist()
        return {
            "chosen": decision.chosen,
            "candidates": [
                {
                    "id": candidate.id,
                    "value": decision.values[index],
                    "chosen": index == decision.index,
                    "outcome": Outcome.data_of(expected[index]),
                    "reachable": decision.reachable[index],
                    "action": {"qd_target": speeds[index]},
                    "outside": decision.outside_candidates[index],
                }
                for index, candidate in enumerate(candidates)
            ],
            "people": people,
            "state_outside": decision.outside,
            "checkpoint": decision.checkpoint,
            "elapsed_ms": decision.elapsed_ms,
            "stamp": stamp,
        }
