"""The next piece of motion toward a goal beside people (METHOD 2.2, 2.4, 2.7).

State, people and goal in, one polynomial per joint out: the policy's action, interpolated
between its training targets where the goal lies between them, turned into the piece that keeps
every limit, and the override at which speed and separation monitoring lets it run. Nothing is
remembered from one call to the next: the speeds hold all that the next period needs.
"""

import threading
import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from app.errors import InvalidInput
from app.policies.interpolation import Interpolation, interpolates
from app.policies.lookahead import OTHERS, PASSED, Lookahead, looks_ahead
from app.policies.movers import person_weights
from app.sim import human
from app.sim.cell_reach import LONGEST_REACH, SHOULDER
from app.sim.cells import Cell, require_cell
from app.sim.checker import Shapes
from app.sim.kernels import actions
from app.sim.motion_ports import (
    BESIDES,
    WAYS,
    Met,
    MotionDecision,
    MotionQuestion,
    TargetWeight,
    Way,
)
from app.sim.motion_state import Stage
from app.sim.pick import Piece
from app.sim.ports import OutsideField, Person, ReachActor, Vec
from app.sim.reach import goal_region_of
from app.sim.safety import SafetyDecision, SafetyLayer, SafetySettings, SeparationTerms
from app.sim.scene import FAR_AWAY, arm_of
from app.sim.seen_people import checked_people, checked_vector, standing_in

SLACK = 1e-6
"""How far outside a limit a measured joint may be."""
RANGE_SLACK = 0.02
"""Inputs this far outside what was met in training are not flagged [m, rad or per second]."""
LONGEST_S = 60.0
"""Longest time left to reach a goal [s]."""
_FAR = np.full(3, 10.0)
FIELDS = (("robot.q", "rad"), ("robot.qd", "rad/s"), ("robot.qdd", "rad/s^2"), ("goal", "m"))
"""What messages call the vectors of a question, and their units."""
_SHAPES = [(6,), (6,), (6,), (3,)]
HUMAN = ("x", "y", "vx", "vy", "r", "growth")
"""What a policy sees of a person."""
ROBOT = (
    *(f"robot.q[{j}]" for j in range(6)),
    *(f"robot.qd[{j}]" for j in range(6)),
    *("goal.x", "goal.y", "goal.z"),
)
"""What messages call the numbers of ``q``, ``qd`` and ``goal`` of a ``trained_range``."""

Seen = tuple[int | None, Vec]
"""A person, bodies first, or None for nobody, and the cylinder a policy saw, shape (6,)."""
Told = tuple[SafetyDecision | None, int | None, SeparationTerms | None]


class _Trained(NamedTuple):
    """What was met in training of some numbers, and with slack; infinite where unknown."""

    low: Vec
    high: Vec
    least: Vec
    most: Vec


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
        self._rule = actor.action.rule()
        qd_max, qdd_max = self.arm.qd_max + SLACK, self.arm.qdd_max + SLACK
        self._each_limits = (
            (self.arm.q_min - SLACK, self.arm.q_max + SLACK),
            (-qd_max, qd_max),
            (-qdd_max, qdd_max),
            (-_FAR, _FAR),
        )
        low, high = zip(*self._each_limits, strict=True)
        self._limits = np.concatenate(low), np.concatenate(high)
        self._robot = _trained(actor.trained_range, {"q": 6, "qd": 6, "goal": 3})
        self._person = _trained(actor.trained_range, {"human": len(HUMAN)})
        self._stages: dict[tuple[int, int], Stage] = {}
        self._aheads: dict[Stage, Lookahead] = {}
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
        q, qd, qdd, goal = self._numbers(question)
        people = checked_people(question.people)
        way, looks = self._way(question.way), self._looks(question.ahead)
        order = _bodies_first(people)
        known = [people[i] for i in order]
        with self._busy:
            stage = self._stage(known)
            stage.put(q, qd, known, question.time_left_s)
            apart = stage.apart.copy()
            if question.safety is None:
                _require_apart(apart, order)
            act, targets, weights, seen = self._act(stage, question, goal, way)
            began = self._improve(stage, goal, qdd, act) if looks else None
            piece, unfeasible = self._piece(q, qd, qdd, act)
            safe, terms_of, terms = self._monitored(question, q, qd, piece, stage.shapes, order)
            outside = [one for who, what in seen for one in self._human(who, what, order)]
            clearance, distance = stage.clear.tolist(), float(np.linalg.norm(stage.tcp - goal))
        place = np.argsort(order)
        return MotionDecision(
            act=act,
            ahead=looks,
            began=began,
            piece=piece,
            unfeasible=unfeasible,
            way=way,
            targets=targets,
            met=tuple(Met(separation=float(apart[i]), weight=float(weights[i])) for i in place),
            seen=order[int(apart.argmin())] if order else None,
            safe=safe,
            terms=terms,
            terms_of=terms_of,
            clearance=(clearance[0], clearance[1], clearance[2]),
            distance=distance,
            beyond_reach=self._beyond_reach(goal),
            outside=(*self._outside(q, qd, goal), *outside),
            checkpoint=self.checkpoint,
            elapsed_ms=1e3 * (time.perf_counter() - started),
        )

    def warm_up(self) -> None:
        """Compile what a decision needs, before the first one is asked for."""
        q, goal = self.arm.home.copy(), np.array(goal_region_of(self.cell).center)
        people = (
            Person(q=human.rest_posture(*FAR_AWAY), qd=np.zeros(18)),
            standing_in(-1.5, 2.0, 0.0, 0.0, 0.3),
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

    def _numbers(self, question: MotionQuestion) -> tuple[Vec, Vec, Vec, Vec]:
        """Return q, qd, qdd and goal once they keep their rules."""
        if question.qdd is None and self.actor.action.degree == 3:
            rule = "must be given: this policy limits jerk, which needs the accelerations"
            raise InvalidInput("robot.qdd", None, rule)
        given = np.zeros(6) if question.qdd is None else question.qdd
        parts = [
            np.asarray(values, dtype=np.float64)
            for values in (question.q, question.qd, given, question.goal)
        ]
        if [part.shape for part in parts] != _SHAPES or not _within(self._limits, parts):
            parts = [
                checked_vector(name, part, len(low), low, high, unit)
                for (name, unit), part, (low, high) in zip(
                    FIELDS, parts, self._each_limits, strict=True
                )
            ]
        q, qd, qdd, goal = parts
        for name, value in (("time_left_s", question.time_left_s), ("age_s", question.age_s)):
            if not 0.0 <= value <= LONGEST_S:
                raise InvalidInput(name, value, f"must lie in [0, {LONGEST_S:g}] s")
        if question.beside not in BESIDES:
            raise InvalidInput("beside", question.beside, "must name a rule", BESIDES)
        return q, qd, qdd, goal

    def _way(self, asked: Way | None) -> Way:
        if asked is None:
            return "direct" if self._between is None else "interpolated"
        if asked not in WAYS:
            raise InvalidInput("way", asked, "must name a way", WAYS)
        if asked == "interpolated" and self._between is None:
            rule = "needs training targets, and this policy was trained on all of a box"
            raise InvalidInput("way", asked, rule, ("direct",))
        return asked

    def _looks(self, asked: bool | None) -> bool:
        able = looks_ahead(self.actor)
        if asked and not able:
            rule = "needs a policy that sees forecasts of people, with two hidden layers"
            raise InvalidInput("ahead", True, rule, ("false",))
        return able if asked is None else asked

    def _improve(self, stage: Stage, goal: Vec, qdd: Vec, act: Vec) -> str | None:
        """Play an action ahead; change it where another way is better, and return its name."""
        if stage not in self._aheads:
            self._aheads[stage] = Lookahead(self.actor)
        state = stage.state
        state.goal[0], state.qdd[0] = goal, qdd
        played = act[None].astype(np.float32)
        chosen = int(self._aheads[stage].improve(stage, played)[0])
        if chosen == PASSED:
            return None
        act[:] = played[0]
        return OTHERS[chosen]

    def _stage(self, people: Sequence[Person]) -> Stage:
        n_bodies = sum(person.cylinder is None for person in people)
        kinds = (n_bodies, len(people) - n_bodies)
        if kinds not in self._stages:
            self._stages[kinds] = Stage(self.cell, *kinds, self.actor.view)
        return self._stages[kinds]

    def _act(
        self, stage: Stage, question: MotionQuestion, goal: Vec, way: Way
    ) -> tuple[Vec, tuple[TargetWeight, ...], Vec, list[Seen]]:
        """Return action, targets, weights of the people and who was seen, as what."""
        apart = stage.apart
        places, shares = goal[None], np.ones(1)
        if way == "interpolated":
            assert self._between is not None
            mix, around = self._between.around(goal[None])
            used = mix.weights[0] > 0.0
            places, shares = around[0, used], mix.weights[0, used]
        asked: list[int | None] = [None]
        weights, beside = np.zeros(len(apart)), np.ones(1)
        if question.beside == "averaged" and len(apart) > 1:
            # The nearest first: answers are rounded by their place in the batch.
            first, weights = apart.argsort(), person_weights(apart[None])[0]
            asked, beside = first.tolist(), weights[first]
        elif len(apart):
            weights[apart.argmin()] = 1.0
        seen: list[Seen] = []
        obs = np.empty((len(asked), len(places), stage.obs_size), dtype=np.float32)
        for row, who in enumerate(asked):
            obs[row] = stage.observe(places, who)
            number = who if who is not None or not len(apart) else int(apart.argmin())
            seen.append((number, stage.seen.copy()))
        acts = self.actor.acts(obs.reshape(-1, stage.obs_size))
        act = np.outer(beside, shares).ravel() @ acts.astype(np.float64)
        targets = tuple(
            TargetWeight(position=(p[0], p[1], p[2]), weight=w)
            for p, w in zip(places.tolist(), shares.tolist(), strict=True)
        )
        seen.sort(key=lambda one: one[0] or 0)
        return act, targets if way == "interpolated" else (), weights, seen

    def _piece(self, q: Vec, qd: Vec, qdd: Vec, act: Vec) -> tuple[Piece, bool]:
        """Return the commanded piece, and whether a joint had to brake for want of one."""
        arm = self.arm
        c, d, q1, qd1, qdd1 = np.empty((5, 6))
        empty = actions.advance(
            self._rule, q, qd, qdd, act.astype(np.float32), arm.q_min, arm.q_max, arm.qd_max,
            arm.qdd_max, arm.jerk_max, arm.dt, c, d, q1, qd1, qdd1,
        )  # fmt: skip
        return Piece(c=c, d=d, q=q1, qd=qd1, qdd=qdd1), bool(empty)

    def _monitored(
        self,
        question: MotionQuestion,
        q: Vec,
        qd: Vec,
        piece: Piece,
        people: Shapes,
        order: Sequence[int],
    ) -> Told:
        """Return what monitoring executes, and the terms for one person."""
        settings = question.safety
        if settings is None:
            return None, None, None
        if settings != self._layer.settings:
            self._layer = SafetyLayer(self.arm, settings)
        safe = self._layer.decide(q, qd, piece.c, piece.d, people, question.age_s)
        told = self._layer.terms(safe, qd, people, question.age_s)
        if told is None:
            return safe, None, None
        return safe, order[told[0]], told[1]

    def _beyond_reach(self, goal: Vec) -> float:
        """Return by how much a goal is farther away than the arm is long [m]."""
        longest = LONGEST_REACH + max(self.arm.tool_length - 0.12, 0.0)
        return max(0.0, float(np.linalg.norm(goal - SHOULDER)) - longest)

    def _outside(self, q: Vec, qd: Vec, goal: Vec) -> tuple[OutsideField, ...]:
        """Return what of robot and goal lies outside the training range."""
        return _beyond(self._robot, np.concatenate((q, qd, goal)), ROBOT)

    def _human(
        self, who: int | None, seen: Vec, order: Sequence[int]
    ) -> tuple[OutsideField, ...]:
        """Return what of a person, or of nobody, lies outside the training range."""
        if who is None:
            met = _beyond(self._person, seen, HUMAN)
            nobody = OutsideField(field="people", value=0.0, low=1.0, high=4.0)
            return (nobody,) if met else ()
        return _beyond(self._person, seen, [f"people[{order[who]}].{name}" for name in HUMAN])


def _within(limits: tuple[Vec, Vec], parts: Sequence[Vec]) -> bool:
    """Return whether all numbers of some vectors lie within limits, which are joined."""
    together, (low, high) = np.concatenate(parts), limits
    return bool(((low <= together) & (together <= high)).all())


def _trained(
    ranges: Mapping[str, Mapping[str, Sequence[float]]], sizes: Mapping[str, int]
) -> _Trained:
    """Return what a manifest says was met of some variables of these lengths, joined."""
    n, first = sum(sizes.values()), 0
    low, high = np.full(n, -np.inf), np.full(n, np.inf)
    for name, size in sizes.items():
        entry = ranges.get(name)
        if entry is not None and len(entry["low"]) <= size:
            known = slice(first, first + len(entry["low"]))
            low[known], high[known] = entry["low"], entry["high"]
        first += size
    return _Trained(low, high, low - RANGE_SLACK, high + RANGE_SLACK)


def _beyond(met: _Trained, values: Vec, names: Sequence[str]) -> tuple[OutsideField, ...]:
    """Return which of some numbers lie outside what was met in training."""
    inside = (met.least <= values) & (values <= met.most)
    if inside.all():
        return ()
    return tuple(
        OutsideField(
            field=names[i],
            value=float(values[i]),
            low=float(met.low[i]),
            high=float(met.high[i]),
        )
        for i in np.flatnonzero(~inside).tolist()
    )


def _bodies_first(people: Sequence[Person]) -> list[int]:
    """Return the numbers of people with joint angles, then of cylinders."""
    return sorted(range(len(people)), key=lambda i: people[i].cylinder is not None)


def _require_apart(apart: Vec, order: Sequence[int]) -> None:
    """Raise where somebody is inside the robot.

    Raises:
        InvalidInput: Somebody is.
    """
    for i in np.flatnonzero(apart <= 0.0)[:1]:
        rule = (
            "is the distance to the robot in m: this person is inside it; with `safety` the "
            "answer would be a stop"
        )
        raise InvalidInput(f"people[{order[i]}]", round(float(apart[i]), 4), rule)
