"""Protocol ``sorting-cycle-time``: parts per hour of a cell with a working person.

The full tasks of ``sorting-people``: ten objects, each picked and set down in its place.

``policy``
    Motion and order of the pick policy (order rule ``critic``) under the safety layer.
``policy-nearest``
    Motion of the policy; the nearest object first.
``planner``
    Straight joint moves to the nearest object, planned without regard to the person, under the
    safety layer. The person is the only obstacle: blocks are none.
``policy-distance``, ``planner-distance``
    ``policy-nearest`` and ``planner`` with the protective distance of thesis 4.4.6, 0.3 m.
``alone``
    No person. ``policy-nearest`` and ``planner`` then move alike: the actor adds nothing to the
    straight joint move where nobody is near.

All rows have the same tasks and grasps, all rows with a person the same person. The throughput
counts every part that was set down and the whole time, also of tasks that were not finished.

Source: the outlook of thesis 4.5, robot execution time in shared workspaces. Ours.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.sorting.full_tasks import FullTasks
from app.policies.evaluation.sorting.order_rules import OrderRule, critic, nearest
from app.policies.evaluation.sorting.people import (
    DEFAULT_TASKS,
    USUAL,
    CellCondition,
    SortingBesidePeople,
    parts_of,
    stated,
)
from app.policies.evaluation.statistics import mean_of
from app.sim.pick.monitored_batch import AMONG_HANDS
from app.sim.safety.layer import SafetySettings

ALONE = "alone"
"""Row without a person."""
STRAIGHT = CellCondition(straight=True)
DISTANCE = SafetySettings()
"""Assumptions with the default protective distance."""


@dataclass(frozen=True, slots=True)
class CycleRow:
    """Conditions of a row."""

    condition: CellCondition
    """Safety layer and motion."""
    rule: OrderRule = nearest
    """Order rule."""
    alone: bool = False
    """Whether nobody else is in the cell."""


ROWS: Mapping[str, CycleRow] = MappingProxyType(
    {
        "policy": CycleRow(USUAL, critic),
        "policy-nearest": CycleRow(USUAL),
        "planner": CycleRow(STRAIGHT),
        "policy-distance": CycleRow(replace(USUAL, safety=DISTANCE)),
        "planner-distance": CycleRow(replace(STRAIGHT, safety=DISTANCE)),
        ALONE: CycleRow(STRAIGHT, alone=True),
    }
)
"""Conditions by row."""
PAIRS = (
    ("policy", "planner"),
    ("policy-nearest", "planner"),
    ("policy-distance", "planner-distance"),
    ("planner", ALONE),
)
"""Rows whose difference on the same tasks is given."""


def run_cycle_time(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate the throughput of a sorting cell."""
    networks, cell, settings = parts_of(checkpoint)
    n = request.episodes or DEFAULT_TASKS
    runs: dict[str, FullTasks] = {}
    rows = request.rows(len(ROWS))
    shown: Json = {}
    for name, row in ROWS.items():
        picks = replace(settings, people=()) if row.alone else settings
        bench = SortingBesidePeople(networks, cell, picks, n, request.seed, row.condition)
        shown = shown or stated(bench.batch)
        runs[name] = bench.run(row.rule)
        per_hour = {"parts_per_hour": mean_of(runs[name].throughput())}
        rows.append(runs[name].row(name) | per_hour)
    safety = AMONG_HANDS.describe() | {
        "protective_distance [m]": [one.protective_distance for one in (AMONG_HANDS, DISTANCE)]
    }
    return {
        "settings": {**shown, "safety": safety},
        "results": rows,
        "paired": [
            {
                "name": f"{first} - {other}",
                "n": n,
                "parts_per_hour": mean_of(runs[first].throughput() - runs[other].throughput()),
            }
            for first, other in PAIRS
        ],
    }
