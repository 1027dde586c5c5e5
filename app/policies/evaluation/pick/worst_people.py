"""Protocol ``pick-worst``: people that a search found to lower the success of a policy.

``tools/search_worst_people.py`` searches motions of one hand over the table, inside stated
limits, for those with the lowest rate of success; ``worst_people.json`` keeps what it found as
a regression test for later policies. A motion is a path of the palm over four points, played
forth and back.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.pick.episodes import PickBench
from app.policies.evaluation.pick.people import SAMPLE_S, beside_each, played
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.sim.cells.cell import Cell
from app.sim.human.model import Hand
from app.sim.mocap.importer import Motion
from app.sim.people.human_motion_config import HumanMotionConfig
from app.sim.people.reach_script import ReachScript, standing_reach
from app.sim.pick.batch import PickSettings

FILE = Path(__file__).with_suffix(".json")


@dataclass(frozen=True, slots=True, kw_only=True)
class HandMotion:
    """Motion of one hand over the table."""

    hand: Hand
    """The hand; the other one rests at the edge of the table."""
    palms: tuple[tuple[float, ...], ...]
    """Points of the palm [m], shape (3,) each."""
    speeds: tuple[float, ...]
    """Mean speed of each move [m/s]."""
    pauses: tuple[float, ...]
    """Rest before each move [s]."""


def motion_of(cell: Cell, motion: HandMotion, name: str) -> Motion:
    """Return a motion as joint positions of the cell's person."""
    palms = np.array(motion.palms)
    postures = [standing_reach(cell, palm, motion.hand) for palm in palms]
    duration = np.linalg.norm(np.diff(palms, axis=0), axis=1) / motion.speeds
    duration = np.maximum(duration, SAMPLE_S)
    start = np.cumsum(motion.pauses) + np.concatenate([[0.0], np.cumsum(duration)[:-1]])
    script = ReachScript(start, duration, np.array(postures))
    return played(script, script.end_s + SAMPLE_S, cell, name, "search")


def beside(settings: PickSettings, cell: Cell, motions: Sequence[HandMotion]) -> PickSettings:
    """Return settings beside people who follow motions, one drawn per episode."""
    runs = tuple(motion_of(cell, one, f"found-{k}") for k, one in enumerate(motions, start=1))
    return replace(settings, work=HumanMotionConfig(motion="recorded", recorded=runs))


def stored_motions() -> tuple[HandMotion, ...]:
    """Return the motions that were found, the worst first."""
    found = json.loads(FILE.read_text())["motions"]
    return TypeAdapter(tuple[HandMotion, ...]).validate_python(found)


def run_worst(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate beside the people who were found, together and one by one."""
    bench, found = PickBench(checkpoint, request), stored_motions()
    rows = {"library": bench.usual, "found": beside(bench.usual, bench.cell, found)}
    for number, one in enumerate(found, start=1):
        rows[f"found-{number}"] = beside(bench.usual, bench.cell, [one])
    return beside_each(bench, rows)
