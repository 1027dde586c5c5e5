"""Protocol ``sorting-grid``: every pair of object and goal numbers (docs/method.md 1.5).

For every pair ``1 <= K_G <= K_E <= K``, with the same episodes in all rows of one start:

==============================  ============================================================
``clean``                       the policy alone, from starts with everything in the clutter
``disturbed``                   the same with objects on towers and partly built goals
``clean-planner-fallback``      the policy until it cycles, then the exact planner
``disturbed-planner-fallback``  the same from disturbed starts
``clean-planner``               the exact planner alone: the optimal baseline
``disturbed-planner``           the same from disturbed starts
==============================  ============================================================

Episodes end after 4 K attempts; a planner fallback restarts the count.

Source: thesis 3.4.2, fig. 3.2. Deviates: disturbed starts, planner fallback and optimal
baseline are ours.
"""

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.sorting.episodes import (
    HORIZON_FACTOR,
    Chooser,
    Index,
    SortingEpisodes,
    Values,
    greedy,
    joined,
    run_episodes,
    run_with_fallback,
)
from app.policies.evaluation.sorting.optimal_baseline import choose_by_planner
from app.policies.evaluation.sorting.pairs import SMALL, grid_batches, pairs_of
from app.policies.evaluation.statistics import mean_of, share_of, wilson
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import SortingBatch, SortingSettings
from app.sim.sorting.state import SortingShape

STARTS: Mapping[str, float] = {"clean": 0.0, "disturbed": 1.0}
"""Share of disturbed starts by the kind of row."""
DECIDERS = ("", "-planner-fallback", "-planner")
"""Suffixes of row names: policy, policy with planner fallback, exact planner."""


def episodes_for(shape: SortingShape) -> int:
    """Return the default number of episodes per pair."""
    return 1000 if shape.n_cells <= SMALL else 300


def least_success(shape: SortingShape) -> float:
    """Return the required success rate of each pair."""
    return 0.99 if shape.n_cells <= SMALL else 0.98


def run_kind(batches: Iterable[SortingBatch], choose: Chooser) -> tuple[SortingEpisodes, ...]:
    """Return the episodes of batches for each of DECIDERS."""
    found = []
    for batch in batches:

        def restarted(batch: SortingBatch = batch) -> SortingBatch:
            batch.reset()
            return batch

        policy = run_with_fallback(restarted, choose)
        found.append((*policy, run_episodes(restarted(), choose_by_planner)))
    return tuple(joined(list(episodes)) for episodes in zip(*found, strict=True))


def row_of(name: str, episodes: SortingEpisodes, pairs: Index, least: float) -> dict[str, Any]:
    """Return a row of the result.

    Args:
        episodes: Equal numbers of episodes of each pair, in the order of ``pairs``.
        pairs: All (K_E, K_G), shape (n_pairs, 2).
        least: Required success rate of each pair.
    """
    n, won = len(episodes.success), episodes.success
    each = np.arange(n).reshape(len(pairs), -1)
    cells = [
        pair_of(int(n_e), int(n_g), episodes.part(each[p]), least)
        for p, (n_e, n_g) in enumerate(pairs)
    ]
    worst = min(cells, key=lambda cell: (cell["success"]["mean"], -cell["n_objects"]))
    good = episodes.part(won)
    return {
        "name": name,
        "n": n,
        "success": wilson(int(won.sum()), n),
        "timeout": wilson(int((~won).sum()), n),
        "worst_pair": {
            **worst["success"],
            "n_objects": worst["n_objects"],
            "n_goal": worst["n_goal"],
        },
        "pairs_below": sum(cell["below"] for cell in cells),
        "moves_over_minimum": mean_of(good.moves / good.fewest),
        "exactly_minimal": wilson(int((good.moves == good.fewest).sum()), n),
        "attempts_over_expected": mean_of(good.attempts / good.expected),
        "riskier_pick": share_of(episodes.riskier, episodes.picks),
        "failed_pick": share_of(episodes.failed, episodes.picks),
        "planner_fallback": wilson(int(episodes.planner_fallback.sum()), n),
        "repeated": wilson(int(episodes.repeated.sum()), n),
        "mean_return": float(episodes.rewards.mean()),
        "pairs": cells,
    }


def pair_of(
    n_objects: int, n_goal: int, episodes: SortingEpisodes, least: float
) -> dict[str, Any]:
    """Return success and return of a pair, and whether its success rate is below ``least``.

    The comparison uses the upper bound of the success rate.
    """
    success = wilson(int(episodes.success.sum()), len(episodes.success))
    return {
        "n_objects": n_objects,
        "n_goal": n_goal,
        "success": success,
        "return": float(episodes.rewards.mean()),
        "below": success["high"] < least,
    }


def grid(values: Values, shape: SortingShape, fail: Vec, request: EvaluationRequest) -> Json:
    """Evaluate a policy on every pair.

    Args:
        values: Q of every move, from observations.
        shape: Size of the task.
        fail: Failure probabilities of the clutter slots, shape (K,).
        request: Its episodes are those of each pair and row; by default 1000 for up to 10
            cells and 300 for more.
    """
    per_pair = request.episodes or episodes_for(shape)
    pairs, least, choose = pairs_of(shape), least_success(shape), greedy(values)
    rows = request.rows(len(DECIDERS) * len(STARTS))
    for start, disturbed in STARTS.items():
        found = run_kind(grid_batches(shape, fail, per_pair, request.seed, disturbed), choose)
        for end, part in zip(DECIDERS, found, strict=True):
            rows.append(row_of(start + end, part, pairs, least))
    return {
        "episodes": per_pair,
        "settings": {**settings_of(shape, fail), "pairs": len(pairs), "least_success": least},
        "results": rows,
    }


def settings_of(shape: SortingShape, fail: Vec) -> dict[str, Any]:
    """Return the settings stated with a result."""
    return {
        **asdict(shape),
        "horizon_attempts": round(HORIZON_FACTOR * shape.n_cells),
        "failure_max": float(fail.max()),
        "failure_mean": float(fail.mean()),
        "weights": SortingSettings().weights._asdict(),
    }
