"""Selection rules: critic with hysteresis, and baselines (docs/method.md 3.6)."""

import numpy as np

from app.policies.evaluation.pick.episodes import Rule, SelectionInput
from app.policies.evaluation.statistics import Index
from app.policies.inference.task_selection import select


def _n_candidates(view: SelectionInput) -> Index:
    count: Index = np.isfinite(view.distances).sum(axis=1)
    return count


def critic(hysteresis: float) -> Rule:
    """Return the critic's rule, applied at every step."""

    def rule(view: SelectionInput) -> Index:
        return select(view.values, None if view.first else view.chosen, hysteresis)

    return rule


def nearest(view: SelectionInput) -> Index:
    """Return the candidate nearest to the TCP, shape (n,), at every step."""
    choice: Index = view.distances.argmin(axis=1)
    return choice


def clearest(view: SelectionInput) -> Index:
    """Return the candidate with the largest clearance to people, shape (n,), at every step."""
    choice: Index = view.clearances.argmax(axis=1)
    return choice


def critic_once(view: SelectionInput) -> Index:
    """Return the critic's choice at the start, shape (n,), and keep it."""
    best: Index = view.values.argmax(axis=1)
    return best if view.first else view.chosen


def at_random(seed: int, n_episodes: int) -> Rule:
    """Return the rule that selects a random candidate at the start and keeps it."""
    draw = np.random.default_rng(seed).random(n_episodes)

    def rule(view: SelectionInput) -> Index:
        if not view.first:
            return view.chosen
        return (draw[view.rows] * _n_candidates(view)).astype(np.int64)

    return rule


def fixed(place: int) -> Rule:
    """Return the rule that keeps the candidate at ``place``, or the last one there is."""

    def rule(view: SelectionInput) -> Index:
        return np.minimum(place, _n_candidates(view) - 1)

    return rule
