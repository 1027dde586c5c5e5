"""Query and result of a motion decision of a reach policy (docs/method.md 2)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

from app.sim.core.arrays import Vec
from app.sim.core.out_of_range import OutOfRangeValue
from app.sim.human.person import Person
from app.sim.robot.trajectory_segment import TrajectorySegment
from app.sim.safety.decision import SafetyDecision, SeparationTerms
from app.sim.safety.layer import SafetySettings

MotionMode = Literal["interpolated", "direct"]
"""Interpolation between training targets, or the policy queried for the goal itself."""
MOTION_MODES: tuple[MotionMode, ...] = get_args(MotionMode)
PersonWeighting = Literal["nearest", "distance-weighted"]
"""Several people: observe the nearest, or average the actions beside each of them."""
PERSON_WEIGHTINGS: tuple[PersonWeighting, ...] = get_args(PersonWeighting)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionQuery:
    """A state and a goal for which the next motion is queried."""

    q: Vec
    """Joint positions [rad], shape (6,)."""
    qd: Vec
    """Joint speeds [rad/s], shape (6,)."""
    goal: Vec
    """Goal of the tcp in the robot's base frame [m], shape (3,)."""
    people: Sequence[Person] = ()
    """The people in the cell as the policy observes them, at most four."""
    observed: Sequence[Person] | None = None
    """The people for the safety layer: as last observed, ``age_s`` ago, any number; None for
    ``people``."""
    qdd: Vec | None = None
    """Joint accelerations [rad/s^2], shape (6,); required by policies that limit jerk."""
    inference_mode: MotionMode | None = None
    """None interpolates if the policy has targets, else queries it for the goal itself."""
    person_weighting: PersonWeighting = "nearest"
    """Several people with a policy that observes one."""
    rollout: bool | None = None
    """Whether rollouts improve the action; None if the policy can be simulated."""
    time_left_s: float = 5.0
    """Time left to reach the goal, as policies observe it [s]."""
    elapsed_s: float = 0.0
    """Time since the goal was set [s]; from 1 s on, candidates are also simulated where the
    policy's rollout neither succeeds nor collides."""
    search: bool = True
    """Whether they may be; False simulates candidates only where the policy's rollout collides,
    whatever the times and the assumptions of the safety layer."""
    safety: SafetySettings | None = None
    """Assumptions of speed and separation monitoring; None for no monitoring."""
    age_s: float = 0.0
    """Age of the observation of people beyond the tracker's delay [s]."""


class TargetWeight(NamedTuple):
    """One training target of an interpolated action."""

    position: tuple[float, float, float]
    """The target [m]."""
    weight: float
    """Its weight in the action."""


class PersonWeight(NamedTuple):
    """One person and their weight in the action."""

    separation: float
    """Distance of robot and person [m]; below 0 where they overlap."""
    weight: float
    """Weight of the action beside this person alone; 1 for the observed person."""


class MotionDecision(NamedTuple):
    """The next motion and its explanation."""

    act: Vec
    """Action in [-1, 1], shape (6,): the policy's, or the first one of a better candidate."""
    rollout: bool
    """Whether rollouts were simulated."""
    candidate: str | None
    """Candidate executed instead of the policy's action; None for the policy's action."""
    segment: TrajectorySegment
    """The commanded segment, before any scaling."""
    unfeasible: bool
    """Whether a joint had no admissible coefficient and brakes, or returns to its limits."""
    inference_mode: MotionMode
    """Mode that was used."""
    targets: tuple[TargetWeight, ...]
    """Targets of an interpolated action; empty for ``direct``."""
    person_weights: tuple[PersonWeight, ...]
    """The people, in the order of the query."""
    nearest_person: int | None
    """Index of the nearest person; None in an empty cell."""
    safe: SafetyDecision | None
    """Executed part of the segment; None without monitoring."""
    terms: SeparationTerms | None
    """S_p of the person who set the override, else of the one with the least reserve; None in
    an empty cell."""
    terms_of: int | None
    """Index of that person in ``observed`` of the query."""
    clearance: tuple[float, float, float]
    """Clearances to people, cell and the robot itself [m]."""
    distance: float
    """tcp to goal [m]."""
    beyond_reach: float
    """Distance of the goal beyond the reach of the arm [m]; 0 within reach."""
    state_outside: tuple[OutOfRangeValue, ...]
    """Measured joints outside their limits; the policy observes them clamped."""
    outside: tuple[OutOfRangeValue, ...]
    """Inputs outside the training range."""
    checkpoint: str
    """SHA-256 of the checkpoint."""
    elapsed_ms: float
    """Time the decision took [ms]."""
