"""Protocol ``reach-targets``: every training target of the source, beside one walking person.

54 targets x 100 episodes in each row, the same people and goals but for how people may start:

=============  =============================================================================
``clearance``  at least 0.05 m from the robot; what all other protocols use
``uniform``    anywhere; some episodes begin in contact, which no policy can help
``authors``    as in the authors' public code: anywhere, they walk a little differently, and
               an episode goes on after a contact
=============  =============================================================================

``-rollout`` are the same looking ahead (``rollout.py``), where the policy can.

An episode with a contact is no success in any row; ``reached_after_contact`` is the share that
came to the goal all the same.

Source: thesis 4.4.3, figs 4.5 and 4.6; METHOD 2.6. Deviates: the source does not say how its
people may start.
"""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.reach.bench import ReachBench, direct_ways, ending
from app.policies.evaluation.reach.episodes import ReachEpisodes
from app.policies.evaluation.rows import OnRow, ignore_row
from app.policies.evaluation.statistics import wilson
from app.sim.core.arrays import Vec
from app.sim.reach.batch import StartRule
from app.sim.scenario.kernels.episode import COLLISION, SUCCESS

PER_TARGET = 100
"""Episodes of each target (METHOD 2.6)."""
STARTS: tuple[StartRule, ...] = ("clearance", "uniform", "authors")
END_STEP_S = 0.1
"""Intervals in which ends are counted [s]."""
N_WORST = 5
"""Targets that are named as the worst."""
Json = dict[str, Any]


def by_target(episodes: ReachEpisodes, targets: Vec, base_height: float) -> list[Json]:
    """Return how the episodes of each target ended.

    Args:
        episodes: Episodes with goals among the targets.
        targets: In the robot's base frame [m], shape (n, 3).
        base_height: Of the robot's base above the floor [m].
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


def worst_of(cells: list[Json]) -> list[Json]:
    """Return the targets with the fewest successes, the worst first."""
    ranked = sorted(cells, key=lambda cell: cell["success"]["mean"])
    return [
        {"goal": cell["goal"], "height_m": cell["height_m"], **cell["success"]}
        for cell in ranked[:N_WORST]
    ]


def ends_over_time(episodes: ReachEpisodes) -> list[Json]:
    """Return how many episodes ended by success and by collision in each interval of time."""
    edges = np.arange(0.0, episodes.limit_s + 0.5 * END_STEP_S, END_STEP_S)
    times = [episodes.duration_s[episodes.outcome == end] for end in (SUCCESS, COLLISION)]
    won, hit = (np.histogram(part - 1e-9, edges)[0].tolist() for part in times)
    return [
        {"until_s": round(float(until), 6), "success": one, "collision": other}
        for until, one, other in zip(edges[1:], won, hit, strict=True)
    ]


def reached_after_contact(episodes: ReachEpisodes) -> dict[str, float]:
    """Return the share of episodes that came to the goal although there was a contact."""
    early = episodes.duration_s < episodes.limit_s - 1e-6
    reached = (episodes.outcome == COLLISION) & early
    return wilson(int(reached.sum()), len(reached))


def run_targets(
    checkpoint: Checkpoint, *, episodes: int | None, seed: int, on_row: OnRow = ignore_row
) -> Json:
    """Evaluate on all targets of the grid, under three rules of starting.

    Args:
        checkpoint: What acts.
        episodes: Number of episodes of each target, by default 100.
        seed: Seed of the episodes; use one that nothing was tuned on.
        on_row: Told of each row once it is known.
    """
    bench = ReachBench(checkpoint, seed, on_row)
    ways = direct_ways(bench.actor)
    bench.n_rows = len(ways) * len(STARTS)
    per_target = episodes or PER_TARGET
    goals = bench.target_goals(per_target * len(bench.targets))
    for how, start in product(ways, STARTS):
        settings = replace(bench.usual, start=start, collision_ends=start != "authors")
        played = bench.play(settings, goals, how)
        cells = by_target(played, bench.targets, bench.cell.table.height)
        row = {
            **played.row(start + ending(how)),
            "begun_in_contact": played.begun_in_contact(),
            "starts_redrawn": float(np.mean(played.redrawn > 0)),
            "worst": worst_of(cells),
            "ends": ends_over_time(played),
            "targets": cells,
        }
        if not settings.collision_ends:
            row["reached_after_contact"] = reached_after_contact(played)
        bench.add(row, settings, "grid", how)
    bench.recheck(bench.usual, goals, ways[-1])
    return {"episodes": per_target, **bench.result(targets=len(bench.targets))}
