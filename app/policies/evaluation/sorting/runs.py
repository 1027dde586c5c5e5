"""Protocols ``sorting-grid`` and ``sorting-tests`` of a checkpoint (docs/method.md 1.5).

``grid.py`` and ``benchmark_tasks.py`` define the rows. The task and its failure probabilities
are those of the policy's training cell.
"""

from collections.abc import Callable
from typing import Any

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.rows import OnRow, ignore_row
from app.policies.evaluation.sorting.benchmark_tasks import trials
from app.policies.evaluation.sorting.grid import grid
from app.policies.inference.sorting_policy import SortingPolicy
from app.sim.sorting.batch import fail_of


def run_grid(
    checkpoint: Checkpoint, *, episodes: int | None, seed: int, on_row: OnRow = ignore_row
) -> dict[str, Any]:
    """Evaluate a sorting policy on every pair (K_E, K_G).

    Args:
        checkpoint: Policy.
        episodes: Number of episodes per pair and row, by default 1000 for up to 10 cells and
            300 for more.
        seed: Seed of the episodes; use one that was not used for tuning.
        on_row: Callback for each finished row.
    """
    return _run(grid, checkpoint, episodes, seed, on_row)


def run_tests(
    checkpoint: Checkpoint, *, episodes: int | None, seed: int, on_row: OnRow = ignore_row
) -> dict[str, Any]:
    """Evaluate a sorting policy in the six tests.

    Args:
        checkpoint: Policy.
        episodes: Number of episodes per test, by default 1000.
        seed: Seed of the episodes; use one that was not used for tuning.
        on_row: Callback for each finished row.
    """
    return _run(trials, checkpoint, episodes, seed, on_row)


def _run(
    protocol: Callable[..., dict[str, Any]],
    checkpoint: Checkpoint,
    episodes: int | None,
    seed: int,
    on_row: OnRow,
) -> dict[str, Any]:
    """Run a protocol with the task of a checkpoint; the result states the cell."""
    policy = SortingPolicy(checkpoint)
    fail = fail_of(cell_of(checkpoint.manifest))
    found = protocol(policy.values, policy.shape, fail, episodes, seed, on_row)
    return {**found, "settings": {"cell": policy.cell, **found["settings"]}}
