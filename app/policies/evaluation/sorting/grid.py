"""Protocol ``sorting-grid``: every pair of object and goal numbers (docs/method.md 1.5).

For every pair ``1 <= K_G <= K_E <= K`` (objects in the goal, all objects), with the
same episodes in all rows of one start:

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

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict

import numpy as np

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.sorting.episodes import (
    ENDLESS,
    HORIZON_FACTOR,
    Chooser,
    SortingEpisodes,
    Values,
    greedy,
    joined,
    run_episodes,
    run_with_fallback,
)
from app.policies.evaluation.sorting.optimal_baseline import choose_by_planner
from app.policies.evaluation.statistics import Index, mean_of, rate_of, share_of
from app.policies.inference.sorting_policy import SortingPolicy
from app.sim.core.arrays import Vec
from app.sim.sorting.batch import SortingBatch, SortingSettings, fail_of
from app.sim.sorting.state import SortingShape

CHUNK = 4000
"""Maximum number of environments of a batch."""
SMALL = 10
"""Maximum number of clutter slots of the smaller task."""
STARTS: Mapping[str, float] = {"clean": 0.0, "disturbed": 1.0}
"""Share of disturbed starts by the kind of row."""
DECIDERS = ("", "-planner-fallback", "-planner")
"""Suffixes of row names: policy, policy with planner fallback, exact planner."""


def pairs_of(shape: SortingShape) -> Index:
    """Return every (K_E, K_G), shape (K (K + 1) / 2, 2)."""
    k = shape.n_slots
    return np.array([(n, g) for n in range(1, k + 1) for g in range(1, n + 1)])


def grid_batches(
    shape: SortingShape, fail: Vec, per_pair: int, seed: int, disturbed: float
) -> Iterator[SortingBatch]:
    """Yield batches with ``per_pair`` episodes of every pair, in the order of the pairs."""
    pairs = np.repeat(pairs_of(shape), per_pair, axis=0)
    settings = SortingSettings(horizon_factor=ENDLESS, disturbed_share=disturbed)
    for first in range(0, len(pairs), CHUNK):
        part = pairs[first : first + CHUNK]
        batch = SortingBatch(shape, fail, len(part), seed, settings, first_env=first)
        batch.envs.fixed_objects[:], batch.envs.fixed_goal[:] = part.T
        batch.reset()
        yield batch


def run_kind(batches: Iterable[SortingBatch], choose: Chooser) -> tuple[SortingEpisodes, ...]:
    """Return the episodes of batches for each of DECIDERS."""
    found = []
    for batch in batches:
        policy = run_with_fallback(batch, batch.reset, choose)
        batch.reset()
        found.append((*policy, run_episodes(batch, choose_by_planner)))
    return tuple(joined(list(episodes)) for episodes in zip(*found, strict=True))


def row_of(name: str, episodes: SortingEpisodes, pairs: Index, least: float) -> Json:
    """Return a row of the result.

    Args:
        episodes: Equal numbers of episodes of each pair, in the order of ``pairs``.
        pairs: All (K_E, K_G), shape (n_pairs, 2).
        least: Required success rate of each pair.
    """
    n, won = len(episodes.success), episodes.success
    each = np.arange(n).reshape(len(pairs), -1)
    found = [
        pair_of(int(n_e), int(n_g), episodes.part(each[p]), least)
        for p, (n_e, n_g) in enumerate(pairs)
    ]
    worst = min(found, key=lambda one: (one["success"]["mean"], -one["n_objects"]))
    good = episodes.part(won)
    return {
        "name": name,
        "n": n,
        "success": rate_of(won),
        "timeout": rate_of(~won),
        "worst_pair": {
            **worst["success"],
            "n_objects": worst["n_objects"],
            "n_goal": worst["n_goal"],
        },
        "pairs_below": sum(one["below"] for one in found),
        "moves_over_minimum": mean_of(good.moves / good.fewest),
        "exactly_minimal": rate_of(won & (episodes.moves == episodes.fewest)),
        "attempts_over_expected": mean_of(good.attempts / good.expected),
        "riskier_pick": share_of(episodes.riskier, episodes.picks),
        "failed_pick": share_of(episodes.failed, episodes.picks),
        "planner_fallback": rate_of(episodes.planner_fallback),
        "repeated": rate_of(episodes.repeated),
        "mean_return": float(episodes.rewards.mean()),
        "pairs": found,
    }


def pair_of(n_objects: int, n_goal: int, episodes: SortingEpisodes, least: float) -> Json:
    """Return success and return of a pair, and whether its success rate is below ``least``.

    The comparison uses the upper bound of the success rate.
    """
    success = rate_of(episodes.success)
    return {
        "n_objects": n_objects,
        "n_goal": n_goal,
        "success": success,
        "return": float(episodes.rewards.mean()),
        "below": success["high"] < least,
    }


def run_grid(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate a sorting policy on every pair (K_E, K_G)."""
    return on_checkpoint(grid, checkpoint, request)


def on_checkpoint(
    protocol: Callable[..., Json], checkpoint: Checkpoint, request: EvaluationRequest
) -> Json:
    """Run a protocol with policy, task and failure probabilities of a checkpoint's cell."""
    policy = SortingPolicy(checkpoint)
    fail = fail_of(cell_of(checkpoint.manifest))
    found = protocol(policy.values, policy.shape, fail, request)
    return {**found, "settings": {"cell": policy.cell, **found["settings"]}}


def grid(values: Values, shape: SortingShape, fail: Vec, request: EvaluationRequest) -> Json:
    """Evaluate a policy on every pair.

    Args:
        values: Q of every move, from observations.
        shape: Size of the task.
        fail: Failure probabilities of the clutter slots, shape (K,).
        request: Its episodes are those of each pair and row; by default 1000 for up to 10
            slots and 300 for more.
    """
    small = shape.n_slots <= SMALL
    per_pair, least = request.episodes or (1000 if small else 300), 0.99 if small else 0.98
    pairs, choose = pairs_of(shape), greedy(values)
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


def settings_of(shape: SortingShape, fail: Vec) -> Json:
    """Return the settings stated with a result."""
    return {
        **asdict(shape),
        "horizon_attempts": round(HORIZON_FACTOR * shape.n_slots),
        "failure_max": float(fail.max()),
        "failure_mean": float(fail.mean()),
        "weights": SortingSettings().weights._asdict(),
    }
