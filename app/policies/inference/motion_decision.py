"""Next trajectory segment toward a goal beside people (docs/method.md 2.2, 2.4, 2.7).

A decision queries the policy for an action, optionally interpolated between training targets
and improved by rollouts, converts it to the segment that keeps all limits, and computes the
override of speed and separation monitoring. Decisions are stateless: the joint speeds contain
all that the next period needs.
"""

import math
import threading
import time
from collections.abc import Callable, Sequence

import numpy as np

from app.errors import InvalidInput
from app.policies.inference.controllers import person_weights
from app.policies.inference.reach_training_range import (
    PersonValues,
    ReachTrainingRange,
    as_given,
)
from app.policies.inference.rollout import (
    CANDIDATES,
    NO_CONSTRAINT,
    POLICY,
    RolloutImprovement,
    can_roll_out,
    ssm_constraint_of,
)
from app.policies.inference.target_interpolation import Interpolation, interpolates
from app.sim.cells.cell import Cell, require_cell
from app.sim.collision.checker import Shapes
from app.sim.core.arrays import Vec
from app.sim.core.jit import direct
from app.sim.human import model as human
from app.sim.human.person import Person
from app.sim.perception.observed_people import (
    bodies_first,
    checked_and_known,
    checked_person,
    checked_vector,
    people_shapes,
    person_from_cylinder,
)
from app.sim.prediction.kernels.networks import STEP_S
from app.sim.reach.batch import goal_region_of
from app.sim.reach.monitored.batch import HORIZON_S
from app.sim.reach.motion_types import (
    MOTION_MODES,
    PERSON_WEIGHTINGS,
    MotionDecision,
    MotionMode,
    MotionQuery,
    PersonWeight,
    TargetWeight,
)
from app.sim.reach.query_state import QueryState
from app.sim.reach.reach_actor import ReachActor
from app.sim.robot.kernels import actions
from app.sim.robot.kernels.joints import JointState
from app.sim.robot.measured_state import MeasuredState, StateLimits, returning
from app.sim.robot.trajectory_segment import TrajectorySegment
from app.sim.robot.ur10 import reach_of
from app.sim.safety.decision import SafetyDecision, SeparationTerms
from app.sim.safety.layer import SafetyLayer, SafetySettings
from app.sim.scene.scene import FAR_AWAY, arm_of, people_of

_FAR = np.full(3, 10.0)
_WHOLE = np.ones(1)
Monitored = tuple[SafetyDecision | None, int | None, SeparationTerms | None]
"""Decision of the safety layer, index of the decisive person, and terms of S_p."""


class MotionDecider:
    """Decide motions by one policy; safe to call from several threads.

    Args:
        cell: Training cell of the policy.

    Raises:
        CheckpointMismatch: The policy was trained in another cell.
        InvalidInput: The cell has no goals.
    """

    def __init__(self, actor: ReachActor, cell: Cell) -> None:
        require_cell(cell, actor.cell, actor.cell_sha256)
        self.actor, self.cell, self.arm = actor, cell, arm_of(cell)
        self._shared = people_of(cell)
        self._between = Interpolation(actor) if interpolates(actor) else None
        self._can_roll_out = can_roll_out(actor)
        self._rule = actor.action.rule()
        self._advance: Callable[..., bool] | None = None
        self._limits = StateLimits(self.arm, limits_jerk=actor.action.degree == 3)
        self._trained = ReachTrainingRange(actor.trained_range)
        self._states: dict[tuple[int, int], QueryState] = {}
        self._improvements: dict[QueryState, RolloutImprovement] = {}
        self._layer = SafetyLayer(self.arm, SafetySettings())
        self._busy = threading.Lock()
        self._shoulder, self._longest = reach_of(self.arm.lengths)
        """Centre [m], shape (3,), and length [m] of the arm's reach."""

    @property
    def checkpoint(self) -> str:
        """SHA-256 of the checkpoint."""
        return self.actor.checkpoint

    def decide(self, query: MotionQuery) -> MotionDecision:
        """Return the next trajectory segment.

        Raises:
            InvalidInput: A number is out of range, or a person overlaps the robot without
                monitoring.
            GoalOutside: The goal of an interpolated action lies outside the training targets.
            CheckpointMismatch: The action of the policy is not finite.
        """
        started = time.perf_counter()
        robot, goal = self._numbers(query)
        people, known_people = checked_and_known(query.people)
        mode = self._mode(query.inference_mode)
        rollout = self._rollout(query.rollout)
        order = bodies_first(people)
        known, viewed = [people[i] for i in order], [known_people[i] for i in order]
        with self._busy:
            query_state = self._state_of(known)
            time_left = min(max(0.0, query.time_left_s), HORIZON_S)
            query_state.load(robot.measured, known, time_left)
            separations, clearance = query_state.distances.tolist(), query_state.clear.tolist()
            point, monitors = goal.tolist(), query.safety is not None
            distance = math.dist(query_state.tcp.tolist(), point)
            shapes = query_state.shapes if monitors else None
            if not monitors:
                _require_no_overlap(separations, order)
            # Distances and monitoring use measured people, the policy clipped ones.
            if robot.outside or any(a is not b for a, b in zip(known, viewed, strict=True)):
                query_state.load(robot.clamped, viewed, time_left)
            nearest = int(query_state.distances.argmin()) if order else None
            act, targets, weights, observed = self._act(query_state, query, goal, mode)
            candidate = self._improve(query_state, query, goal, act) if rollout else None
            segment, unfeasible = self._segment(robot, act)
            last = self._observed(query.observed) or (shapes, order)
            safe, terms_of, terms = self._monitored(query, robot, segment, *last)
            state = np.concatenate((robot.clamped.q, robot.clamped.qd, goal))
            outside = self._trained.outside(state, as_given(observed, known, viewed), order)
        people_weights = [
            PersonWeight(separation=d, weight=w)
            for d, w in zip(separations, weights, strict=True)
        ]
        place = sorted(range(len(order)), key=order.__getitem__)
        return MotionDecision(
            act=act,
            rollout=rollout,
            candidate=candidate,
            segment=segment,
            unfeasible=unfeasible,
            inference_mode=mode,
            targets=targets,
            person_weights=tuple(people_weights[i] for i in place),
            nearest_person=None if nearest is None else order[nearest],
            safe=safe,
            terms=terms,
            terms_of=terms_of,
            clearance=(clearance[0], clearance[1], clearance[2]),
            distance=distance,
            beyond_reach=max(0.0, math.dist(point, self._shoulder) - self._longest),
            state_outside=robot.outside,
            outside=outside,
            checkpoint=self.checkpoint,
            elapsed_ms=1e3 * (time.perf_counter() - started),
        )

    def warm_up(self) -> None:
        """Compile the kernels of decisions before the first query."""
        q, goal = self.arm.home.copy(), np.array(goal_region_of(self.cell).center)
        people = (
            Person(q=human.rest_posture(*FAR_AWAY), qd=np.zeros(18)),
            person_from_cylinder(-1.5, 2.0, 0.0, 0.0, 0.3),
        )
        qdd = np.zeros(6)
        for beside in ((), people[:1], people[1:]):
            self.decide(
                MotionQuery(
                    q=q,
                    qd=np.zeros(6),
                    qdd=qdd,
                    goal=goal,
                    people=beside,
                    safety=SafetySettings(),
                )
            )

    def _numbers(self, query: MotionQuery) -> tuple[MeasuredState, Vec]:
        """Return the checked state of the robot and the checked goal."""
        robot = self._limits.take(query.q, query.qd, query.qdd)
        goal = checked_vector("goal", query.goal, 3, -_FAR, _FAR, "m")
        if not math.isfinite(query.time_left_s):
            raise InvalidInput("time_left_s", query.time_left_s, "must be finite [s]")
        for name in ("elapsed_s", "age_s"):
            value = getattr(query, name)
            if not 0.0 <= value < math.inf:
                raise InvalidInput(name, value, "must be finite and not negative [s]")
        asked = query.person_weighting
        if asked not in PERSON_WEIGHTINGS:
            raise InvalidInput(
                "person_weighting", asked, "must be one of the choices", PERSON_WEIGHTINGS
            )
        return robot, goal

    def _mode(self, asked: MotionMode | None) -> MotionMode:
        if asked is None:
            return "direct" if self._between is None else "interpolated"
        if asked not in MOTION_MODES:
            raise InvalidInput("inference_mode", asked, "must be a mode", MOTION_MODES)
        if asked == "interpolated" and self._between is None:
            rule = "needs training targets, and this policy was trained on all of a box"
            raise InvalidInput("inference_mode", asked, rule, ("direct",))
        return asked

    def _rollout(self, asked: bool | None) -> bool:
        if asked and not self._can_roll_out:
            rule = (
                "needs a policy with option features and two hidden layers, and a control "
                f"period dt of the cell that divides {STEP_S} s"
            )
            raise InvalidInput("rollout", True, rule, ("false",))
        return self._can_roll_out if asked is None else asked

    def _improve(
        self, query_state: QueryState, query: MotionQuery, goal: Vec, act: Vec
    ) -> str | None:
        """Improve an action in place by rollouts; return the candidate, None for the policy."""
        if query_state not in self._improvements:
            self._improvements[query_state] = RolloutImprovement(self.actor)
        improvement = self._improvements[query_state]
        improvement.forget()
        state, elapsed = query_state.state, query.elapsed_s
        improvement.constraint = ssm_constraint_of(query.safety, self.arm.dt, query.age_s)
        if not query.search:
            improvement.constraint, elapsed = NO_CONSTRAINT, 0.0
            state.time_left[0] = max(state.time_left.item(0), HORIZON_S)
        state.goal[0], state.elapsed[0] = goal, elapsed
        improved = act[None].astype(np.float32)
        chosen = int(improvement.improve(query_state, improved)[0])
        if chosen == POLICY:
            return None
        act[:] = improved[0]
        return CANDIDATES[chosen]

    def _observed(self, observed: Sequence[Person] | None) -> tuple[Shapes, list[int]] | None:
        """Return people as last observed, bodies first, and their indices; None: not given."""
        if observed is None:
            return None
        people = [checked_person(one, f"people[{i}]") for i, one in enumerate(observed)]
        places = bodies_first(people)
        return people_shapes(self._shared, [people[i] for i in places]), places

    def _state_of(self, people: Sequence[Person]) -> QueryState:
        n_bodies = sum(person.cylinder is None for person in people)
        kinds = (n_bodies, len(people) - n_bodies)
        if kinds not in self._states:
            self._states[kinds] = QueryState(self.cell, *kinds, self.actor.view)
        return self._states[kinds]

    def _act(
        self, query_state: QueryState, query: MotionQuery, goal: Vec, mode: MotionMode
    ) -> tuple[Vec, tuple[TargetWeight, ...], list[float], list[PersonValues]]:
        """Return action, targets, weights of the people, and the observed people.

        Args:
            query_state: State with the people of the query.
            goal: Goal of the tcp [m], shape (3,).

        Returns:
            Action in [-1, 1], shape (6,); targets interpolated between, with weights; weight of
            each person; and index and observed values of each observed person.
        """
        separations = query_state.distances
        nearest = int(separations.argmin()) if len(separations) else None
        places, shares = goal[None], _WHOLE
        if mode == "interpolated":
            assert self._between is not None
            mix, around = self._between.around(goal[None])
            used = mix.weights[0] > 0.0
            places, shares = around[0][used], mix.weights[0][used]
        weights = [float(person == nearest) for person in range(len(separations))]
        if query.person_weighting == "distance-weighted" and len(separations) > 1:
            # The nearest first: rounding depends on the place in the batch.
            counts = person_weights(separations[None])[0]
            first, weights = separations.argsort(), counts.tolist()
            obs = np.empty((len(first), len(places), query_state.obs_size), dtype=np.float32)
            observed: list[PersonValues] = []
            for row, person in enumerate(first.tolist()):
                obs[row] = query_state.observe(places, person)
                observed.append((person, query_state.observed.copy()))
            observed.sort(key=lambda one: one[0] or 0)
            acts = self.actor.acts(obs.reshape(-1, query_state.obs_size))
            shares_of_acts = np.outer(counts[first], shares).ravel()
        else:
            acts = self.actor.acts(query_state.observe(places))
            observed, shares_of_acts = [(nearest, query_state.observed.copy())], shares
        targets: tuple[TargetWeight, ...] = ()
        if mode == "interpolated":
            targets = tuple(
                TargetWeight(position=(x, y, z), weight=w)
                for (x, y, z), w in zip(places.tolist(), shares.tolist(), strict=True)
            )
        return shares_of_acts @ acts.astype(np.float64), targets, weights, observed

    def _segment(self, robot: MeasuredState, act: Vec) -> tuple[TrajectorySegment, bool]:
        """Return the commanded segment, and whether a joint had no admissible coefficient."""
        arm, (q, qd, _) = self.arm, robot.measured
        act, limits = returning(arm, q, act)
        c, d, q1, qd1, qdd1 = np.empty((5, 6))
        start, end = JointState(q, qd, robot.clamped.qdd), JointState(q1, qd1, qdd1)
        segment, commanded = actions.Coefficients(c, d), act.astype(np.float32)
        arguments = (self._rule, limits, arm.dt, start, commanded, segment, end)
        if self._advance is None:
            self._advance = direct(actions.advance, arguments)
        empty = self._advance(*arguments) or limits is not arm.limits
        return TrajectorySegment(c=c, d=d, q=q1, qd=qd1, qdd=qdd1), bool(empty)

    def _monitored(
        self,
        query: MotionQuery,
        robot: MeasuredState,
        segment: TrajectorySegment,
        people: Shapes | None,
        order: Sequence[int],
    ) -> Monitored:
        """Return the decision of the safety layer and the terms of the decisive person."""
        settings = query.safety
        if settings is None or people is None:
            return None, None, None
        q, qd, _ = robot.measured
        if settings != self._layer.settings:
            self._layer = SafetyLayer(self.arm, settings)
        safe = self._layer.decide(q, qd, segment.c, segment.d, people, query.age_s)
        decisive = self._layer.terms(safe, qd, people, query.age_s)
        if decisive is None:
            return safe, None, None
        return safe, order[decisive[0]], decisive[1]


def _require_no_overlap(separations: Sequence[float], order: Sequence[int]) -> None:
    """Check that no person overlaps the robot.

    Raises:
        InvalidInput: A person overlaps the robot.
    """
    for index, distance in zip(order, separations, strict=True):
        if distance <= 0.0:
            rule = (
                "is the distance to the robot in m: this person is inside it; with `safety` "
                "the answer would be a stop"
            )
            raise InvalidInput(f"people[{index}]", round(distance, 4), rule)
