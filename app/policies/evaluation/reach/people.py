"""Protocols ``reach-people``, ``reach-constant`` and ``reach-speeds``: other people.

``reach-people``: zero to four pedestrians; the policy observes the nearest one, or is queried
for each of them with distance-weighted actions.
``reach-constant``: speed and radius constant in each episode, beside the usual pedestrian.
``reach-speeds``: a person of 0.25, 0.5 and 1.0 m/s; the limits of speed do not apply, because
0.25 m/s would count as standing still (docs/method.md 2.1).

Rows ``-rollout`` use rollout policy improvement (``rollout.py``) with all people. The episodes
cycle through the targets of the grid; all rows have the same goals.

Source: thesis 4.4.3; docs/method.md 2.6, and 4 for several people.
"""

from dataclasses import replace
from itertools import product

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.reach.bench import ReachBench, pedestrian_of, suffix_of
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.inference.controllers import InferenceMode, inference_modes_of
from app.sim.cells.cell import Cell
from app.sim.cells.people import FixedSpeedWalker
from app.sim.people.kernels.people import MAX_PEOPLE
from app.sim.scene.scene import HumanKind

DEFAULT_EPISODES = 1000
"""docs/method.md 2.6."""
TARGET_EPISODES = 5400
"""Episodes of each row of ``reach-constant``, as in ``reach-targets``."""
MODES = {
    InferenceMode.DIRECT: 0,
    InferenceMode.DISTANCE_WEIGHTED: 2,
    InferenceMode.DIRECT_ROLLOUT: 1,
}
"""Inference modes, and the number of people from which each differs from ``direct``."""
KINDS: tuple[HumanKind, ...] = ("walker", "constant")
"""Usual pedestrians, and pedestrians of one speed and radius per episode."""
SPEEDS = (0.25, 0.5, 1.0)
"""Speeds of people [m/s] (docs/method.md 2.6)."""


def run_people(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate beside zero to four pedestrians."""
    bench = ReachBench(checkpoint, request.seed, request.on_row)
    goals = bench.target_goals(request.episodes or DEFAULT_EPISODES)
    allowed = inference_modes_of(bench.actor)
    variants = [
        bench.variant(
            f"{n}-people" + (f"-{mode}" if n > 1 else suffix_of(mode)),
            goals,
            mode,
            people=KINDS[:1] * n,
        )
        for n in range(MAX_PEOPLE + 1)
        for mode, least in MODES.items()
        if n >= least and mode in allowed
    ]
    bench.measure(
        variants, lambda _, episodes: {"starts_redrawn": float((episodes.redrawn > 0).mean())}
    )
    bench.recheck(bench.variant("recheck", goals, people=KINDS[:1] * 2))
    return bench.result()


def run_constant(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate beside people whose speed and radius are constant in each episode."""
    bench = ReachBench(checkpoint, request.seed, request.on_row)
    goals = bench.target_goals(request.episodes or TARGET_EPISODES)
    bench.measure(
        [
            bench.variant(kind + suffix_of(mode), goals, mode, people=(kind,))
            for mode, kind in product(bench.direct_modes, KINDS)
        ]
    )
    return bench.result()


def run_speeds(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate beside people of a given speed."""
    bench = ReachBench(checkpoint, request.seed, request.on_row)
    goals = bench.target_goals(request.episodes or DEFAULT_EPISODES)
    bench.measure(
        [
            replace(
                bench.variant(
                    f"{speed:g}-m-s{suffix_of(mode)}", goals, mode, people=("fixed-speed",)
                ),
                cell=at_speed(bench.cell, speed),
                stated={"speed_m_s": speed},
            )
            for mode, speed in product(bench.direct_modes, SPEEDS)
        ]
    )
    return bench.result()


def at_speed(cell: Cell, speed: float) -> Cell:
    """Return a cell whose only pedestrian has a given speed [m/s], by the rules of its first.

    Raises:
        InvalidInput: The cell has no pedestrian.
    """
    kept = set(FixedSpeedWalker.model_fields) - {"kind", "speed"}
    rules = pedestrian_of(cell).model_dump(include=kept)
    person = FixedSpeedWalker(kind="fixed-speed", speed=speed, **rules)
    return cell.model_copy(update={"people": (person,)})
