"""Protocol ``pick-cases``: the four case studies from jittered starts (docs/method.md 3.6).

Each case runs from many starts: the robot's joints, the person's palm and the time at which the
person moves are jittered. A run is as expected where first choice, target switches and end are
those of the case (``sim/pick/case_verdict.py``); each of these clauses is counted by itself,
too. The same starts are run with the nearest candidate and with each goal alone.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.pick import selection_rules
from app.policies.evaluation.pick.episodes import (
    Episodes,
    Evaluator,
    PickBench,
    Rule,
    SelectionInput,
)
from app.policies.evaluation.pick.people import played
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import Flags, Index, rate_of
from app.policies.inference.task_selection import HYSTERESIS
from app.sim.cells.cell import Cell
from app.sim.mocap.importer import Motion
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.pick.batch import OUTCOMES, PickBatch
from app.sim.pick.case_verdict import CaseRun, End, clauses_of, is_as_expected
from app.sim.pick.cases import Case, cases_of, script_of

DEFAULT_EPISODES = 200
JITTER_Q = 0.05
"""Largest change of the robot's start per joint [rad]."""
JITTER_PALM = 0.015
"""Largest change of the palm per coordinate [m]."""
JITTER_DELAY = 0.2
"""Largest change of the time at which the person moves [s]."""
TRACK_S = 9.0
"""Length of the person's motion [s]; the person rests after its end."""
CURVE_DT = 0.1
"""Time between the values of the curves [s]."""
SETTINGS: Json = {
    "hysteresis": HYSTERESIS,
    "jitter": {"robot [rad]": JITTER_Q, "palm [m]": JITTER_PALM, "delay [s]": JITTER_DELAY},
}
"""Settings stated with results."""
ENDS: dict[str, End] = {
    "success": "reached",
    "collision": "contact",
    "timeout": "timeout",
    "unfeasible": "timeout",
}
"""End of a case by outcome; unfeasible ends count as time-outs."""


@dataclass(slots=True)
class _Recorder:
    """Selection rule that records the choices and values of another one."""

    rule: Rule
    dt: float
    runs: dict[int, list[tuple[float, int]]]
    """Time and candidate of each change of the choice, by episode."""
    values: list[tuple[Index, NDArray[np.float32]]]
    """Running episodes and values of their candidates, by step."""

    def __call__(self, view: SelectionInput) -> Index:
        choice = self.rule(view)
        t = self.dt * len(self.values)
        for row, place in zip(view.rows.tolist(), choice.tolist(), strict=True):
            run = self.runs.setdefault(row, [])
            if not run or run[-1][1] != place:
                run.append((t, place))
        self.values.append((view.rows, view.values))
        return choice


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseEpisodes:
    """Jittered runs of one case study."""

    case: Case
    """The case."""
    run: Episodes
    """The runs under the critic's choice."""
    clauses: Mapping[str, Flags]
    """Whether first choice, switches, end and all of these are as expected, shape (n,)."""
    nearest: Episodes
    """The same runs with the nearest candidate."""
    nearest_clauses: Mapping[str, Flags]
    """Whether these are as expected, shape (n,)."""
    alone: Mapping[str, Flags]
    """Whether the same runs succeed with each goal alone, by goal, shape (n,)."""


def run_cases(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate the four case studies from jittered starts."""
    bench = PickBench(checkpoint, request, default=DEFAULT_EPISODES)
    cases, curves = cases_of(bench.cell), {}
    rows = request.rows(len(cases))
    for case in cases:
        rng = np.random.default_rng([request.seed, len(case.id), ord(case.id[-1])])
        (found,), choices = run_together(bench, [(case, rng)])
        rows.append(_row(found))
        curves[case.id] = _curves(case, choices, bench.n)
    return {"settings": SETTINGS, "results": rows, "curves": curves}


def run_together(
    bench: PickBench, cases: Sequence[tuple[Case, np.random.Generator]]
) -> tuple[list[CaseEpisodes], _Recorder]:
    """Run cases together, each from the bench's number of starts, jittered by its generator.

    Returns:
        The runs of each case, and choices and values of the critic in all of them.
    """
    evaluator, start = _evaluator(bench, cases)
    dt = evaluator.batch.arm.dt
    critic = _Recorder(selection_rules.critic(HYSTERESIS), dt, {}, [])
    nearest = _Recorder(selection_rules.nearest, dt, {}, [])
    run, near, *alone = (
        evaluator.run(rule, start=start)
        for rule in (critic, nearest, selection_rules.fixed(0), selection_rules.fixed(1))
    )
    found = []
    for k, (case, _) in enumerate(cases):
        rows = range(bench.n * k, bench.n * (k + 1))
        pairs = zip(case.goals, alone, strict=True)
        found.append(
            CaseEpisodes(
                case=case,
                run=run.part(rows),
                clauses=_clauses(case, run, critic, rows),
                nearest=near.part(rows),
                nearest_clauses=_clauses(case, near, nearest, rows),
                alone={goal: one.succeeded[rows] for goal, one in pairs},
            )
        )
    return found, critic


def _evaluator(
    bench: PickBench, cases: Sequence[tuple[Case, np.random.Generator]]
) -> tuple[Evaluator, Callable[[PickBatch], None]]:
    """Return the episodes of cases, and what puts people, robots and candidates in place.

    Each person has one of the motions of its case.
    """
    motions: list[Motion] = []
    jitter, n, cell = [], bench.n, bench.cell
    for case, rng in cases:
        motions += [_motion(cell, case, rng, number) for number in range(n)]
        jitter.append(JITTER_Q * rng.uniform(-1.0, 1.0, (n, 6)) * (1, 1, 1, 1, 1, 0))
    work = HumanMotionConfig(motion="recorded", recorded=tuple(motions), loop=False)
    settings = replace(bench.usual, n_candidates=(2, 2), work=work, start="uniform")
    batch = PickBatch(cell, len(motions), bench.request.seed, settings)
    world = batch.world
    names = [station.id for station in cell.pick_stations]
    over = [world.station_q[names.index(case.robot_start)] for case, _ in cases]
    starts = np.concatenate([q + change for q, change in zip(over, jitter, strict=True)])
    goals = [[names.index(goal) for goal in case.goals] for case, _ in cases]
    first = np.repeat(np.arange(0, len(motions), n), n)

    def start(batch: PickBatch) -> None:
        people, tracks = batch.state.people, world.people.tracks
        people.track[:, 0] = people.body[:, 0] = first + people.track[:, 0] % n
        people.q[:, 0] = tracks.rows[tracks.spans[people.track[:, 0], 0], :18]
        batch.state.candidates[:, :2] = np.repeat(goals, n, axis=0)
        batch.set_starts(starts)

    return Evaluator(bench.networks, batch), start


def _motion(cell: Cell, case: Case, rng: np.random.Generator, number: int) -> Motion:
    """Return the person's jittered motion in a case."""
    x, y, z = case.palm_offset + JITTER_PALM * rng.uniform(-1.0, 1.0, 3)
    delay = max(0.0, case.delay_s + JITTER_DELAY * rng.uniform(-1.0, 1.0))
    script = script_of(cell, replace(case, palm_offset=(x, y, z), delay_s=delay))
    return played(script, TRACK_S, cell, f"{case.id}-{number}", "script")


def _clauses(
    case: Case, run: Episodes, recorder: _Recorder, rows: Sequence[int]
) -> dict[str, Flags]:
    """Return whether each clause of a case, and all of them, hold in runs, shape (n,) each."""
    found = []
    for e in rows:
        story = CaseRun()
        for t, place in recorder.runs[e]:
            story = story.choose(t, case.goals[place])
        story = story.finish(ENDS[OUTCOMES[run.outcome[e]]], float(run.duration_s[e]))
        verdict = {"as_expected": bool(is_as_expected(case, story))}
        found.append(clauses_of(case, story) | verdict)
    return {name: np.array([one[name] for one in found]) for name in found[0]}


def _row(found: CaseEpisodes) -> Json:
    """Return the row of a case: each clause and the verdict, with 95 % intervals."""
    case = found.case
    beside = {"nearest": found.nearest.succeeded}
    beside |= {f"{goal} alone": won for goal, won in found.alone.items()}
    expected = {"first": case.first, "switches": list(case.switches), "end": case.expected}
    return {
        **found.run.row(case.id),
        **{name: rate_of(held) for name, held in found.clauses.items()},
        "expected": expected,
        "beside": {name: rate_of(won) for name, won in beside.items()},
    }


def _curves(case: Case, recorder: _Recorder, n: int) -> Json:
    """Return median and quartiles of each goal's value over time, of the running episodes."""
    every = max(1, round(CURVE_DT / recorder.dt))
    goals: dict[str, list[list[float]]] = {goal: [] for goal in case.goals}
    times, running = [], []
    for k in range(0, len(recorder.values), every):
        rows, values = recorder.values[k]
        if len(rows) < n // 2:  # a median of the few that are late would mislead
            break
        times.append(round(recorder.dt * k, 3))
        running.append(len(rows) / n)
        for place, goal in enumerate(case.goals):
            quartiles = np.percentile(values[:, place], (25, 50, 75))
            goals[goal].append([round(float(one), 4) for one in quartiles])
    return {"t_s": times, "running": running, "values": goals}
