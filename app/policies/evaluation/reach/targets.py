"""Protocol ``reach-targets``: every training target of the thesis, beside one pedestrian.

54 targets x 100 episodes in each row, with the same people and goals and different start rules:

=============  =============================================================================
``clearance``  at least 0.05 m from the robot, as in all other protocols
``uniform``    anywhere; no policy can solve an episode that begins in contact
``authors``    as in the authors' public code: anywhere, with a slightly different walk, and
               episodes continue after a contact
=============  =============================================================================

Rows ``-rollout`` use rollout policy improvement (``rollout.py``), where the policy allows it.

An episode with a contact is no success in any row; ``reached_after_contact`` is the share that
reached the goal afterwards.

Source: thesis 4.4.3, figs 4.5 and 4.6; docs/method.md 2.6. Deviates: the thesis does not state
the start rule of its people.
"""

from itertools import product

import numpy as np

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.reach.bench import ReachBench, Variant, suffix_of
from app.policies.evaluation.reach.episodes import ReachEpisodes
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.statistics import rate_of
from app.sim.core.arrays import Vec
from app.sim.reach.batch import StartRule
from app.sim.scenario.kernels.episode import COLLISION, SUCCESS

PER_TARGET = 100
"""Episodes of each target (docs/method.md 2.6)."""
STARTS: tuple[StartRule, ...] = ("clearance", "uniform", "authors")
END_STEP_S = 0.1
"""Width of the time intervals in which ends are counted [s]."""
N_WORST = 5
"""Number of targets listed as the worst."""


def by_target(episodes: ReachEpisodes, targets: Vec, base_height: float) -> list[Json]:
    """Return the rates of outcomes of each target.

    Args:
        episodes: Episodes with goals among the targets.
        targets: Targets in the robot's base frame [m], shape (n, 3).
        base_height: Height of the robot's base above the floor [m].
    """
    of_target = (episodes.goals[:, None] == targets).all(axis=2)
    return [
        {
            "goal": np.round(goal, 6).tolist(),
            "height_m": round(float(goal[2]) + base_height, 6),
            **episodes.rates(of_target[:, number]),
        }
        for number, goal in enumerate(targets)
    ]


def ends_over_time(episodes: ReachEpisodes) -> list[Json]:
    """Return the numbers of successes and collisions in each time interval."""
    edges = np.arange(0.0, episodes.limit_s + 0.5 * END_STEP_S, END_STEP_S)
    times = [episodes.duration_s[episodes.outcome == end] for end in (SUCCESS, COLLISION)]
    won, hit = (np.histogram(part - 1e-9, edges)[0].tolist() for part in times)
    return [
        {"until_s": round(float(until), 6), "success": one, "collision": other}
        for until, one, other in zip(edges[1:], won, hit, strict=True)
    ]


def run_targets(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate on all targets of the grid under three start rules."""
    bench = ReachBench(checkpoint, request.seed, request.on_row)
    per_target = request.episodes or PER_TARGET
    goals = bench.target_goals(per_target * len(bench.targets))

    def by_targets(variant: Variant, episodes: ReachEpisodes) -> Json:
        cells = by_target(episodes, bench.targets, bench.cell.table.height)
        row: Json = {
            "initial_contact": episodes.initial_contact(),
            "starts_redrawn": float(np.mean(episodes.redrawn > 0)),
            "worst": [
                {"goal": cell["goal"], "height_m": cell["height_m"], **cell["success"]}
                for cell in sorted(cells, key=lambda cell: cell["success"]["mean"])[:N_WORST]
            ],
            "ends": ends_over_time(episodes),
            "targets": cells,
        }
        if not variant.settings.collision_ends:
            early = episodes.duration_s < episodes.limit_s - 1e-6
            row["reached_after_contact"] = rate_of((episodes.outcome == COLLISION) & early)
        return row

    variants = [
        bench.variant(
            start + suffix_of(mode), goals, mode, start=start, collision_ends=start != "authors"
        )
        for mode, start in product(bench.direct_modes, STARTS)
    ]
    bench.measure(variants, by_targets)
    bench.recheck(variants[-len(STARTS)])
    return {"episodes": per_target, **bench.result(targets=len(bench.targets))}
