"""The next piece of motion toward a goal beside people (METHOD 2.2, 2.4, 2.7).

State, people and goal in, one polynomial per joint out: the policy's action, interpolated
between its training targets where the goal lies between them, turned into the piece that keeps
every limit, and the override at which speed and separation monitoring lets it run. Nothing is
remembered from one call to the next: the speeds hold all that the next period needs.
"""

import math
import threading
import time
from collections.abc import Callable, Sequence

import numpy as np

from app.errors import InvalidInput
from app.policies.checkpoints.trained_values import Seen, TrainedValues, as_told
from app.policies.inference.controllers import person_weights
from app.policies.inference.rollout import (
    CANDIDATES,
    POLICY,
    RolloutImprovement,
    can_roll_out,
    ssm_constraint_of,
)
from app.policies.inference.target_interpolation import Interpolation, interpolates
from app.sim.cell_validation.reachability import LONGEST_REACH, SHOULDER
from app.sim.cells.cell import Cell, require_cell
from app.sim.collision.checker import Shapes
from app.sim.core.arrays import Vec
from app.sim.core.jit import direct
from app.sim.human import model as human
from app.sim.human.person import Person
from app.sim.perception.observed_people import (
    as_known,
    checked_people,
    checked_vector,
    person_from_cylinder,
)
from app.sim.reach.batch import goal_region_of
from app.sim.reach.monitored.batch import HORIZON_S
from app.sim.reach.motion_types import (
    BESIDES,
    MOTION_MODES,
    MotionDecision,
    MotionMode,
    MotionQuestion,
    PersonWeight,
    TargetWeight,
)
from app.sim.reach.query_state import QueryState
from app.sim.reach.reach_actor import ReachActor
from app.sim.robot.kernels import actions
from app.sim.robot.kernels.joints import JointState
from app.sim.robot.measured_state import MeasuredState, StateLimits, returning
from app.sim.robot.trajectory_segment import TrajectorySegment
from app.sim.safety.decision import SafetyDecision, SeparationTerms
from app.sim.safety.layer import SafetyLayer, SafetySettings
from app.sim.scene.scene import FAR_AWAY, arm_of

_FAR = np.full(3, 10.0)
Told = tuple[SafetyDecision | None, int | None, SeparationTerms | None]


class MotionDecider:
    """Says how to move by one policy; safe to call from several threads.

    Args:
        actor: The policy.
        cell: The cell it was trained in.

    Raises:
        CheckpointMismatch: It was trained in another cell.
        InvalidInput: The cell has no goals.
    """

    def __init__(self, actor: ReachActor, cell: Cell) -> None:
        require_cell(cell, actor.cell, actor.cell_sha256)
        self.actor, self.cell, self.arm = actor, cell, arm_of(cell)
        self._between = Interpolation(actor) if interpolates(actor) else None
        self._able = can_roll_out(actor)
        self._rule = actor.action.rule()
        self._advance: Callable[..., bool] | None = None
        self._limits = StateLimits(self.arm, limits_jerk=actor.action.degree == 3)
        self._met = TrainedValues(actor.trained_range)
        self._stages: dict[tuple[int, int], QueryState] = {}
        self._last: dict[tuple[int, int], QueryState] = {}
        self._aheads: dict[QueryState, RolloutImprovement] = {}
        self._layer = SafetyLayer(self.arm, SafetySettings())
        self._busy = threading.Lock()

    @property
    def checkpoint(self) -> str:
        """SHA-256 of the checkpoint."""
        return self.actor.checkpoint

    def decide(self, question: MotionQuestion) -> MotionDecision:
        """Return the next piece of motion.

        Raises:
            InvalidInput: A number that no answer can be given for; somebody inside the robot,
                unless monitoring stops it.
            GoalOutside: Interpolation is asked for a goal outside the training targets.
        """
        started = time.perf_counter()
        robot, goal = self._numbers(question)
        people = checked_people(question.people)
        way, looks = self._way(question.inference_mode), self._looks(question.rollout)
        order = _bodies_first(people)
        known = [people[i] for i in order]
        with self._busy:
            stage = self._stage(known, self._stages)
            time_left = min(max(0.0, question.time_left_s), HORIZON_S)
            stage.load(robot.measured, known, time_left)
            apart, clearance = stage.distances.tolist(), stage.clear.tolist()
            distance, shapes = math.dist(stage.tcp, goal), stage.shapes
            if question.safety is None:
                _require_apart(apart, order)
            # Distances and monitoring go by what was measured, the policy by what it knows.
            viewed = [as_known(person) for person in known]
            if robot.outside or any(a is not b for a, b in zip(known, viewed, strict=True)):
                stage.load(robot.clamped, viewed, time_left)
            nearest = int(stage.distances.argmin()) if order else None
            act, targets, weights, seen = self._act(stage, question, goal, way)
            began = self._improve(stage, question, goal, act) if looks else None
            piece, unfeasible = self._piece(robot, act)
            shapes, places = self._observed(question.observed, robot) or (shapes, order)
            safe, terms_of, terms = self._monitored(question, robot, piece, shapes, places)
            state = np.concatenate((robot.clamped.q, robot.clamped.qd, goal))
            outside = self._met.outside(state, as_told(seen, known, viewed), order)
        met = [
            PersonWeight(separation=d, weight=w) for d, w in zip(apart, weights, strict=True)
        ]
        place = sorted(range(len(order)), key=order.__getitem__)
        return MotionDecision(
            act=act,
            rollout=looks,
            candidate=began,
            piece=piece,
            unfeasible=unfeasible,
            inference_mode=way,
            targets=targets,
            met=tuple(met[i] for i in place),
            seen=None if nearest is None else order[nearest],
            safe=safe,
            terms=terms,
            terms_of=terms_of,
            clearance=(clearance[0], clearance[1], clearance[2]),
            distance=distance,
            beyond_reach=self._beyond_reach(goal),
            state_outside=robot.outside,
            outside=outside,
            checkpoint=self.checkpoint,
            elapsed_ms=1e3 * (time.perf_counter() - started),
        )

    def warm_up(self) -> None:
        """Compile what a decision needs, before the first one is asked for."""
        q, goal = self.arm.home.copy(), np.array(goal_region_of(self.cell).center)
        people = (
            Person(q=human.rest_posture(*FAR_AWAY), qd=np.zeros(18)),
            person_from_cylinder(-1.5, 2.0, 0.0, 0.0, 0.3),
        )
        qdd = np.zeros(6)
        for seen in ((), people[:1], people[1:]):
            self.decide(
                MotionQuestion(
                    q=q,
                    qd=np.zeros(6),
                    qdd=qdd,
                    goal=goal,
                    people=seen,
                    safety=SafetySettings(),
                )
            )

    def _numbers(self, question: MotionQuestion) -> tuple[MeasuredState, Vec]:
        """Return the robot's state and the goal once they keep their rules."""
        if question.qdd is None and self.actor.action.degree == 3:
            rule = "must be given: this policy limits jerk, which needs the accelerations"
            raise InvalidInput("robot.qdd", None, rule)
        robot = self._limits.take(question.q, question.qd, question.qdd)
        goal = checked_vector("goal", question.goal, 3, -_FAR, _FAR, "m")
        if not math.isfinite(question.time_left_s):
            raise InvalidInput("time_left_s", question.time_left_s, "must be finite [s]")
        for name in ("elapsed_s", "age_s"):
            value = getattr(question, name)
            if not 0.0 <= value < math.inf:
                raise InvalidInput(name, value, "must be finite and not negative [s]")
        if question.beside not in BESIDES:
            raise InvalidInput("beside", question.beside, "must name a rule", BESIDES)
        return robot, goal

    def _way(self, asked: MotionMode | None) -> MotionMode:
        if asked is None:
            return "direct" if self._between is None else "interpolated"
        if asked not in MOTION_MODES:
            raise InvalidInput("inference_mode", asked, "must be a mode", MOTION_MODES)
        if asked == "interpolated" and self._between is None:
            rule = "needs training targets, and this policy was trained on all of a box"
            raise InvalidInput("inference_mode", asked, rule, ("direct",))
        return asked

    def _looks(self, asked: bool | None) -> bool:
        if asked and not self._able:
            rule = "needs a policy that sees forecasts of people, with two hidden layers"
            raise InvalidInput("rollout", True, rule, ("false",))
        return self._able if asked is None else asked

    def _improve(
        self, stage: QueryState, question: MotionQuestion, goal: Vec, act: Vec
    ) -> str | None:
        """Play an action ahead; change it where another way is better, and return its name."""
        if stage not in self._aheads:
            self._aheads[stage] = RolloutImprovement(self.actor)
        ahead = self._aheads[stage]
        ahead.forget()
        ahead.constraint = ssm_constraint_of(question.safety, self.arm.dt, question.age_s)
        state = stage.state
        state.goal[0], state.elapsed[0] = goal, question.elapsed_s
        played = act[None].astype(np.float32)
        chosen = int(ahead.improve(stage, played)[0])
        if chosen == POLICY:
            return None
        act[:] = played[0]
        return CANDIDATES[chosen]

    def _observed(
        self, observed: Sequence[Person] | None, robot: MeasuredState
    ) -> tuple[Shapes, list[int]] | None:
        """Return people as last observed, bodies first, and their places; None: as seen."""
        if observed is None:
            return None
        people = checked_people(observed)
        places = _bodies_first(people)
        last = [people[i] for i in places]
        stage = self._stage(last, self._last)
        stage.load(robot.measured, last, 0.0)
        return stage.shapes, places

    def _stage(
        self, people: Sequence[Person], stages: dict[tuple[int, int], QueryState]
    ) -> QueryState:
        n_bodies = sum(person.cylinder is None for person in people)
        kinds = (n_bodies, len(people) - n_bodies)
        if kinds not in stages:
            stages[kinds] = QueryState(self.cell, *kinds, self.actor.view)
        return stages[kinds]

    def _act(
        self, stage: QueryState, question: MotionQuestion, goal: Vec, way: MotionMode
    ) -> tuple[Vec, tuple[TargetWeight, ...], list[float], list[Seen]]:
        """Return action, targets, weights of the people and who was seen, as what."""
        apart = stage.distances
        nearest = int(apart.argmin()) if len(apart) else None
        places, shares = goal[None], np.ones(1)
        if way == "interpolated":
            assert self._between is not None
            mix, around = self._between.around(goal[None])
            used = mix.weights[0] > 0.0
            places, shares = around[0][used], mix.weights[0][used]
        weights = [float(who == nearest) for who in range(len(apart))]
        if question.beside == "distance-weighted" and len(apart) > 1:
            # The nearest first: answers are rounded by their place in the batch.
            counts = person_weights(apart[None])[0]
            first, weights = apart.argsort(), counts.tolist()
            obs = np.empty((len(first), len(places), stage.obs_size), dtype=np.float32)
            seen: list[Seen] = []
            for row, who in enumerate(first.tolist()):
                obs[row] = stage.observe(places, who)
                seen.append((who, stage.seen.copy()))
            seen.sort(key=lambda one: one[0] or 0)
            acts = self.actor.acts(obs.reshape(-1, stage.obs_size))
            shares_of_acts = np.outer(counts[first], shares).ravel()
        else:
            acts = self.actor.acts(stage.observe(places))
            seen, shares_of_acts = [(nearest, stage.seen.copy())], shares
        targets: tuple[TargetWeight, ...] = ()
        if way == "interpolated":
            targets = tuple(
                TargetWeight(position=(x, y, z), weight=w)
                for (x, y, z), w in zip(places.tolist(), shares.tolist(), strict=True)
            )
        return shares_of_acts @ acts.astype(np.float64), targets, weights, seen

    def _piece(self, robot: MeasuredState, act: Vec) -> tuple[TrajectorySegment, bool]:
        """Return the commanded piece from the measured state, and whether it is unfeasible."""
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
        question: MotionQuestion,
        robot: MeasuredState,
        piece: TrajectorySegment,
        people: Shapes,
        order: Sequence[int],
    ) -> Told:
        """Return what monitoring executes, and the terms for one person."""
        settings = question.safety
        if settings is None:
            return None, None, None
        q, qd, _ = robot.measured
        if settings != self._layer.settings:
            self._layer = SafetyLayer(self.arm, settings)
        safe = self._layer.decide(q, qd, piece.c, piece.d, people, question.age_s)
        told = self._layer.terms(safe, qd, people, question.age_s)
        if told is None:
            return safe, None, None
        return safe, order[told[0]], told[1]

    def _beyond_reach(self, goal: Vec) -> float:
        """Return by how much a goal is farther away than the arm is long [m]."""
        longest = LONGEST_REACH + max(self.arm.lengths.tool - 0.12, 0.0)
        return max(0.0, math.dist(goal, SHOULDER) - longest)


def _bodies_first(people: Sequence[Person]) -> list[int]:
    """Return the numbers of people with joint angles, then of cylinders."""
    return sorted(range(len(people)), key=lambda i: people[i].cylinder is not None)


def _require_apart(apart: Sequence[float], order: Sequence[int]) -> None:
    """Raise where somebody is inside the robot.

    Raises:
        InvalidInput: Somebody is.
    """
    for who, distance in zip(order, apart, strict=True):
        if distance <= 0.0:
            rule = (
                "is the distance to the robot in m: this person is inside it; with `safety` "
                "the answer would be a stop"
            )
            raise InvalidInput(f"people[{who}]", round(distance, 4), rule)
