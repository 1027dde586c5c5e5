"""Learning curves by the source's protocol: every pair (K_E, K_G), greedy, without fallback.

Source: thesis 3.4.2 and fig. 3.1, docs/method.md 1.5: every 50,000 steps, 500 episodes of every
pair on e0 and 100 on e1.
"""

from dataclasses import dataclass

from app.policies.evaluation.sorting.episodes import Values, greedy, joined, run_episodes
from app.policies.evaluation.sorting.pairs import SMALL, grid_batches
from app.sim.core.arrays import Vec
from app.sim.sorting.state import SortingShape


@dataclass(frozen=True, slots=True, kw_only=True)
class CurvePoint:
    """Success and return of a policy over all pairs, with equal weights."""

    success: float
    """Success rate."""
    mean_return: float
    """Mean sum of rewards per episode, not discounted."""
    return_sd: float
    """Standard deviation of that sum over episodes."""


def curve_episodes(shape: SortingShape) -> int:
    """Return the source's number of episodes per pair for one point of its curves."""
    return 500 if shape.n_cells <= SMALL else 100


def curve_point(
    values: Values,
    shape: SortingShape,
    fail: Vec,
    episodes_per_pair: int,
    seed: int,
) -> CurvePoint:
    """Evaluate a policy on every pair.

    Args:
        values: Q of every move, from observations.
        shape: Size of the task.
        fail: Failure probabilities of the clutter cells, shape (K,).
        episodes_per_pair: Episodes of each pair; :func:`curve_episodes` gives the source's.
        seed: Seed of the episodes.
    """
    batches = grid_batches(shape, fail, episodes_per_pair, seed, 0.0)
    found = joined([run_episodes(batch, greedy(values)) for batch in batches])
    return CurvePoint(
        success=float(found.success.mean()),
        mean_return=float(found.rewards.mean()),
        return_sd=float(found.rewards.std()),
    )
