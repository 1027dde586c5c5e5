"""Protocol ``reach-random``: random goals in the box, between the training targets.

All checkpoints and inference modes have the same 5000 goals and people. Each policy can be
queried for the goal itself (``direct``); a policy trained on a set of targets also for the
targets around the goal, with interpolated actions.

========================  ==================================================================
``targets``               goals of the grid, queried directly, beside the same people, 5 s
``MODE``, ``MODE-25s``    random goals in each inference mode of the policy, 5 s and 25 s
``...-rollout``           the same with rollout policy improvement (``rollout.py``)
========================  ==================================================================

``between`` groups the episodes of 5 s by the distance of their goals to the nearest target.
``against_targets`` is the paired difference of success rates with its 95 % interval. The
remaining time that the policy observes is at most 5 s, as in training.

Source: thesis 4.4.3; docs/method.md 2.4 and 2.6.
"""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.reach.bench import ReachBench, Variant, suffix_of
from app.policies.evaluation.reach.episodes import ReachEpisodes, against, random_goals
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.sim.core.arrays import Vec

DEFAULT_EPISODES = 5000
"""docs/method.md 2.6."""
LIMITS_S = (5.0, 25.0)
"""Time limits [s]."""
RINGS = (0.0, 0.06, 0.09, 0.11, 0.13, 0.18)
"""Bounds of the groups by distance to the nearest target [m]."""


def between(episodes: ReachEpisodes, targets: Vec) -> list[Json]:
    """Return the rates of outcomes by the distance of goals to the nearest target.

    Args:
        targets: Targets [m], shape (k, 3).
    """
    distances = np.linalg.norm(episodes.goals[:, None] - targets, axis=2).min(axis=1)
    return [
        {"low_m": low, "high_m": high, **episodes.rates(which)}
        for low, high in pairwise(RINGS)
        if (which := (low <= distances) & (distances < high)).any()
    ]


def run_random(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate on random goals in the box."""
    bench = ReachBench(checkpoint, request.seed, request.on_row)
    n = request.episodes or DEFAULT_EPISODES
    usual, grid, goals = (
        bench.usual,
        bench.target_goals(n),
        random_goals(bench.cell, n, request.seed),
    )
    at_targets: dict[str, ReachEpisodes] = {}

    def compared(variant: Variant, episodes: ReachEpisodes) -> Json:
        """Return the comparison with the targets for random goals within the usual time."""
        if variant.goal_set == "grid":
            at_targets[suffix_of(variant.mode)] = episodes
        if variant.goal_set == "grid" or variant.settings != usual:
            return {}
        return {
            "against_targets": against(episodes, at_targets[suffix_of(variant.mode)]),
            "between": between(episodes, bench.targets),
        }

    variants = [
        bench.variant("targets" + suffix_of(mode), grid, mode) for mode in bench.direct_modes
    ]
    for mode, limit in product(bench.goal_modes, LIMITS_S):
        name = mode if limit == usual.time_limit_s else f"{mode}-{limit:g}s"
        variant = bench.variant(name, goals, mode, time_limit_s=limit)
        variants.append(replace(variant, goal_set="box"))
    bench.measure(variants, compared)
    bench.recheck(variants[-2])
    return bench.result()
