"""Protocols ``pick-single`` and ``pick-choice`` (docs/method.md 3.6).

Timeout 10 s, start clearance 0.05 m, starts mixed evenly over home, cubes and docks, person
with postures that do not occur in training. The result states the hand speeds of the person.
FCL checks the poses of the first 200 episodes on the raw meshes for missed contacts.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict

import numpy as np

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.checkpoints.trained_cell import cell_of
from app.policies.evaluation.pick import selection_rules as choice_rules
from app.policies.evaluation.pick.episodes import Episodes, Evaluator, Rule, settings_for
from app.policies.evaluation.pick.recorded_people import recheck
from app.policies.evaluation.rows import OnRow, ignore_row
from app.policies.inference.task_selection import HYSTERESIS, ValueNetworks, pick_preset_of
from app.sim.pick.batch import OUTCOMES, hand_speeds
from app.sim.scenario.kernels import episode as kernel
from app.sim.scene.scene import kinds_of

DEFAULT_EPISODES = 1000
N_RECHECKED = 200
"""Number of episodes checked again with FCL."""
OTHER_RULES: Mapping[str, Callable[[int, int], Rule]] = {
    "critic-each-step": lambda _seed, _n: choice_rules.critic(0.0),
    "nearest": lambda _seed, _n: choice_rules.nearest,
    "random": choice_rules.at_random,
}
"""Rules compared with the critic's, made from seed and number of episodes."""


def evaluator_of(
    checkpoint: Checkpoint, n_candidates: tuple[int, int], episodes: int | None, seed: int
) -> Evaluator:
    """Return the evaluator of a checkpoint; by default of 1000 episodes."""
    settings = settings_for(n_candidates, pick_preset_of(checkpoint))
    n = episodes or DEFAULT_EPISODES
    return Evaluator(ValueNetworks(checkpoint), cell_of(checkpoint.manifest), n, seed, settings)


def settings_of(evaluator: Evaluator) -> dict[str, object]:
    """Return the settings stated with a result."""
    settings, state = evaluator.batch.settings, evaluator.batch.state
    return {
        "time_limit_s": settings.time_limit_s,
        "people": list(kinds_of(evaluator.batch.cell)),
        "start": settings.start,
        "start_clearance_m": settings.start_clearance_m,
        "action": asdict(settings.action),
        "starts_redrawn_share": float((state.n_redrawn > 0).mean()),
        "candidates": list(settings.n_candidates),
        **hand_speeds(evaluator.batch),
    }


def run_single(
    checkpoint: Checkpoint, *, episodes: int | None, seed: int, on_row: OnRow = ignore_row
) -> dict[str, object]:
    """Evaluate one random target per episode.

    Args:
        checkpoint: Policy.
        episodes: Number of episodes, by default 1000.
        seed: Seed of the episodes; use one that was not used for tuning.
        on_row: Callback for the finished row.
    """
    evaluator = evaluator_of(checkpoint, (1, 1), episodes, seed)
    outcome = evaluator.run(choice_rules.fixed(0), min(N_RECHECKED, evaluator.batch.n_envs))
    row = outcome.row("policy")
    on_row(1, 1, row)
    return {
        "settings": settings_of(evaluator),
        "results": [row],
        "fcl_recheck": recheck(evaluator.batch.cell, outcome.trajectories),
    }


def run_choice(
    checkpoint: Checkpoint, *, episodes: int | None, seed: int, on_row: OnRow = ignore_row
) -> dict[str, object]:
    """Evaluate task selection among 2-3 random targets and compare selection rules.

    Args:
        checkpoint: Policy and critic.
        episodes: Number of episodes, by default 1000.
        seed: Seed of the episodes; use one that was not used for tuning.
        on_row: Callback for each finished row.
    """
    evaluator = evaluator_of(checkpoint, (2, 3), episodes, seed)
    n = evaluator.batch.n_envs
    with_hysteresis = evaluator.run(choice_rules.critic(HYSTERESIS), min(N_RECHECKED, n))
    rows = [with_hysteresis.row("critic")]
    on_row(1, 2 + len(OTHER_RULES), rows[-1])
    for name, rule in OTHER_RULES.items():
        rows.append(evaluator.run(rule(seed, n)).row(name))
        on_row(len(rows), 2 + len(OTHER_RULES), rows[-1])
    rows.append(_oracle([evaluator.run(choice_rules.fixed(k)) for k in range(3)]))
    on_row(len(rows), len(rows), rows[-1])
    return {
        "settings": {**settings_of(evaluator), "hysteresis": HYSTERESIS},
        "results": rows,
        "fcl_recheck": recheck(evaluator.batch.cell, with_hysteresis.trajectories),
    }


def _oracle(runs: list[Episodes]) -> dict[str, object]:
    """Return the row of the best fixed candidate of each episode, selected afterwards."""
    rank = np.zeros(len(OUTCOMES))
    rank[[kernel.TIMEOUT, kernel.UNFEASIBLE, kernel.COLLISION]] = 1, 2, 3
    badness = np.stack([1e3 * rank[run.outcome] + run.duration_s for run in runs])
    best, rows = badness.argmin(axis=0), np.arange(badness.shape[1])
    pooled = Episodes(
        outcome=np.stack([run.outcome for run in runs])[best, rows],
        duration_s=np.stack([run.duration_s for run in runs])[best, rows],
        switches=np.zeros(len(rows), dtype=np.int64),
        trajectories=(),
    )
    return pooled.row("oracle")
