"""Next move of a sorting task together with its motion (docs/method.md 3.1).

The exact planner gives the near-optimal moves. For each of them the pick policy values the
motion to the object from the present state, and the motion with the object to its place from
the configuration over the object, with the people as they are now. The move is selected by both
values under the objective of task selection. A held object is brought to the place of a
near-optimal move, or back to where it was picked if there is none.

Source: ours; the thesis leaves the critic's values for the symbolic choice to future work.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from app.errors import InvalidInput
from app.policies.inference.task_selection import HYSTERESIS, LEAST_SUCCESS
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.core.out_of_range import OutOfRangeValue
from app.sim.human.person import Person
from app.sim.pick.batch import step_robot, target_configurations
from app.sim.pick.kernels.grasp import LIFT
from app.sim.pick.task_policy import (
    NOT_BEGUN,
    Candidate,
    Decision,
    Objective,
    OutcomeEstimate,
    PickProgress,
    TaskPolicy,
)
from app.sim.robot.measured_state import StateLimits
from app.sim.robot.trajectory_segment import TrajectorySegment
from app.sim.scene.scene import arm_of
from app.sim.sorting.layout import APPROACH_M, above
from app.sim.sorting.names import names_of
from app.sim.sorting.near_optimal_moves import MARGIN, NearOptimalMoves, near_optimal_moves
from app.sim.sorting.state import Move, SortingState

PLACE_S = 10.0
"""Time left for the motion with an object when it begins [s]."""
Symbol = Literal["pick", "place", "return"]
"""Kind of a motion: grasp an object, set the held one down, or put it back."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanQuery:
    """State of cell and task, and the rules of the choice."""

    q: Vec
    """Joint positions [rad], shape (6,)."""
    qd: Vec
    """Joint speeds [rad/s], shape (6,)."""
    people: Sequence[Person]
    """People in the cell."""
    state: SortingState
    """The sorting task; a held object counts where it was picked."""
    qdd: Vec | None = None
    """Joint accelerations [rad/s^2], shape (6,); required by policies with jerk limits."""
    held: int | None = None
    """Position from which the held object was picked; None: the gripper is empty."""
    previous: str | None = None
    """Station of the last choice, for hysteresis; one that is not offered counts as none."""
    progress: PickProgress = NOT_BEGUN
    """Progress of the motion to it."""
    time_left_s: float = 10.0
    """Time left for the motion [s]."""
    objective: Objective = "value"
    """Objective of the choice."""
    margin: float = MARGIN
    """Attempts by which a move may be worse than the planner's own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionEstimate:
    """The policy's estimate of one motion."""

    position: Vec
    """Target of the tcp, over the object or place [m], shape (3,)."""
    value: float
    """Value ``Q(s, pi(s))``."""
    outcome: OutcomeEstimate | None
    """Predicted outcome; None where the checkpoint predicts none."""
    outside: tuple[OutOfRangeValue, ...]
    """Coordinates of the target outside the training range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanOption:
    """A move that may be chosen."""

    move: Move
    """The move."""
    attempts: float
    """Expected attempts to the goal with it first."""
    pick: MotionEstimate | None
    """Motion to the object; None for a held one."""
    place: MotionEstimate
    """Motion with the object."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortingPlan:
    """The chosen move with its explanation; without options at the goal."""

    near: NearOptimalMoves
    """Plan of the task."""
    checkpoint: str
    """SHA-256 of the pick policy."""
    dt: float
    """Control period [s]."""
    elapsed_ms: float
    """Duration of the choice [ms]."""
    symbol: Symbol | None = None
    """Kind of the present motion; None at the goal."""
    options: tuple[PlanOption, ...] = ()
    """Reachable moves that the choice is among, the planner's own first."""
    index: int = 0
    """Index of the chosen one."""
    decision: Decision | None = None
    """Decision of the policy about the present motion; None at the goal."""
    segment: TrajectorySegment | None = None
    """Trajectory segment of the first control period; None at the goal."""

    @property
    def chosen(self) -> PlanOption | None:
        """The chosen option; None at the goal."""
        return self.options[self.index] if self.options else None


class SortingPlanner:
    """Chooses moves and motions in one sorting cell.

    Args:
        policy: Pick policy that is valid in the cell.
    """

    def __init__(self, policy: TaskPolicy, cell: Cell) -> None:
        self._policy, self._cell, self._arm = policy, cell, arm_of(cell)
        self._limits = StateLimits(self._arm, limits_jerk=policy.action.degree == 3)
        self._names = names_of(cell)

    def plan(self, query: PlanQuery) -> SortingPlan:
        """Choose the next move and its motion.

        Raises:
            InvalidInput: The goal cannot be met, no move can be reached, the object that is
                lifted is not offered, or a value of the query is invalid.
        """
        started, held = time.perf_counter(), query.held
        qdd = self._limits.take(query.q, query.qd, query.qdd).clamped.qdd
        near = self._near(query)

        def planned(**motion: Any) -> SortingPlan:
            return SortingPlan(
                near=near,
                checkpoint=self._policy.checkpoint,
                dt=float(self._arm.dt),
                elapsed_ms=1e3 * (time.perf_counter() - started),
                **motion,
            )

        if held is None and not near.moves:
            return planned()
        symbol, offered = _offered(near, held)
        offered = self._reachable(query.state, offered)
        decision, present = self._present(query, offered)
        places = {} if held is not None else self._later(query, offered)
        options = tuple(
            PlanOption(
                move=move,
                attempts=attempts,
                pick=None if held is not None else present[move.pick],
                place=present[move.place] if held is not None else places[move],
            )
            for move, attempts in zip(offered.moves, offered.attempts, strict=True)
        )
        index = decision.index if held is not None else self._choose(query, options)
        ends = list(present)
        chosen = options[index].move
        at = ends.index(chosen.pick if held is None else chosen.place)
        return planned(
            symbol=symbol,
            options=options,
            index=index,
            decision=replace(decision, index=at, chosen=self._names.stations[ends[at]]),
            segment=step_robot(
                self._arm,
                query.q,
                query.qd,
                qdd,
                decision.actions[at],
                self._policy.action,
            ),
        )

    def _near(self, query: PlanQuery) -> NearOptimalMoves:
        """Return the near-optimal moves; the pick of a held object has succeeded already."""
        shape, held, state = self._names.shape, query.held, query.state
        if held is not None and held < shape.n_slots:
            fail = state.fail.copy()
            fail[held] = 0.0
            near = near_optimal_moves(replace(state, fail=fail), shape, query.margin)
            if near.of(held).moves:
                return near
        return near_optimal_moves(state, shape, query.margin)

    def _choose(self, query: PlanQuery, options: tuple[PlanOption, ...]) -> int:
        """Return the index of the move of the greatest score, with hysteresis for values."""
        scores = np.array([score_of(one, query.objective) for one in options])
        best, stations = int(scores.argmax()), self._names.stations
        kept = [i for i, one in enumerate(options) if stations[one.move.pick] == query.previous]
        if not kept:
            return best
        last = max(kept, key=lambda i: scores[i])
        lifts = query.progress.phase == LIFT
        margin = HYSTERESIS if query.objective == "value" else 0.0
        return last if lifts or scores[best] - scores[last] <= margin else best

    def _target(self, state: SortingState, place: int, *, top: bool) -> Vec:
        """Return the target over the top object at a place, or over the next one, (3,)."""
        n_slots, level = self._names.shape.n_slots, 0
        if place >= n_slots:
            level = int(state.heights[place - n_slots]) - top
        point = self._cell.station(self._names.stations[place]).points()[level]
        return above(point, self._policy.grasp.depth or APPROACH_M)

    def _ends(self, state: SortingState, move: Move) -> Vec:
        """Return the targets of a move at its object and at its place [m], shape (2, 3)."""
        back = move.pick == move.place
        first = self._target(state, move.pick, top=True)
        return np.stack([first, self._target(state, move.place, top=back)])

    def _reachable(self, state: SortingState, near: NearOptimalMoves) -> NearOptimalMoves:
        """Return the moves whose object and place can be reached."""
        ends = np.concatenate([self._ends(state, move) for move in near.moves])
        reached = target_configurations(self._arm, self._policy.grasp, ends)[2]
        kept = reached.reshape(-1, 2).all(axis=1)
        if not kept.any():
            stations = [self._names.stations[move.pick] for move in near.moves]
            rule = "must hold an object that the robot reaches, with a place that it reaches"
            raise InvalidInput("objects", stations, rule)
        return near.only(np.flatnonzero(kept).tolist())

    def _present(
        self, query: PlanQuery, near: NearOptimalMoves
    ) -> tuple[Decision, dict[int, MotionEstimate]]:
        """Return the policy's decision about the present motion, and the estimate by place."""
        held, targets = query.held is not None, dict[int, Vec]()
        for move in near.moves:
            end = self._ends(query.state, move)[int(held)]
            targets[move.place if held else move.pick] = end
        candidates = self._candidates(targets)
        offered = tuple(one.id for one in candidates)
        if query.progress.phase == LIFT and query.previous not in offered:
            rule = (
                "must be the station of an offered motion in the phase lift; an object that is "
                "in the gripper is sent as held"
            )
            raise InvalidInput("previous", query.previous, rule, offered)
        decision = self._policy.decide(
            query.q,
            query.qd,
            query.people,
            candidates,
            previous=query.previous,
            progress=query.progress,
            time_left_s=query.time_left_s,
            objective=query.objective,
        )
        return decision, _estimates(decision, targets)

    def _later(self, query: PlanQuery, near: NearOptimalMoves) -> dict[Move, MotionEstimate]:
        """Return the estimate of each move's motion with its object, from over the object."""
        found: dict[Move, MotionEstimate] = {}
        for pick in dict.fromkeys(move.pick for move in near.moves):
            moves = near.of(pick).moves
            ends = [self._ends(query.state, move) for move in moves]
            over, _, _ = target_configurations(self._arm, self._policy.grasp, ends[0][:1])
            targets = {m.place: end[1] for m, end in zip(moves, ends, strict=True)}
            candidates = self._candidates(targets)
            decision = self._policy.decide(
                over[0], np.zeros(6), query.people, candidates, time_left_s=PLACE_S
            )
            for place, one in _estimates(decision, targets).items():
                found[Move(pick, place)] = one
        return found

    def _candidates(self, targets: dict[int, Vec]) -> list[Candidate]:
        """Return the targets of places as candidates named by their stations."""
        stations = self._names.stations
        return [Candidate(id=stations[end], position=point) for end, point in targets.items()]


def _estimates(decision: Decision, targets: dict[int, Vec]) -> dict[int, MotionEstimate]:
    """Return the estimate of the motion to each of the places of a decision."""
    return {
        place: MotionEstimate(
            position=point,
            value=decision.values[i],
            outcome=decision.outcome(i),
            outside=decision.outside_candidates[i],
        )
        for i, (place, point) in enumerate(targets.items())
    }


def _offered(near: NearOptimalMoves, held: int | None) -> tuple[Symbol, NearOptimalMoves]:
    """Return the kind of the present motion, and the moves it may belong to."""
    if held is None:
        return "pick", near
    own = near.of(held)
    if own.moves:
        return "place", own
    back = NearOptimalMoves(
        plan=near.plan, moves=(Move(held, held),), attempts=(near.plan.attempts,)
    )
    return "return", back


def reason(plan: SortingPlan, objective: Objective, *, lifts: bool = False) -> str:
    """Return the reason of a choice as a sentence.

    Args:
        lifts: Whether the object of the chosen move is being lifted.
    """
    if plan.symbol is None:
        return "Every tower matches the goal."
    if plan.symbol == "return":
        if not plan.near.moves:
            return "Every tower matches the goal without the held object."
        return "No move of about as few attempts places the held object now."
    scores = [score_of(one, objective) for one in plan.options]
    own = scores.pop(plan.index)
    if not scores:
        return "No other move takes about as few attempts."
    text = {
        "value": "the greatest value",
        "success": "the greatest probability of success",
        "time": "the least expected time per success [s]",
    }[objective]
    mine, best = (
        f"{abs(one) if objective == 'time' else one:.2f}" for one in (own, max(scores))
    )
    among = f"Of {len(plan.options)} moves with about as many expected attempts"
    if own >= max(scores):
        return f"{among} it has {text}: {mine}; the next has {best}."
    why = (
        "its object is being lifted"
        if lifts
        else "it was chosen before, and they differ little"
    )
    return f"{among} {text} is {best}; this one has {mine} and is kept: {why}."


def score_of(option: PlanOption, objective: Objective) -> float:
    """Return the score that an objective maximises, over the motions that a move still needs.

    Values add up, probabilities of success multiply; times add up and count per success, as
    negative numbers.
    """
    motions = [one for one in (option.pick, option.place) if one is not None]
    outcomes = [one.outcome for one in motions if one.outcome is not None]
    if objective == "value":
        return sum(one.value for one in motions)
    success = math.prod(one.success for one in outcomes)
    if objective == "success":
        return success
    return -sum(one.time_s for one in outcomes) / max(success, LEAST_SUCCESS)
