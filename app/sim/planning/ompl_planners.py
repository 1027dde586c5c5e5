"""Sampling-based planners: OMPL with the project's collision checker (docs/method.md 2.6).

A query requests a path of straight joint motions from one configuration to any of several.
Planners: RRT-Connect (the first path found), RRT* (Karaman and Frazzoli 2011; shortest path
within the time, as in the thesis' comparison) and AORRTC (Wilson et al. 2025; almost-surely
optimal RRT-Connect). Path length is Euclidean in joint space [rad]. OMPL is used only if the
straight motion to the nearest goal, the shortest path, is not free (AORRTC of 2.0.1 returns
paths that do not begin at the start in that case), and with RRT-Connect only if no goal has
such a motion. The joints beyond the controlled ones stay as they are at the start.

The search ends before its budget of wall time, so that the path can be checked once more; a
step of OMPL in progress may exceed it by a few milliseconds. With ``max_poses`` it ends after
that many poses instead, which makes plans repeatable.

OMPL has one seed generator per process. It is set before each plan under a lock, so that equal
queries with equal seeds and ``max_poses`` give equal plans. OMPL's console output, such as the
warning about repeated seeding, is disabled.
"""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from app.errors import InvalidInput, MissingPackage
from app.sim.collision.checker import Checker
from app.sim.core.arrays import Vec
from app.sim.robot.kernels.arm import CONTROLLED

try:
    from ompl import base as ob
    from ompl import geometric as og
    from ompl import util as ou
except ImportError:  # no wheel for this machine: everything else of the simulator works
    ob = og = ou = None

PLANNERS = ("rrt-connect", "rrt-star", "aorrtc")
OUTCOMES = (
    "solved",
    "approximate",
    "out-of-time",
    "start-in-contact",
    "goal-in-contact",
    "start-outside-limits",
    "no-goal",
)
"""``solved``: a free path to a goal. ``approximate``: a free path that ends short of all goals.
``out-of-time``: no path within the budget. ``start-in-contact``, ``goal-in-contact``: the
start, or every goal, is nearer to something than the margin. ``start-outside-limits``: of the
joints. ``no-goal``: no goal was given, or none is within the limits."""

SAME = 1e-6
"""Difference below which two lengths, or two positions of a joint, are one [rad]."""
LAST_LOOK_S = 0.004
"""Part of the budget reserved for a last check of the path [s]; at most a quarter of it."""
SHORTEN_SHARE = 0.15
"""Part of the budget kept to shorten the path; RRT-Connect uses the whole remainder."""
RANGE_RAD = 0.5
"""Longest motion of a tree's branch [rad]."""
MOST_KEPT = 6
"""Paths kept from while a planner runs."""
LONGEST_S = 3600.0
"""Greatest budget of a plan [s]."""
DETOUR_RAD = 1.5
"""Range of each joint beyond start and goals [rad], within the cell's limits."""
_SEEDING = threading.Lock()


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanSettings:
    """Settings of a planner."""

    planner: str = "rrt-connect"
    """One of PLANNERS."""
    budget_s: float = 1.0
    """Longest wall time [s], shortening included."""
    max_poses: int | None = None
    """Number of checked poses after which planning ends instead; for repeatable plans."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionPlan:
    """Result of one query."""

    outcome: str
    """One of OUTCOMES."""
    path: Vec = field(default_factory=lambda: np.zeros((0, 6)))
    """Configurations joined by straight motions [rad], shape (n, 6); n = 0 without a path."""

    @property
    def solved(self) -> bool:
        """Whether the path reaches a goal."""
        return self.outcome == "solved"


def is_installed() -> bool:
    """Return whether OMPL is installed."""
    return ob is not None


def plan(
    checker: Checker, start: Vec, goals: Vec, settings: PlanSettings, seed: int = 1
) -> MotionPlan:
    """Plan from one configuration to any of several.

    Args:
        checker: People, margins and the robot; people are at rest during planning.
        start: Joint positions [rad], shape (6,).
        goals: Goal configurations, of which one is to be reached [rad], shape (k, 6).
        settings: Settings of the planner.
        seed: Seed, at least 1.

    Raises:
        InvalidInput: A number is NaN or infinite, a shape or a setting breaks its rule.
        MissingPackage: OMPL is not installed.
    """
    _require(settings, seed)
    start, goals = _finite("start", start, 1), _finite("goals", goals, 2)
    clock = _Clock(checker, settings)
    goals[:, CONTROLLED:] = start[CONTROLLED:]
    low, high = planning_limits(checker, start)
    limits = checker.arm.limits
    if np.any(start < limits.q_min - SAME) or np.any(start > limits.q_max + SAME):
        return MotionPlan(outcome="start-outside-limits")
    inside = np.flatnonzero(np.all((goals >= low) & (goals <= high), axis=1))
    if len(inside) == 0:
        return MotionPlan(outcome="no-goal")
    if not checker.is_free(start):
        return MotionPlan(outcome="start-in-contact")
    usable = np.array([k for k in inside if checker.is_free(goals[k])], dtype=np.int64)
    if len(usable) == 0:
        return MotionPlan(outcome="goal-in-contact")
    order = usable[np.argsort(np.linalg.norm(goals[usable] - start, axis=1), kind="stable")]
    direct = next((n for n, k in enumerate(order) if checker.edge_free(start, goals[k])), None)
    if direct is not None:
        straight = MotionPlan(outcome="solved", path=np.stack([start, goals[order[direct]]]))
        if direct == 0 or settings.planner == "rrt-connect":
            return straight
    if not _SEEDING.acquire(timeout=clock.left_s()):
        found = MotionPlan(outcome="out-of-time")
    else:
        try:
            ou.RNG.setSeed(seed)
            nearer = goals[order[:direct]]
            found = _Query(checker, start, nearer, (low, high), settings, clock).solve()
        finally:
            _SEEDING.release()
    if direct is not None and (
        not found.solved or path_length(found.path) > path_length(straight.path)
    ):
        return straight
    return found


def planning_limits(checker: Checker, start: Vec) -> tuple[Vec, Vec]:
    """Return the joint limits that plans keep [rad], each of shape (6,).

    Half a period at full speed inside the cell's limits: there every timed path is viable
    (docs/method.md 2.2), so that it can be followed exactly. A start beyond them is kept.
    """
    inset = 0.5 * checker.arm.limits.qd_max * checker.arm.dt
    return (
        np.minimum(checker.arm.limits.q_min + inset, start),
        np.maximum(checker.arm.limits.q_max - inset, start),
    )


def path_length(path: Vec) -> float:
    """Return the length of a path of straight joint motions, shape (n, 6) [rad]."""
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()) if len(path) else 0.0


class _Clock:
    """The budget of one plan, in time or in poses."""

    def __init__(self, checker: Checker, settings: PlanSettings) -> None:
        self._checker, self._settings = checker, settings
        self._start, self._n0 = time.perf_counter(), checker.n_poses
        self._search_s = settings.budget_s - min(LAST_LOOK_S, 0.25 * settings.budget_s)

    def over(self, share: float = 1.0) -> bool:
        """Return whether this share of the budget is spent."""
        if self._settings.max_poses is not None:
            return self._checker.n_poses - self._n0 >= share * self._settings.max_poses
        return time.perf_counter() - self._start >= share * self._search_s

    def left_s(self) -> float:
        """Return the wall time left to search [s], at least 0; no limit with ``max_poses``."""
        if self._settings.max_poses is not None:
            return threading.TIMEOUT_MAX
        return max(0.0, self._search_s - (time.perf_counter() - self._start))


class _Query:
    """One query in OMPL's terms; lives as long as its plan.

    After the budget is spent every state is "not free", so that OMPL's inner loops end.
    """

    def __init__(
        self,
        checker: Checker,
        start: Vec,
        goals: Vec,
        limits: tuple[Vec, Vec],
        settings: PlanSettings,
        clock: _Clock,
    ) -> None:
        ou.noOutputHandler()
        self._checker, self._settings, self._clock = checker, settings, clock
        self._start, self._goals = start, goals
        self._read = _reader(start)
        self._kept: list[tuple[float, Vec]] = []
        every = np.vstack([start, goals])[:, :CONTROLLED]
        low = np.maximum(limits[0][:CONTROLLED], every.min(axis=0) - DETOUR_RAD)
        high = np.minimum(limits[1][:CONTROLLED], every.max(axis=0) + DETOUR_RAD)
        space = ob.RealVectorStateSpace(CONTROLLED)
        bounds = ob.RealVectorBounds(CONTROLLED)
        for j in range(CONTROLLED):
            bounds.setLow(j, float(low[j]))
            bounds.setHigh(j, float(high[j]))
        space.setBounds(bounds)
        self._info = ob.SpaceInformation(space)
        _set_checks(self._info, checker, clock, self._read)
        self._problem = ob.ProblemDefinition(self._info)
        self._problem.addStartState(_state(space, start))
        states = ob.GoalStates(self._info)
        for goal in goals:
            states.addState(_state(space, goal))
        self._problem.setGoal(states)
        self._problem.setOptimizationObjective(ob.PathLengthOptimizationObjective(self._info))

    def solve(self) -> MotionPlan:
        """Run the planner, then shorten its path."""
        anytime = self._settings.planner != "rrt-connect"
        share = 1.0 - SHORTEN_SHARE if anytime else 1.0
        kinds = {"rrt-connect": og.RRTConnect, "rrt-star": og.RRTstar, "aorrtc": og.AORRTC}
        algorithm = kinds[self._settings.planner](self._info)
        algorithm.setRange(RANGE_RAD)
        algorithm.setProblemDefinition(self._problem)
        algorithm.setup()
        algorithm.solve(ob.PlannerTerminationCondition(lambda: self._watch(share)))
        found = self._problem.getSolutionPath()
        if found is None:
            return MotionPlan(outcome="out-of-time")
        if not self._problem.hasExactSolution():
            path = self._rows(found)
            if path_length(path) <= SAME or not self._checker.path_free(path):
                return MotionPlan(outcome="out-of-time")
            return MotionPlan(outcome="approximate", path=path)
        self._keep(found)
        if found.getStateCount() > 2 and not self._clock.over():
            over = ob.PlannerTerminationCondition(self._clock.over)
            og.PathSimplifier(self._info).simplify(found, over, False)
            self._keep(found)
        for _, path in sorted(self._kept, key=lambda kept: kept[0]):
            # Ours is the last word: AORRTC may also end with a path of length 0 at the start.
            if self._reaches(path) and self._checker.path_free(path):
                return MotionPlan(outcome="solved", path=path)
        return MotionPlan(outcome="out-of-time")

    def _watch(self, share: float) -> bool:
        """Return whether the planner's part of the budget is spent; keep the path found.

        AORRTC shortens its paths in place, and one that the end of the budget catches in the
        middle of that may be in contact: then an earlier one is taken.
        """
        if self._clock.over(share):
            return True
        if self._problem.hasExactSolution():
            found = self._problem.getSolutionPath()
            if not self._kept or abs(found.length() - self._kept[-1][0]) > SAME:
                self._keep(found)
        return False

    def _reaches(self, path: Vec) -> bool:
        """Return whether a path leads from the start to a goal."""
        ends = np.abs(path[-1] - self._goals).max(axis=1).min()
        return bool(np.abs(path[0] - self._start).max() <= SAME and ends <= SAME)

    def _keep(self, found: Any) -> None:
        path = self._rows(found)
        self._kept = [*self._kept[-MOST_KEPT:], (path_length(path), path)]

    def _rows(self, found: Any) -> Vec:
        rows = [self._read(found.getState(k)) for k in range(found.getStateCount())]
        return np.array(rows).reshape(-1, 6)


def _reader(start: Vec) -> Callable[[Any], Vec]:
    """Return the function that reads an OMPL state as joint positions [rad], shape (6,)."""
    rest = start[CONTROLLED:].tolist()
    return lambda state: np.array([*state[0:CONTROLLED], *rest])


def _state(space: Any, q: Vec) -> Any:
    state = space.allocState()
    for j in range(CONTROLLED):
        state[j] = float(q[j])
    return state


def _set_checks(info: Any, checker: Checker, clock: _Clock, read: Callable[[Any], Vec]) -> None:
    """Let OMPL ask the checker about states and motions."""

    class Motions(ob.MotionValidator):  # type: ignore[misc]
        def checkMotion(self, a: Any, b: Any) -> bool:
            return not clock.over() and checker.edge_free(read(a), read(b))

    info.setStateValidityChecker(lambda q: not clock.over() and checker.is_free(read(q)))
    info.setMotionValidator(Motions(info))


def _finite(name: str, values: Vec, ndim: int) -> Vec:
    out = np.array(values, dtype=np.float64)
    if out.ndim != ndim or out.shape[-1] != 6 or not np.isfinite(out).all():
        rule = "must be finite, of shape " + ("(6,)" if ndim == 1 else "(k, 6)")
        raise InvalidInput(name, out.tolist(), rule)
    return out


def _require(settings: PlanSettings, seed: int) -> None:
    if ob is None:
        raise MissingPackage("ompl", "planning", "pip install ompl (Linux, macOS 15 or later)")
    if settings.planner not in PLANNERS:
        raise InvalidInput("planner", settings.planner, "is not known", PLANNERS)
    if not 0.0 <= settings.budget_s <= LONGEST_S:
        rule = f"must lie in [0, {LONGEST_S:g}] s"
        raise InvalidInput("budget_s", settings.budget_s, rule)
    if settings.max_poses is not None and settings.max_poses < 1:
        raise InvalidInput("max_poses", settings.max_poses, "must be at least 1")
    if seed < 1:
        raise InvalidInput("seed", seed, "must be at least 1")
