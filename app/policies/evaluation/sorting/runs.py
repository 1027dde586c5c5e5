"""Protocols ``sorting-grid`` and ``sorting-tests`` of a checkpoint (docs/method.md 1.5).

``grid.py`` and ``benchmark_tasks.py`` define the rows. The task and its failure probabilities
are those of the policy's training cell.
"""

from collections.abc import Callable

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.rows import EvaluationRequest, Json
from app.policies.evaluation.sorting.benchmark_tasks import trials
from app.policies.evaluation.sorting.grid import grid
from app.policies.inference.sorting_policy import SortingPolicy
from app.sim.sorting.batch import fail_of


def run_grid(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate a sorting policy on every pair (K_E, K_G)."""
    return _run(grid, checkpoint, request)


def run_tests(checkpoint: Checkpoint, request: EvaluationRequest) -> Json:
    """Evaluate a sorting policy in the six tests."""
    return _run(trials, checkpoint, request)


def _run(
    protocol: Callable[..., Json], checkpoint: Checkpoint, request: EvaluationRequest
) -> Json:
    """Run a protocol with the task of a checkpoint; the result states the cell."""
    policy = SortingPolicy(checkpoint)
    fail = fail_of(cell_of(checkpoint.manifest))
    found = protocol(policy.values, policy.shape, fail, request)
    return {**found, "settings": {"cell": policy.cell, **found["settings"]}}
