"""Protocol ``pick-cases``: the four case studies from jittered starts (docs/method.md 3.6).

Each case runs from many starts: the robot's joints, the person's palm and the time at which the
person moves are jittered. A run is as expected where first choice, target switches and end are
those of the case (``sim/pick/case_verdict.py``); each of these clauses is counted by itself,
too. The same starts are run with the nearest candidate and with each goal alone.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.pick import selection_rules
from app.policies.evaluation.pick.episodes import (
    Episodes,
    Evaluator,
    Rule,
    SelectionInput,
    settings_for,
)
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import wilson
from app.policies.inference.task_selection import HYSTERESIS
from app.policies.inference.value_networks import ValueNetworks, pick_preset_of
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.mocap.importer import Motion
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.pick.batch import OUTCOMES, Flags, PickBatch
from app.sim.pick.case_verdict import CaseRun, End, is_as_expected
from app.sim.pick.cases import Case, cases_of, script_of

DEFAULT_EPISODES = 200
JITTER_Q = 0.05
"""Largest change of the robot's start per joint [rad]."""
JITTER_PALM = 0.015
"""Largest change of the palm per coordinate [m]."""
JITTER_DELAY = 0.2
"""Largest change of the time at which the person moves [s]."""
TRACK_S, TRACK_DT = 9.0, 0.02
"""Length and sampling of the person's motion [s]; the person rests after its end."""
CURVE_DT = 0.1
"""Time between the values of the curves [s]."""
SETTINGS: Json = {
    "hysteresis": HYSTERESIS,
    "jitter": {"robot [rad]": JITTER_Q, "palm [m]": JITTER_PALM, "delay [s]": JITTER_DELAY},
}
"""Settings stated with results."""
ENDS: dict[str, End] = {"success": "reached", "collision": "contact", "timeout": "timeout"}


@dataclass(slots=True)
class _Recorder:
    """Selection rule that records the choices and values of another one."""

    rule: Rule
    dt: float
    runs: dict[int, list[tuple[float, int]]]
    """Time and candidate of each change of the choice, by episode."""
    values: list[tuple[NDArray[np.int64], NDArray[np.float32]]]
    """Running episodes and values of their candidates, by step."""

    def __call__(self, view: SelectionInput) -> NDArray[np.int64]:
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
    bench, n = CaseBench(checkpoint, request.seed), request.episodes or DEFAULT_EPISODES
    cases, curves = cases_of(bench.cell), {}
    rows = request.rows(len(cases))
    for case in cases:
        rng = np.random.default_rng([request.seed, len(case.id), ord(case.id[-1])])
        (found,), choices = bench.run([(case, rng)], n)
        rows.append(_row(found))
        curves[case.id] = _curves(case, choices, n)
    return {"settings": SETTINGS, "results": rows, "curves": curves}


class CaseBench:
    """Runs case studies from jittered starts with the policy of a checkpoint."""

    def __init__(self, checkpoint: Checkpoint, seed: int) -> None:
        self.cell = cell_of(checkpoint.manifest)
        self._networks, self._seed = ValueNetworks(checkpoint), seed
        self._preset = pick_preset_of(checkpoint)

    def run(
        self, cases: Sequence[tuple[Case, np.random.Generator]], n: int
    ) -> tuple[list[CaseEpisodes], _Recorder]:
        """Run cases together, from ``n`` starts each, whose jitter their generators draw.

        Returns:
            The runs of each case, and choices and values of the critic in all of them.
        """
        evaluator, start = self._evaluator(cases, n)
        dt = evaluator.batch.arm.dt
        critic = _Recorder(selection_rules.critic(HYSTERESIS), dt, {}, [])
        nearest = _Recorder(selection_rules.nearest, dt, {}, [])
        run, near, *alone = (
            evaluator.run(rule, start=start)
            for rule in (critic, nearest, selection_rules.fixed(0), selection_rules.fixed(1))
        )
        found = []
        for k, (case, _) in enumerate(cases):
            rows = range(n * k, n * (k + 1))
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
        self, cases: Sequence[tuple[Case, np.random.Generator]], n: int
    ) -> tuple[Evaluator, Callable[[PickBatch], None]]:
        """Return the episodes of cases, and what puts people, robots and candidates in place.

        Each person has one of the motions of its case.
        """
        motions: list[Motion] = []
        jitter = []
        for case, rng in cases:
            motions += [_motion(self.cell, case, rng, number) for number in range(n)]
            jitter.append(JITTER_Q * rng.uniform(-1.0, 1.0, (n, 6)) * (1, 1, 1, 1, 1, 0))
        work = HumanMotionConfig(motion="recorded", recorded=tuple(motions), loop=False)
        settings = replace(settings_for((2, 2), self._preset), work=work, start="uniform")
        evaluator = Evaluator(self._networks, self.cell, len(motions), self._seed, settings)
        world = evaluator.batch.world
        names = [station.id for station in self.cell.pick_stations]
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

        return evaluator, start


def _motion(cell: Cell, case: Case, rng: np.random.Generator, number: int) -> Motion:
    """Return the person's jittered motion in a case."""
    x, y, z = case.palm_offset + JITTER_PALM * rng.uniform(-1.0, 1.0, 3)
    delay = max(0.0, case.delay_s + JITTER_DELAY * rng.uniform(-1.0, 1.0))
    script = script_of(cell, replace(case, palm_offset=(x, y, z), delay_s=delay))
    times = np.arange(0.0, TRACK_S, TRACK_DT)
    q: Vec = np.array([script.at(float(t))[0] for t in times])
    return Motion(
        name=f"{case.id}-{number}",
        source="script",
        times=times,
        q=q,
        pelvis_z=np.zeros(len(times)),
        size=cell.human.size,
        first_frame=0,
    )


def _clauses(
    case: Case, run: Episodes, recorder: _Recorder, rows: Sequence[int]
) -> dict[str, Flags]:
    """Return whether each clause of a case, and all of them, hold in runs, shape (n,) each."""
    names = ("first", "switches", "end", "as_expected")
    found = {name: np.zeros(len(rows), dtype=np.bool_) for name in names}
    least, most = case.switches
    for k, e in enumerate(rows):
        choices = [(t, case.goals[place]) for t, place in recorder.runs[e]]
        story = CaseRun()
        for t, goal in choices:
            story = story.choose(t, goal)
        story = story.finish(ENDS[OUTCOMES[run.outcome[e]]], float(run.duration_s[e]))
        switches = len(choices) - 1
        found["first"][k] = case.first in (None, choices[0][1])
        found["switches"][k] = least <= switches and (most is None or switches <= most)
        found["end"][k] = choices[-1][1] == case.expected
        found["as_expected"][k] = bool(is_as_expected(case, story))
    return found


def _row(found: CaseEpisodes) -> dict[str, Any]:
    """Return the row of a case: each clause and the verdict, with 95 % intervals."""
    case, n = found.case, len(found.run.outcome)
    rates = {name: wilson(int(held.sum()), n) for name, held in found.clauses.items()}
    beside = {"nearest": found.nearest.succeeded}
    beside |= {f"{goal} alone": won for goal, won in found.alone.items()}
    expected = {"first": case.first, "switches": list(case.switches), "end": case.expected}
    return {
        **found.run.row(case.id),
        **rates,
        "expected": expected,
        "beside": {name: wilson(int(won.sum()), n) for name, won in beside.items()},
    }


def _curves(case: Case, recorder: _Recorder, n: int) -> dict[str, Any]:
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
