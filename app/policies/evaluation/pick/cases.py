"""Protocol ``pick-cases``: the four case studies from jittered starts (docs/method.md 3.6).

Each case runs from many starts: the robot's joints, the person's palm and the time at which the
person moves are jittered. A run is as expected where first choice, target switches and end are
those of the case (``sim/pick/case_verdict.py``); each of these clauses is counted by itself,
too. Beside the critic's choice stand the nearest candidate, and each goal alone.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.pick import selection_rules as choice_rules
from app.policies.evaluation.pick.episodes import Episodes, Evaluator, Rule, View, settings_for
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import wilson
from app.policies.inference.task_selection import HYSTERESIS
from app.policies.inference.value_networks import ValueNetworks, pick_preset_of
from app.sim.cells.cell import Cell
from app.sim.core.arrays import Vec
from app.sim.mocap.importer import Motion
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.people.reach_script import reach_script
from app.sim.pick.batch import OUTCOMES, PickBatch
from app.sim.pick.case_verdict import CaseRun, End, is_as_expected
from app.sim.pick.cases import Case, cases_of

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

    def __call__(self, view: View) -> NDArray[np.int64]:
        choice = self.rule(view)
        t = self.dt * len(self.values)
        for row, place in zip(view.rows.tolist(), choice.tolist(), strict=True):
            run = self.runs.setdefault(row, [])
            if not run or run[-1][1] != place:
                run.append((t, place))
        self.values.append((view.rows, view.values))
        return choice


def run_cases(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate the four case studies from jittered starts."""
    cell, networks = cell_of(checkpoint.manifest), ValueNetworks(checkpoint)
    n, cases, curves = request.episodes or DEFAULT_EPISODES, cases_of(cell), {}
    rows = request.rows(len(cases))
    for case in cases:
        evaluator, start = _evaluator(checkpoint, cell, networks, case, n, request.seed)
        recorder = _Recorder(choice_rules.critic(HYSTERESIS), evaluator.batch.arm.dt, {}, [])
        run = evaluator.run(recorder, start=start)
        row = _row(case, run, recorder)
        others: dict[str, Rule] = {"nearest": choice_rules.nearest}
        others |= {f"{goal} alone": choice_rules.fixed(k) for k, goal in enumerate(case.goals)}
        row["beside"] = {
            name: wilson(int(evaluator.run(rule, start=start).won.sum()), n)
            for name, rule in others.items()
        }
        rows.append(row)
        curves[case.id] = _curves(case, recorder, n)
    return {
        "settings": {
            "hysteresis": HYSTERESIS,
            "jitter": {
                "robot [rad]": JITTER_Q,
                "palm [m]": JITTER_PALM,
                "delay [s]": JITTER_DELAY,
            },
        },
        "results": rows,
        "curves": curves,
    }


def _evaluator(
    checkpoint: Checkpoint, cell: Cell, networks: ValueNetworks, case: Case, n: int, seed: int
) -> tuple[Evaluator, Callable[[PickBatch], None]]:
    """Return the episodes of a case, and what puts their robots and candidates in place."""
    rng = np.random.default_rng([seed, len(case.id), ord(case.id[-1])])
    settings = settings_for((2, 2), pick_preset_of(checkpoint))
    motions = tuple(_motion(cell, case, rng, number) for number in range(n))
    work = HumanMotionConfig(motion="recorded", recorded=motions, loop=False)
    settings = replace(settings, work=work, start="uniform")
    evaluator = Evaluator(networks, cell, n, seed, settings)
    world = evaluator.batch.world
    names = [station.id for station in cell.pick_stations]
    q = world.station_q[names.index(case.robot_start)]
    starts = q + JITTER_Q * rng.uniform(-1.0, 1.0, (n, 6)) * (1, 1, 1, 1, 1, 0)
    goals = [names.index(goal) for goal in case.goals]

    def start(batch: PickBatch) -> None:
        batch.state.candidates[:, :2] = goals
        batch.set_starts(starts)

    return evaluator, start


def _motion(cell: Cell, case: Case, rng: np.random.Generator, number: int) -> Motion:
    """Return the person's jittered motion in a case."""
    ends = [case.human_from, case.human_to or case.human_from]
    offset = case.palm_offset + JITTER_PALM * rng.uniform(-1.0, 1.0, 3)
    palms = [np.add(cell.station(place).position, offset) for place in ends]
    delay = max(0.0, case.delay_s + JITTER_DELAY * rng.uniform(-1.0, 1.0))
    script = reach_script(cell, case.hand, (palms[0], palms[1]), case.pelvis_x, delay)
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


def _row(case: Case, run: Episodes, recorder: _Recorder) -> dict[str, Any]:
    """Return the row of a case: each clause and the verdict, with 95 % intervals."""
    n = len(run.outcome)
    counts = dict.fromkeys(("first", "switches", "end", "as_expected"), 0)
    least, most = case.switches
    for e in range(n):
        choices = [(t, case.goals[place]) for t, place in recorder.runs[e]]
        story = CaseRun()
        for t, goal in choices:
            story = story.choose(t, goal)
        story = story.finish(ENDS[OUTCOMES[run.outcome[e]]], float(run.duration_s[e]))
        switches = len(choices) - 1
        counts["first"] += case.first in (None, choices[0][1])
        counts["switches"] += least <= switches and (most is None or switches <= most)
        counts["end"] += choices[-1][1] == case.expected
        counts["as_expected"] += bool(is_as_expected(case, story))
    expected = {"first": case.first, "switches": list(case.switches), "end": case.expected}
    return {
        **run.row(case.id),
        **{name: wilson(count, n) for name, count in counts.items()},
        "expected": expected,
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
