"""Protocols ``pick-people``, ``pick-mocap``, ``pick-yielding``, ``pick-rest``: other people.

``pick-rest`` has one random target. The others select among 2 or 3 random targets by the critic
with hysteresis, as ``pick-choice`` does. They differ in the people. A policy for one person
observes the nearest. Several workers share the table and do not avoid each other, so that they
may overlap.

``pick-people``: no person; one to four people of the library's sizes; one and three people of
the 5th and of the 95th percentile; a worker and a pedestrian; synthetic reaches.
``pick-mocap``: recorded motion placed at the table, each recording alone and all together.
``pick-yielding``: people that yield to the arm, from strength 0 (the thesis' people) to 1.
``pick-rest``: people who stand still, with the policy alone and with a planner.

Except in ``pick-rest``, each row also states how often the same people touch a robot that never
moves, and for which share of the time recorded people stand still.

Source: docs/method.md 3.4 and 4 (several people; a model whose dimensions are known; a human
that reacts).
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.pick import selection_rules
from app.policies.evaluation.pick.episodes import (
    Episodes,
    Evaluator,
    PickBench,
    Rule,
    SelectionInput,
)
from app.policies.evaluation.pick.tasks import settings_of
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import Index, paired, rate_of, wilson
from app.policies.inference.task_selection import HYSTERESIS
from app.sim.cells.cell import Cell
from app.sim.collision.contact import clearance
from app.sim.core.arrays import Vec
from app.sim.human.anthropometry import percentile_body
from app.sim.mocap.importer import Motion
from app.sim.people.human_motion_config import HumanMotionConfig, at_the_table
from app.sim.people.reach_script import ReachScript
from app.sim.pick.batch import DEFAULT_ACTION, PickBatch, PickSettings
from app.sim.robot.kernels.arm import CONTROLLED
from app.sim.scenario.kernels.episode import COLLISION, RUNNING, TIMEOUT
from app.sim.scene.scene import HumanKind

YIELDING_LEVELS = (0.0, 0.5, 1.0)
"""Strengths of yielding."""
MAX_RECORDED_S = 36_000
"""Maximum duration of recorded motion in one evaluation [s]; its tracks take 274 MB."""
DRAWN_S = 0.1
"""Duration of recorded motion for which a run is listed once more [s]."""
SAMPLE_S = 0.02
"""Sampling step of motion made from scripts [s]."""
SEEN_S = 0.1
"""Time between two postures of people that blocked targets are judged by [s]."""
GRASP_S = 1.6
"""Time in which the shortest of 475 grasps descended, closed and lifted [s]; the median took
1.7 s."""
STILL_PACE = 1e-6
"""Pace of people who stand still."""
ALONE_M = 0.5
"""Clearance beyond which nobody is near the robot [m]."""
SMALL, LARGE = 5.0, 95.0
"""Percentiles of stature; arms and shoulders scale with it."""


def beside_each(
    bench: PickBench, rows: Mapping[str, PickSettings], planners: Sequence[bool] = (False,)
) -> Json:
    """Return the result with one row per settings, under the critic's choice.

    Args:
        planners: Whether a planner acts beside people at rest, for the rows of one setting.
    """
    stated, rule = Json(hysteresis=HYSTERESIS), selection_rules.critic(HYSTERESIS)
    results, differences = bench.request.rows(len(rows) * len(planners)), list[Json]()
    for name, settings in rows.items():
        evaluator = bench.evaluator(settings)
        people = _beside_a_resting_robot(evaluator.batch)
        for _, row in _runs(evaluator, rule, name, planners, differences):
            results.append(row | people)
        stated[name] = settings_of(evaluator.batch)
    return {"settings": stated, "results": results} | _paired(differences)


def _runs(
    evaluator: Evaluator,
    rule: Rule,
    name: str,
    planners: Sequence[bool],
    differences: list[Json],
) -> Iterator[tuple[Episodes, Json]]:
    """Yield the same episodes without and with a planner beside people at rest, and rows.

    Args:
        name: Name of the row without the planner.
        planners: Whether the planner acts, for each row.
        differences: Gets the success with the planner against that without.
    """
    alone: Episodes | None = None
    for planned in planners:
        run = evaluator.run(rule, planned=planned)
        if alone is not None:
            differences.append(
                paired(f"{name}, planner - {name}", run.succeeded, alone.succeeded)
            )
        alone = run
        yield run, run.row(f"{name}, planner" if planned else name)


def _paired(differences: list[Json]) -> Json:
    return {"paired": differences} if differences else {}


def _planners(settings: PickSettings) -> tuple[bool, ...]:
    """Return whether a planner acts, for each row of one kind of people.

    Policies that do not pick objects up, or whose actions are no speeds, have no planner.
    """
    whole = settings.grasp.depth > 0.0 and settings.action == DEFAULT_ACTION
    return (False, True) if whole else (False,)


def _beside_a_resting_robot(batch: PickBatch) -> Json:
    """Return what people do beside a robot that stays at its start.

    ``touched_at_rest`` is the rate of episodes in which they touch it. For recorded people
    ``frozen_share`` is the share of the control periods in which none of them moves.
    """
    batch.reset()
    rest = np.zeros((batch.n_envs, CONTROLLED), dtype=np.float32)
    workers, outcome = batch.state.people.q, batch.state.outcome
    periods = frozen = 0
    while (running := outcome == RUNNING).any():
        before = workers.copy()
        batch.step(rest, auto_reset=False, features=False)
        periods += int(running.sum())
        frozen += int((running & (workers == before).all(axis=(1, 2))).sum())
    result: Json = {"touched_at_rest": rate_of(outcome == COLLISION)}
    if batch.settings.work.motion == "recorded":
        result["frozen_share"] = frozen / periods
    return result


def run_people(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate beside 0 to 4 people and people of several sizes."""
    bench = PickBench(checkpoint, request)
    usual, pelvis = bench.usual, bench.cell.human.pelvis_height
    small, large = (
        replace(usual.work, bodies=(percentile_body(share, pelvis=pelvis),))
        for share in (SMALL, LARGE)
    )

    def beside(*people: HumanKind, work: HumanMotionConfig = usual.work) -> PickSettings:
        return replace(usual, people=people, work=work)

    worker: HumanKind = "worker"
    rows = {
        **{f"{n}-people": beside(*(worker,) * n) for n in range(5)},
        "1-person-p5": beside(worker, work=small),
        "1-person-p95": beside(worker, work=large),
        "3-people-p5": beside(*(worker,) * 3, work=small),
        "3-people-p95": beside(*(worker,) * 3, work=large),
        "worker-and-walker": beside(worker, "walker"),
        "first-reaches": replace(usual, work=replace(usual.work, motion="reaches")),
    }
    return beside_each(bench, rows)


def run_rest(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate one random target beside people who stand still in any posture.

    Each kind of people once with the policy alone, and once with a planner beside people at
    rest (``pick/resting_people.py``); the last two rows beside people who work.

    A timeout is *blocked* where no time for a grasp was left: after the time that the joints
    need to the object at full speed, people never left it free for GRASP_S. It is *alone* where
    nobody is within ALONE_M of the robot at the end.
    """
    bench = PickBench(checkpoint, request, (1, 1))
    usual, planners = bench.usual, _planners(bench.usual)
    still = replace(usual.work, pace=STILL_PACE)
    rows = {
        "library": still,
        "off-task": replace(still, off_task=1.0),
        "reaches": replace(still, motion="reaches"),
        "stops": replace(usual.work, at_rest=1.0, off_task=0.5),
        "works": usual.work,
    }
    stated, differences = Json(), list[Json]()
    results = request.rows(len(rows) * len(planners))
    for name, work in rows.items():
        evaluator = bench.evaluator(replace(usual, work=work))
        rule = OneTarget(evaluator.batch)
        for run, row in _runs(evaluator, rule, name, planners, differences):
            results.append(row | _timeouts(evaluator.batch, run, rule))
        stated[name] = settings_of(evaluator.batch)
    return {"settings": stated, "results": results} | _paired(differences)


class OneTarget:
    """Selection rule of the first target that records robots at the start, and people."""

    def __init__(self, batch: PickBatch) -> None:
        self._batch, self._periods = batch, 0
        self.start = batch.state.q.copy()
        """Joint positions of the robots at the start [rad], shape (n, 6)."""
        self.people: list[Vec] = []
        """Joints of the people every SEEN_S [m, rad], shape (n, P, 18) each."""

    def __call__(self, view: SelectionInput) -> Index:
        """Return 0 for all, and record the people."""
        state, every = self._batch.state, round(SEEN_S / self._batch.arm.dt)
        if view.first:
            self.start, self._periods = state.q.copy(), 0
            self.people.clear()
        if self._periods % every == 0:
            self.people.append(state.people.q.copy())
        self._periods += 1
        return np.zeros(len(view.rows), dtype=np.int64)


def _timeouts(batch: PickBatch, run: Episodes, seen: OneTarget) -> dict[str, dict[str, float]]:
    """Return the rates of timeouts with a blocked target and with nobody near."""
    n, late = batch.n_envs, np.flatnonzero(run.outcome == TIMEOUT)
    blocked = sum(not could_be_picked(batch, seen, int(e)) for e in late)
    alone = int((batch.state.clear[late, 0] > ALONE_M).sum())
    return {"timeout_blocked": wilson(blocked, n), "timeout_alone": wilson(alone, n)}


def could_be_picked(batch: PickBatch, seen: OneTarget, e: int) -> bool:
    """Return whether a grasp fits into the time after the fastest motion to the object.

    Args:
        batch: Environments after the run.
        seen: Rule of the run, with what it recorded.
        e: Index of the environment.
    """
    arm, state, grasp = batch.arm, batch.state, batch.settings.grasp
    shared, cylinders, size = (
        batch.world.people,
        state.people.cylinders[e],
        state.people.size[e],
    )
    travel_s = float((np.abs(state.q_goal[e] - seen.start[e]) / arm.limits.qd_max).max())
    n_free = 0
    for people in seen.people[math.ceil(travel_s / SEEN_S) :]:
        free = min(
            clearance(arm, shared, q, people[e], cylinders, size).people_m
            for q in (state.q_goal[e], state.q_grasp[e])
        )
        started = n_free > 0 and free >= grasp.abort_clearance
        n_free = n_free + 1 if started or free >= grasp.start_clearance else 0
        if n_free * SEEN_S >= GRASP_S:
            return True
    return False


def run_yielding(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate beside people that yield to the arm with strength 0, 0.5 and 1.

    Each with the policy alone, and with a planner beside people at rest.
    """
    bench = PickBench(checkpoint, request)
    usual = bench.usual
    rows = {
        f"yielding-{strength:g}": replace(usual, work=replace(usual.work, yielding=strength))
        for strength in YIELDING_LEVELS
    }
    return beside_each(bench, rows, _planners(usual))


def beside_recordings(
    settings: PickSettings, motions: Sequence[Motion], cell: Cell
) -> PickSettings:
    """Return settings with recorded people, placed at the table of a cell.

    An episode draws a run in proportion to its duration: gaps of a recording split it into
    short runs, which must not count as much as long ones.

    Raises:
        InvalidInput: There is more than ``MAX_RECORDED_S`` of motion.
    """
    seconds = sum(float(motion.times[-1]) for motion in motions)
    if seconds > MAX_RECORDED_S:
        rule = f"s of recorded motion are too much: at most {MAX_RECORDED_S} s per evaluation"
        raise InvalidInput("motions", round(seconds), rule)
    placed: list[Motion] = []
    for motion in motions:
        placed += [at_the_table(motion, cell)] * max(1, round(motion.times[-1] / DRAWN_S))
    work = replace(settings.work, motion="recorded", recorded=tuple(placed))
    return replace(settings, work=work)


def played(script: ReachScript, end_s: float, cell: Cell, name: str, source: str) -> Motion:
    """Return a script as a motion of the cell's person, from 0 to ``end_s`` [s]."""
    times = np.arange(0.0, end_s, SAMPLE_S)
    return Motion(
        name=name,
        source=source,
        times=times,
        q=np.array([script.at(float(t))[0] for t in times]),
        pelvis_z=np.zeros(len(times)),
        size=cell.human.size,
        first_frame=0,
    )


def run_mocap(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate beside recorded people, with the library's people as the first row.

    Raises:
        InvalidInput: There is more than ``MAX_RECORDED_S`` of recorded motion.
    """
    bench = PickBench(checkpoint, request)
    usual, cell = bench.usual, bench.cell
    files = sorted({motion.name for motion in request.motions})
    rows = {"library": usual, "recorded": beside_recordings(usual, request.motions, cell)}
    if len(files) > 1:
        rows |= {
            f"recorded {name}": beside_recordings(
                usual, [one for one in request.motions if one.name == name], cell
            )
            for name in files
        }
    result = beside_each(bench, rows)
    result["settings"]["motions"] = [
        {"source": motion.source, "seconds": round(float(motion.times[-1]), 2)}
        for motion in request.motions
    ]
    return result
