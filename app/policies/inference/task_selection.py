"""Task selection by the critic (docs/method.md 3.1).

``R_i = Q(s_i, pi(s_i))`` for every candidate, with the smaller of both critics; the candidate
with the greatest value is selected. With hysteresis the previous target is kept unless another
one is better by a margin, which prevents oscillation. A candidate out of reach is selected only
if none is in reach, because critics were trained with targets in reach. HTTP route, live cell
and evaluations use the same networks.

Source: thesis eq. (5.1)-(5.7). Deviates: hysteresis is ours (0 gives the thesis' rule), and so
is the rule on reach.
"""

import math
import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.inference.moved_person import scenes_of
from app.policies.inference.pick_training_range import PickTrainingRange
from app.policies.inference.trained_policy import TrainedPolicy
from app.policies.inference.value_networks import ValueNetworks, pick_preset_of
from app.policies.networks.outcome import OutcomePrediction, estimates_of
from app.sim.cells.cell import Cell, require_cell
from app.sim.core.arrays import Vec
from app.sim.core.kernels.bounds import are_inside
from app.sim.core.out_of_range import OutOfRangeValue
from app.sim.human import model as human
from app.sim.human.person import Person
from app.sim.perception.observed_people import (
    checked_and_known,
    checked_people,
    checked_vector,
    is_far,
    nearest_index,
    with_known_yaw,
)
from app.sim.pick.batch import step_robot
from app.sim.pick.candidate_observer import CandidateObserver
from app.sim.pick.kernels.grasp import LIFT, GraspRules
from app.sim.pick.kernels.observation_layout import FARTHEST, PRESENT_WITHIN
from app.sim.pick.task_policy import (
    FRESH,
    NOT_BEGUN,
    Candidate,
    ChoiceTerms,
    Decision,
    MovedPerson,
    Objective,
    PickProgress,
    RiskMap,
)
from app.sim.robot.actions import ActionSettings
from app.sim.robot.kernels.arm import CONTROLLED
from app.sim.robot.measured_state import MeasuredState, StateLimits
from app.sim.scene.scene import FAR_AWAY, arm_of, people_of

HYSTERESIS = 0.5
"""Margin of the value by which another candidate must be better."""
LEAST_SUCCESS = 0.01
"""Least probability of success that an expected time is divided by."""
LONGEST_S = 60.0
"""Maximum observed remaining time [s]."""
MAX_CANDIDATES = 1000
"""Maximum number of candidates of one query."""

_LOWEST, _HIGHEST = np.full(3, -10.0), np.full(3, 10.0)
"""Bounds of the coordinates of a candidate [m]."""
_FAR_PERSON = Person(q=human.rest_posture(*FAR_AWAY), qd=np.zeros(18))
"""Observed person of an empty cell."""
_NEAR_PERSON = Person(q=human.rest_posture(0.0, 1.0, -math.pi / 2.0), qd=np.zeros(18))
"""Person in front of the robot."""
_MAX_PROBED = 32
"""Most targets by which the numbers of a policy are checked."""
_ROWS_AT_ONCE = 1024
"""Most rows of a map, positions times candidates, that are evaluated at once: the compiled
functions keep the GIL, and other threads run in between."""


def select(
    values: NDArray[np.floating], previous: NDArray[np.int64] | int | None, hysteresis: float
) -> NDArray[np.int64]:
    """Return the index of the selected candidate, shape (...,).

    Args:
        values: Value of each candidate, shape (..., n); -inf where there is none.
        previous: Index selected last, shape (...,); None: none.
        hysteresis: Margin by which another candidate must be better; 0 is the thesis' rule.
    """
    best: NDArray[np.int64] = values.argmax(axis=-1)
    if previous is None:
        return best
    last = np.expand_dims(previous, -1)
    gain = values.max(axis=-1) - np.take_along_axis(values, last, axis=-1)[..., 0]
    return np.where(gain > hysteresis, best, previous)


class _SelectionQuery(NamedTuple):
    """Checked input of a decision."""

    state: MeasuredState
    ids: list[str]
    goals: Vec
    """Positions of the candidates [m], shape (n, 3)."""
    last: int | None
    """Index of the candidate chosen last."""
    terms: ChoiceTerms


class _Evaluation(NamedTuple):
    """Evaluation of n candidates beside m sets of people."""

    reachable: NDArray[np.bool_]
    """Shape (n,)."""
    act: NDArray[np.float32]
    """Actions, shape (m n, 5)."""
    values: NDArray[np.float32]
    """Shape (m, n)."""
    outcomes: OutcomePrediction | None
    """Of m n rows."""
    chosen: NDArray[np.int64]
    """Index of the chosen candidate, shape (m,)."""


class TaskChooser(TrainedPolicy):
    """A :class:`~app.sim.pick.task_policy.TaskPolicy` made of one checkpoint.

    Args:
        checkpoint: A ``policy`` checkpoint.
        cell: Work cell of the decisions; by default the training cell.

    Raises:
        CheckpointMismatch: The checkpoint is for another cell or layout.
    """

    def __init__(self, checkpoint: Checkpoint, cell: Cell | None = None) -> None:
        super().__init__(checkpoint)
        if cell is not None:
            require_cell(cell, self.cell, self.cell_sha256)
        preset = pick_preset_of(checkpoint)
        self.action: ActionSettings = preset.action.settings
        """Meaning of the actions (docs/method.md 2.2)."""
        self.grasp: GraspRules = preset.episode.grasp
        """Phases of a pick."""
        self.observed_people = 2 if preset.episode.observation == "two-people" else 1
        """Greatest number of people that the policy observes at once."""
        self._networks = ValueNetworks(checkpoint)
        self._arm, self._people = arm_of(self._cell), people_of(self._cell)
        n_obs = self._networks.n_obs
        self._observer = CandidateObserver(self._cell, n_obs=n_obs, grasp=self.grasp)
        self._limits = StateLimits(self._arm, limits_jerk=False)
        self._ranges = PickTrainingRange(checkpoint)

    def require_finite(self) -> None:
        """Check that the networks give finite numbers in the training cell.

        The robot is at home, the targets are stations, and a person is there or not.

        Raises:
            CheckpointMismatch: A number is not finite: sums of large weights overflow.
        """
        goals = np.array([one.position for one in self._cell.stations[:_MAX_PROBED]])
        robot, body = (self._arm.home, np.zeros(6)), self._people.bodies[0]
        for person in (_FAR_PERSON, _NEAR_PERSON):
            obs, _ = self._observer.observe(robot, _arrays([(None, person)], body), goals, 10.0)
            self._networks.require_finite(obs)

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
        """Select one candidate; see :class:`~app.sim.pick.task_policy.TaskPolicy`.

        People farther away than in training are not observed (``observed_people.py``). Of the
        others, policies for one person observe the one nearest to the robot; the shipped one
        observes also the one nearest to the candidate.
        """
        started = time.perf_counter()
        terms = ChoiceTerms(previous, progress, time_left_s, objective)
        query = self._query(q, qd, candidates, terms)
        observed = self._observed(query.state.measured.q, people)
        found = self._evaluate(query, _arrays(observed, self._people.bodies[0]))
        index = int(found.chosen[0])
        q, qd, _ = query.state.clamped
        return Decision(
            chosen=query.ids[index],
            index=index,
            values=tuple(found.values[0].tolist()),
            actions=found.act,
            qd_target=self._speeds(q, qd, found.act),
            reachable=tuple(found.reachable.tolist()),
            outside=query.state.outside
            + self._ranges.of_robot(q, qd)
            + self._outside(observed)
            + self._ranges.of_time(query.terms.time_left_s),
            outside_candidates=self._ranges.of_goals(query.goals),
            outcomes=None if found.outcomes is None else estimates_of(found.outcomes),
            checkpoint=self.checkpoint,
            elapsed_ms=1e3 * (time.perf_counter() - started),
            nearest_person=observed[0][0],
        )

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
        """Choose beside a person in several postures, some of them in one batch."""
        started = time.perf_counter()
        query = self._query(q, qd, candidates, terms)
        known, at = checked_people(people), query.state.measured.q
        scenes, clearance = scenes_of(self._arm, self._people, at, known, moved)
        (joints, speeds, sizes), n = scenes, len(query.ids)
        chosen, value = list[NDArray[np.int64]](), list[NDArray[np.float32]]()
        risk = list[NDArray[np.float32]]()
        step = max(1, _ROWS_AT_ONCE // n)
        for k in range(0, len(joints), step):
            part = slice(k, k + step)
            found = self._evaluate(query, (joints[part], speeds[part], sizes[part]))
            rows = np.arange(len(found.chosen)) * n + found.chosen
            chosen.append(found.chosen)
            value.append(found.values.ravel()[rows])
            if found.outcomes is not None:
                risk.append(found.outcomes.probability[rows])
        probability = np.concatenate(risk).astype(np.float64) if risk else None
        return RiskMap(
            chosen=np.concatenate(chosen),
            value=np.concatenate(value).astype(np.float64),
            success=None if probability is None else probability[:, 0],
            contact=None if probability is None else probability[:, 1],
            clearance_m=np.minimum(clearance, FARTHEST),
            outside=self._ranges.are_postures_outside(with_known_yaw(moved.q)),
            elapsed_ms=1e3 * (time.perf_counter() - started),
        )

    def _query(
        self, q: Vec, qd: Vec, candidates: Sequence[Candidate], terms: ChoiceTerms
    ) -> _SelectionQuery:
        """Return a checked query."""
        state = self._limits.take(q, qd)
        ids, goals = _check_candidates(candidates)
        if not math.isfinite(terms.time_left_s):
            raise InvalidInput("time_left_s", terms.time_left_s, "must be finite [s]")
        if terms.objective != "value" and not self._networks.predicts:
            rule = "needs a checkpoint with outcome probabilities"
            raise InvalidInput("objective", terms.objective, rule, ("value",))
        last = ids.index(terms.previous) if terms.previous in ids else None
        observed = min(LONGEST_S, max(0.0, terms.time_left_s))
        return _SelectionQuery(state, ids, goals, last, terms._replace(time_left_s=observed))

    def _evaluate(self, query: _SelectionQuery, people: tuple[Vec, Vec, Vec]) -> _Evaluation:
        """Return values and choices beside people, or beside each of m sets of people."""
        terms, last = query.terms, query.last
        q, qd, _ = query.state.clamped
        obs, reachable = self._observer.observe(
            (q, qd), people, query.goals, terms.time_left_s, last, terms.progress
        )
        act, values, outcomes = self._networks.evaluate(obs)
        by_set = values.reshape(-1, len(query.ids))
        offered = reachable if reachable.any() else ~reachable
        if last is not None and terms.progress.phase == LIFT:
            chosen = np.full(len(by_set), last)
        elif outcomes is None or terms.objective == "value":
            before = None if last is None else np.full(len(by_set), last)
            chosen = select(np.where(offered, by_set, -np.inf), before, HYSTERESIS)
        else:
            success = outcomes.probability[:, 0]
            per_success = outcomes.time_s / np.maximum(success, LEAST_SUCCESS)
            scores = success if terms.objective == "success" else -per_success
            by_score = np.where(offered, scores.reshape(by_set.shape), -np.inf)
            chosen = by_score.argmax(axis=1)
        return _Evaluation(reachable, act, by_set, outcomes, chosen)

    def _speeds(self, q: Vec, qd: Vec, act: NDArray[np.float32]) -> Vec:
        """Return the joint speeds of actions, shape (n, 5) [rad/s], shape (n, 6)."""
        if self.action.meaning == "coefficient":
            segments = (
                step_robot(self._arm, q, qd, np.zeros(6), row, self.action) for row in act
            )
            return np.stack([segment.qd for segment in segments])
        speeds = np.zeros((len(act), 6))
        np.multiply(act, self._arm.limits.qd_max[:CONTROLLED], out=speeds[:, :CONTROLLED])
        return speeds

    def _observed(self, q: Vec, people: Sequence[Person]) -> list[tuple[int | None, Person]]:
        """Return index and state of the observed people, the nearest to the robot first.

        In an empty cell it is a person far away.
        """
        given, known = checked_and_known(people)
        near = [i for i, one in enumerate(given) if one is known[i] or not is_far(one)]
        first = nearest_index(self._arm, self._people, q, [given[i] for i in near])
        if first is None:
            return [(None, _FAR_PERSON)]
        return [(i, known[i]) for i in (near.pop(first), *near)]

    def _outside(
        self, observed: list[tuple[int | None, Person]]
    ) -> tuple[OutOfRangeValue, ...]:
        """Return the fields outside the training range of people who may be observed."""
        (index, first), *others = observed
        found = self._ranges.of_person(first, index)
        if self.observed_people > 1:
            for index, one in others:
                if math.hypot(one.q[0], one.q[1]) < PRESENT_WITHIN:
                    found += self._ranges.of_person(one, index)
        return found


def _arrays(observed: list[tuple[int | None, Person]], body: Vec) -> tuple[Vec, Vec, Vec]:
    """Return joints, joint speeds and body dimensions of people, shape (P, ...) each."""
    people = [person for _, person in observed]
    sizes = [body if person.size is None else person.size for person in people]
    q, qd = np.array([one.q for one in people]), np.array([one.qd for one in people])
    return q, qd, np.array(sizes)


def _check_candidates(candidates: Sequence[Candidate]) -> tuple[list[str], Vec]:
    n = len(candidates)
    if not 1 <= n <= MAX_CANDIDATES:
        raise InvalidInput("candidates", n, f"must be 1 to {MAX_CANDIDATES} of them")
    goals, ids = _positions(candidates), [candidate.id for candidate in candidates]
    if len(set(ids)) < n:
        i = next(i for i, name in enumerate(ids) if name in ids[:i])
        raise InvalidInput(f"candidates[{i}].id", ids[i], "must be given once")
    return ids, goals


def _positions(candidates: Sequence[Candidate]) -> Vec:
    """Return the checked positions of candidates [m], shape (n, 3)."""
    given = [candidate.position for candidate in candidates]
    try:
        goals = np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        goals = np.empty(0)
    if goals.shape == (len(given), 3) and are_inside(goals.ravel(), _LOWEST, _HIGHEST):
        return goals
    paths = (f"candidates[{i}].position" for i in range(len(given)))
    checked = [
        checked_vector(path, one, 3, _LOWEST, _HIGHEST, "m")
        for path, one in zip(paths, given, strict=True)
    ]
    return np.array(checked)
