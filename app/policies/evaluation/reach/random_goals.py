"""Protocol ``reach-random``: goals anywhere in the box, which no grid holds.

The same 5000 goals and people, whichever checkpoint is asked and however. A policy takes the
goal as an input, so each can be asked directly; one that was trained on a set of targets can
also be asked at those around the goal, and its actions interpolated.

====================  ======================================================================
``targets``           the grid's targets instead, asked directly, the same people, 5 s
``WAY``, ``WAY-25s``  random goals by each way that the checkpoint allows, 5 s and 25 s
``...-rollout``         the same looking ahead with the policy (``rollout.py``)
====================  ======================================================================

``between`` groups the episodes of 5 s by the way from their goals to the nearest target.
``against_targets`` is the difference of the success rates, episode by episode beside the same
people, with its 95 % interval. In 25 s a policy is told 5 s until no more are left: more it
never met.

Source: thesis 4.4.3; METHOD 2.4 and 2.6.
"""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.reach.bench import ReachBench, direct_ways, ending, goal_ways
from app.policies.evaluation.reach.episodes import ReachEpisodes, against
from app.policies.evaluation.rows import OnRow, ignore_row
from app.sim.core.arrays import Vec

DEFAULT_EPISODES = 5000
"""METHOD 2.6."""
LIMITS_S = (5.0, 25.0)
"""Longest episodes."""
RINGS = (0.0, 0.06, 0.09, 0.11, 0.13, 0.18)
"""Bounds of the ways to the nearest target by which episodes are grouped [m]."""


def between(episodes: ReachEpisodes, targets: Vec) -> list[dict[str, Any]]:
    """Return how episodes ended, by the way from their goals to the nearest target."""
    ways = np.linalg.norm(episodes.goals[:, None] - targets, axis=2).min(axis=1)
    groups = [(low, high, (low <= ways) & (ways < high)) for low, high in pairwise(RINGS)]
    return [
        {"low_m": low, "high_m": high, **episodes.rates(which)}
        for low, high, which in groups
        if which.any()
    ]


def run_random(
    checkpoint: Checkpoint, *, episodes: int | None, seed: int, on_row: OnRow = ignore_row
) -> dict[str, Any]:
    """Evaluate on goals anywhere in the box.

    Args:
        checkpoint: What acts.
        episodes: Number of episodes of each row, by default 5000.
        seed: Seed of goals and people; use one that nothing was tuned on.
        on_row: Told of each row once it is known.
    """
    bench, n = ReachBench(checkpoint, seed, on_row), episodes or DEFAULT_EPISODES
    ways, there = goal_ways(bench.actor), direct_ways(bench.actor)
    bench.n_rows = len(there) + len(LIMITS_S) * len(ways)
    at_targets = {}
    for how in there:
        played = bench.play(bench.usual, bench.target_goals(n), how)
        at_targets[ending(how)] = played
        bench.add(played.row("targets" + ending(how)), bench.usual, "grid", how)
    goals = bench.random_goals(n)
    for how in ways:
        for limit in LIMITS_S:
            settings = replace(bench.usual, time_limit_s=limit)
            played = bench.play(settings, goals, how)
            usual = limit == bench.usual.time_limit_s
            row = played.row(how if usual else f"{how}-{limit:g}s")
            if usual:
                row["against_targets"] = against(played, at_targets[ending(how)])
                row["between"] = between(played, bench.targets)
            bench.add(row, settings, "box", how)
    bench.recheck(bench.usual, goals, ways[-1])
    return bench.result()
