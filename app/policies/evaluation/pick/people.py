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
moves.

Source: docs/method.md 3.4 and 4 (several people; a model whose dimensions are known; a human
that reacts).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.pick import selection_rules
from app.policies.evaluation.pick.episodes import (
    CANDIDATES,
    Episodes,
    Evaluator,
    settings_for,
)
from app.policies.evaluation.pick.tasks import settings_of
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import wilson
from app.policies.inference.task_selection import HYSTERESIS
from app.policies.inference.value_networks import ValueNetworks, pick_preset_of
from app.sim.cells.cell import Cell
from app.sim.collision.contact import clearance
from app.sim.human.anthropometry import percentile_body
from app.sim.mocap.importer import Motion
from app.sim.people.human_motion_config import HumanMotionConfig, at_the_table
from app.sim.pick.batch import DEFAULT_ACTION, PickBatch, PickSettings
from app.sim.robot.kernels.arm import CONTROLLED
from app.sim.scenario.kernels.episode import COLLISION, RUNNING, TIMEOUT
from app.sim.scene.scene import HumanKind

DEFAULT_EPISODES = 1000
YIELDING_LEVELS = (0.0, 0.5, 1.0)
"""Strengths of yielding."""
MAX_RECORDED_S = 36_000
"""Maximum duration of recorded motion in one evaluation [s]; its tracks take 274 MB."""
DRAWN_S = 0.1
"""Duration of recorded motion for which a run is listed once more [s]."""
STILL_PACE = 1e-6
"""Pace of people who stand still."""
ALONE_M = 0.5
"""Clearance beyond which nobody is near the robot [m]."""
SMALL, LARGE = 5.0, 95.0
"""Percentiles of stature; arms and shoulders scale with it."""


class ChoiceBench:
    """Evaluate one checkpoint under several settings on episodes of one seed."""

    def __init__(self, checkpoint: Checkpoint, request: EvaluationRequest) -> None:
        self._networks = ValueNetworks(checkpoint)
        self.cell = cell_of(checkpoint.manifest)
        self.usual = settings_for(CANDIDATES, pick_preset_of(checkpoint))
        self._request, self._n = request, request.episodes or DEFAULT_EPISODES

    def all(
        self, rows: Mapping[str, PickSettings], planners: Sequence[bool] = (False,)
    ) -> dict[str, Any]:
        """Return the result with one row per settings.

        Args:
            planners: Whether a planner acts beside people at rest, for the rows of one setting.
        """
        stated: Json = {"hysteresis": HYSTERESIS}
        results, seed = self._request.rows(len(rows) * len(planners)), self._request.seed
        for name, settings in rows.items():
            evaluator = Evaluator(self._networks, self.cell, self._n, seed, settings)
            touched = _touched_at_rest(evaluator.batch)
            for planned in planners:
                run = evaluator.run(selection_rules.critic(HYSTERESIS), planned=planned)
                row = run.row(_with_planner(name) if planned else name)
                results.append(row | {"touched_at_rest": touched})
            stated[name] = settings_of(evaluator)
        return {"settings": stated, "results": results}


def _planners(settings: PickSettings) -> tuple[bool, ...]:
    """Return whether a planner acts, for each row of one kind of people.

    Policies that do not pick objects up, or whose actions are no speeds, have no planner.
    """
    whole = settings.grasp.depth > 0.0 and settings.action == DEFAULT_ACTION
    return (False, True) if whole else (False,)


def _with_planner(name: str) -> str:
    """Return the name of a row in which a planner acts beside people at rest."""
    return f"{name}, planner"


def _touched_at_rest(batch: PickBatch) -> dict[str, float]:
    """Return the rate of episodes in which people touch a robot that stays at its start."""
    batch.reset()
    rest = np.zeros((batch.n_envs, CONTROLLED), dtype=np.float32)
    while (batch.state.outcome == RUNNING).any():
        batch.step(rest, auto_reset=False, features=False)
    return wilson(int((batch.state.outcome == COLLISION).sum()), batch.n_envs)


def _sized(work: HumanMotionConfig, percentile: float, pelvis: float) -> HumanMotionConfig:
    return replace(work, bodies=(percentile_body(percentile, pelvis=pelvis),))


def run_people(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate beside 0 to 4 people and people of several sizes."""
    bench = ChoiceBench(checkpoint, request)
    usual, pelvis = bench.usual, bench.cell.human.pelvis_height
    small, large = (_sized(usual.work, share, pelvis) for share in (SMALL, LARGE))

    def beside(*people: HumanKind, work: HumanMotionConfig = usual.work) -> PickSettings:
        return replace(usual, people=people, work=work)

    worker: HumanKind = "worker"
    rows = {f"{n}-people": beside(*(worker,) * n) for n in range(5)}
    rows |= {"1-person-p5": beside(worker, work=small)}
    rows |= {"1-person-p95": beside(worker, work=large)}
    rows |= {"3-people-p5": beside(*(worker,) * 3, work=small)}
    rows |= {"3-people-p95": beside(*(worker,) * 3, work=large)}
    rows |= {"worker-and-walker": beside(worker, "walker")}
    rows |= {"first-reaches": replace(usual, work=replace(usual.work, motion="reaches"))}
    return bench.all(rows)


def run_rest(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate one random target beside people who stand still in any posture.

    Each kind of people once with the policy alone, and once with a planner beside people at
    rest (``pick/resting_people.py``); the last two rows beside people who work.

    A timeout is *blocked* where the configuration at the object, or over it, is closer to the
    person than a grasp permits, and *alone* where nobody is within ALONE_M of the robot.
    """
    usual = settings_for((1, 1), pick_preset_of(checkpoint))
    networks, cell = ValueNetworks(checkpoint), cell_of(checkpoint.manifest)
    still = replace(usual.work, pace=STILL_PACE)
    rows = {
        "library": still,
        "off-task": replace(still, off_task=1.0),
        "reaches": replace(still, motion="reaches"),
        "stops": replace(usual.work, at_rest=1.0, off_task=0.5),
        "works": usual.work,
    }
    planners, n = _planners(usual), request.episodes or DEFAULT_EPISODES
    results = request.rows(len(rows) * len(planners))
    for name, work in rows.items():
        settings = replace(usual, work=work)
        evaluator = Evaluator(networks, cell, n, request.seed, settings)
        for planned in planners:
            run = evaluator.run(selection_rules.fixed(0), planned=planned)
            row = run.row(_with_planner(name) if planned else name)
            results.append(row | _timeouts(evaluator.batch, run))
    return {"settings": settings_of(evaluator), "results": results}


def _timeouts(batch: PickBatch, run: Episodes) -> dict[str, dict[str, float]]:
    """Return the rates of timeouts with a blocked target and with nobody near."""
    n, state = batch.n_envs, batch.state
    late = np.flatnonzero(run.outcome == TIMEOUT)
    arm, shared, people = batch.arm, batch.world.people, state.people
    blocked = sum(
        min(
            clearance(arm, shared, q, people.q[e], people.cylinders[e], people.size[e]).people_m
            for q in (state.q_goal[e], state.q_grasp[e])
        )
        < batch.settings.grasp.start_clearance
        for e in late
    )
    alone = int((state.clear[late, 0] > ALONE_M).sum())
    return {"timeout_blocked": wilson(blocked, n), "timeout_alone": wilson(alone, n)}


def run_yielding(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate beside people that yield to the arm with strength 0, 0.5 and 1.

    Each with the policy alone, and with a planner beside people at rest.
    """
    bench = ChoiceBench(checkpoint, request)
    usual = bench.usual

    def beside(strength: float) -> PickSettings:
        return replace(usual, work=replace(usual.work, yielding=strength))

    return bench.all(
        {f"yielding-{strength:g}": beside(strength) for strength in YIELDING_LEVELS},
        planners=_planners(usual),
    )


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


def run_mocap(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate beside recorded people, with the library's people as the first row.

    Raises:
        InvalidInput: There is no recorded motion, or more than ``MAX_RECORDED_S``.
    """
    if not request.motions:
        raise InvalidInput("motions", 0, "must hold at least one recording")
    bench = ChoiceBench(checkpoint, request)
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
    result = bench.all(rows)
    result["settings"]["motions"] = [
        {"source": motion.source, "seconds": round(float(motion.times[-1]), 2)}
        for motion in request.motions
    ]
    return result
