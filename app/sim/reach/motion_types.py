"""How the robot moves next toward a goal: what is asked and what is answered (METHOD 2).

``app.policies.inference.motion_decision`` answers; ``POST /v1/motion`` and its socket pass it
on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

from app.sim.core.arrays import Vec
from app.sim.core.out_of_range import OutsideField
from app.sim.human.person import Person
from app.sim.pick.batch import Piece
from app.sim.safety.decision import SafetyDecision, SeparationTerms
from app.sim.safety.layer import SafetySettings

Way = Literal["interpolated", "direct"]
"""Between training targets, or the policy for the goal itself."""
WAYS: tuple[Way, ...] = get_args(Way)
Beside = Literal["nearest", "averaged"]
"""Of several people the nearest is seen, or actions beside each of them are averaged."""
BESIDES: tuple[Beside, ...] = get_args(Beside)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionQuestion:
    """A state and a goal."""

    q: Vec
    """Joint positions [rad], shape (6,)."""
    qd: Vec
    """Joint speeds [rad/s], shape (6,)."""
    goal: Vec
    """Where the tcp shall be, robot's base frame [m], shape (3,)."""
    people: Sequence[Person] = ()
    """The people in the cell as the policy sees them, at most four."""
    observed: Sequence[Person] | None = None
    """The people as a safety layer takes them: as last observed, ``age_s`` ago, at most four;
    None: as in ``people``."""
    qdd: Vec | None = None
    """Joint accelerations [rad/s^2], shape (6,); a policy that limits jerk needs them."""
    way: Way | None = None
    """None interpolates where the policy has targets, else asks it for the goal itself."""
    beside: Beside = "nearest"
    """How several people are met by a policy that knows one."""
    ahead: bool | None = None
    """Whether the decision is played ahead; None does where the policy allows it."""
    time_left_s: float = 5.0
    """Time left to reach the goal, which policies see [s]."""
    elapsed_s: float = 0.0
    """Time for which the goal has been sought: from 1 s on other ways are tried where the
    policy's leads neither to it nor into a contact [s]."""
    safety: SafetySettings | None = None
    """What speed and separation monitoring assumes; None leaves it out."""
    age_s: float = 0.0
    """How old the observation of the people is beyond the tracker's delay [s]."""


class TargetWeight(NamedTuple):
    """One training target that the action is made from."""

    position: tuple[float, float, float]
    """The target [m]."""
    weight: float
    """Its share of the action."""


class Met(NamedTuple):
    """One person as the decision met them."""

    separation: float
    """Distance of robot and person [m]; below 0 where they overlap."""
    weight: float
    """Share of the action beside this person alone; 1 for the one who is seen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionDecision:
    """The next piece of motion, and all that explains it."""

    act: Vec
    """The action in [-1, 1], shape (6,): the policy's, or the first of a better way."""
    ahead: bool
    """Whether it was played ahead."""
    began: str | None
    """The way that is begun instead of the policy's action; None for that itself."""
    piece: Piece
    """The commanded piece, before any scaling."""
    unfeasible: bool
    """Whether a joint had no admissible coefficient and brakes, or returns to its limits."""
    way: Way
    """How the action came about."""
    targets: tuple[TargetWeight, ...]
    """The targets it was made from; none for ``direct``."""
    met: tuple[Met, ...]
    """The people, in the order of the question."""
    seen: int | None
    """Who is nearest; None for nobody."""
    safe: SafetyDecision | None
    """What is executed of the piece; None without monitoring."""
    terms: SeparationTerms | None
    """S_p for whoever set the override, else for the nearest; None where nobody is there."""
    terms_of: int | None
    """Whose terms these are: place in ``observed`` of the question."""
    clearance: tuple[float, float, float]
    """Distances to people, cell and the robot itself [m]."""
    distance: float
    """tcp to goal [m]."""
    beyond_reach: float
    """By how much the goal is farther away than the arm is long [m]; 0 within."""
    state_outside: tuple[OutsideField, ...]
    """Measured joints outside their limits; the policy sees them clamped."""
    outside: tuple[OutsideField, ...]
    """Inputs outside what was met in training."""
    checkpoint: str
    """SHA-256 of the checkpoint."""
    elapsed_ms: float
    """Time the decision took [ms]."""
