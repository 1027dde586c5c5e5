"""Interface of a policy that selects a task, and its decision."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from app.sim.core.arrays import Vec
from app.sim.core.out_of_range import OutOfRangeValue
from app.sim.core.policy_identity import PolicyIdentity
from app.sim.human.person import Person
from app.sim.pick.kernels.grasp import APPROACH, GraspRules
from app.sim.robot.actions import ActionSettings


class Candidate(NamedTuple):
    """One geometric task: bring the tool to ``position``, or pick the object below it."""

    id: str
    """Name, unique among the candidates."""
    position: Vec
    """Target of the tcp in the robot base frame [m], shape (3,)."""


class OutcomeEstimate(NamedTuple):
    """Predicted outcome of a candidate if it is pursued within the time left."""

    success: float
    """Probability of success."""
    success_low: float
    """Lower bound of its 95 % interval."""
    success_high: float
    """Upper bound."""
    contact: float
    """Probability of a contact."""
    contact_low: float
    """Lower bound of its 95 % interval."""
    contact_high: float
    """Upper bound."""
    time_s: float
    """Expected time to success [s]."""


Objective = Literal["value", "success", "time"]
"""Objective of a choice: the critic's value (thesis eq. 5.6), the probability of success, or
the expected time per success."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """Selection among candidates with its explanation (docs/method.md 3.1)."""

    chosen: str
    """Id of the chosen candidate."""
    index: int
    """Its index."""
    values: tuple[float, ...]
    """Value ``Q(s_i, pi(s_i))`` of each candidate: expected discounted reward."""
    actions: NDArray[np.float32]
    """Action for each candidate in [-1, 1], shape (n, 5)."""
    qd_target: Vec
    """Joint speeds of these actions [rad/s], shape (n, 6)."""
    reachable: tuple[bool, ...]
    """Whether a configuration with vertical tool exists for each candidate."""
    outside: tuple[OutOfRangeValue, ...]
    """Fields of the state outside the joint limits or the training range."""
    outside_candidates: tuple[tuple[OutOfRangeValue, ...], ...]
    """The same for each candidate's position."""
    checkpoint: str
    """SHA-256 of the checkpoint."""
    elapsed_ms: float
    """Duration of the decision [ms]."""
    outcomes: NDArray[np.float32] | None = None
    """Predicted outcome of each candidate, the fields of ``OutcomeEstimate``, shape (n, 7);
    None where the checkpoint predicts none."""
    nearest_person: int | None = None
    """Index of the observed person nearest to the robot; None without people."""

    def outcome(self, i: int) -> OutcomeEstimate | None:
        """Return the predicted outcome of a candidate."""
        return None if self.outcomes is None else OutcomeEstimate(*self.outcomes[i].tolist())


@dataclass(frozen=True, slots=True, kw_only=True)
class RiskMap:
    """Choice and risk beside a person in each of m postures."""

    chosen: NDArray[np.int64]
    """Index of the chosen candidate, shape (m,)."""
    value: Vec
    """Its value, shape (m,)."""
    success: Vec | None
    """Its probability of success, shape (m,); None where the checkpoint predicts none."""
    contact: Vec | None
    """Its probability of a contact, shape (m,)."""
    clearance_m: Vec
    """Distance of the robot to people, at most 1.5 m, shape (m,) [m]; 0 or less in contact."""
    outside: NDArray[np.bool_]
    """Whether the posture is outside the training range, shape (m,)."""
    elapsed_ms: float
    """Duration [ms]."""


class PickProgress(NamedTuple):
    """Progress of a pick that has begun."""

    phase: int
    """Phase of the pick: APPROACH, DESCEND or LIFT of ``kernels/grasp.py``."""
    closing_s: float
    """Time for which the tool has been held at the object [s]."""


NOT_BEGUN = PickProgress(phase=APPROACH, closing_s=0.0)
"""Progress before the descent."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MovedPerson:
    """One of several people in other postures."""

    index: int
    """Index of the person."""
    q: Vec
    """Joint positions in each posture [m, rad], shape (m, 18); speeds stay."""


class ChoiceTerms(NamedTuple):
    """Terms of a choice beside the state; as in :meth:`TaskPolicy.decide`."""

    previous: str | None = None
    """The candidate chosen last."""
    progress: PickProgress = NOT_BEGUN
    """Progress of its pick."""
    time_left_s: float = 10.0
    """Time left to reach a candidate [s]."""
    objective: Objective = "value"
    """Objective of the choice."""


FRESH = ChoiceTerms()
"""Terms of a first choice."""


class TaskPolicy(PolicyIdentity, Protocol):
    """Selects a candidate and moves the robot toward it; safe to call from several threads."""

    @property
    def action(self) -> ActionSettings:
        """Type of the actions."""

    @property
    def grasp(self) -> GraspRules:
        """Phases of a pick; ``depth`` 0 where targets are only reached."""

    @property
    def observed_people(self) -> int:
        """Greatest number of people that it observes at once."""

    def decide(
        self,
        q: Vec,
        qd: Vec,
        people: Sequence[Person],
        candidates: Sequence[Candidate],
        *,
        previous: str | None = None,
        progress: PickProgress = NOT_BEGUN,
        time_left_s: float = 10.0,
        objective: Objective = "value",
    ) -> Decision:
        """Choose one candidate.

        Args:
            q: Robot joint positions [rad], shape (6,).
            qd: Robot joint speeds [rad/s], shape (6,).
            people: The people in the cell, at most four. A policy that observes one person
                observes the one nearest to the robot.
            candidates: The candidates, at least one.
            previous: The candidate chosen last, for hysteresis; None: a first choice.
            progress: Progress of the pick of ``previous``. While an object is lifted the
                choice stays with it.
            time_left_s: Time left to reach a candidate [s].
            objective: Objective of the choice. Hysteresis applies to values only.

        Raises:
            InvalidInput: A value that no answer can be given for.
        """

    def risk_map(
        self,
        q: Vec,
        qd: Vec,
        people: Sequence[Person],
        candidates: Sequence[Candidate],
        moved: MovedPerson,
        *,
        terms: ChoiceTerms = FRESH,
    ) -> RiskMap:
        """Choose beside one person in several postures; each choice is that of ``decide``.

        Args:
            q: Robot joint positions [rad], shape (6,).
            qd: Robot joint speeds [rad/s], shape (6,).
            people: The people in the cell, at most four.
            candidates: The candidates, at least one.
            moved: The person and the postures.
            terms: Terms of the choice beside the state.

        Raises:
            InvalidInput: A value that no answer can be given for.
        """
