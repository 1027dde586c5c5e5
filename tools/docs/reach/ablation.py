"""Ablation study of ``reach-td3``: one change at a time, several training seeds.

    python -m tools.docs.reach.ablation FOLDER [--seeds 1 2 3] [--only NAME ...] [--measure]

Trains ``reach-td3`` and each variant in CHANGES for 1.28 million steps into ``FOLDER/NAME-
SEED``; completed runs are skipped, interrupted runs are restarted. The final policy of each
run is evaluated on the row ``clearance`` of ``reach-targets`` without rollout, beside the same
people. Several processes may train different seeds or variants. ``--measure`` evaluates the
existing runs without training and writes ``docs/results/reach-ablation.json``.

Intervals are over training seeds (Student's t); ``against_base`` is the difference of the mean
success rate to the base preset (Welch's t).
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import torch
from scipy import stats

from app.errors import InvalidInput
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.configs import presets
from app.policies.evaluation.reach.bench import ReachBench
from app.policies.evaluation.statistics import clustered
from tools.docs.learning_curves import lines
from tools.docs.reach.curves import ENDS
from tools.docs.results import RESULTS, Json, write_result
from tools.docs.training_curves import read_if_there, record

RESULT = RESULTS / "reach-ablation.json"
BASE = "reach-td3"
SHORT = {
    "learning.total_steps": 1_280_000,
    "learning.checkpoint_steps": 1_280_000,
    "learning.progress_steps": 320_000,
}
"""Settings of all trainings: 9,800 updates."""
CHANGES: Mapping[str, Mapping[str, Any]] = {
    BASE: {},
    "no nominal controller": {"networks.actor": "plain"},
    "no motion predictor": {"episode.observation": "features"},
    "prioritised replay": {"learning.alpha": 0.6},
    "distributional critics": {"networks.critic": "quantiles"},
    "five critics": {"networks.n_critics": 5},
    "twice the width": {"networks.width": 512},
    "no weight averaging": {"learning.ema": 0.0},
    "actor update every second": {"learning.policy_delay": 2},
    "minibatches of 512": {"learning.batch_size": 512},
    "one-step returns": {"learning.n_steps": 1},
    "gamma 0.997": {"learning.gamma": 0.997},
    "people start anywhere": {"episode.start": "uniform"},
    "no normalisation in critics": {"networks.critic_norm": "none"},
}
"""Fields of the preset that each variant changes."""
PER_TARGET = 50
SEED = 77
"""Seed of the episodes; not used in training or in reported results."""


def folder_of(root: Path, name: str, seed: int) -> Path:
    """Return the folder of a variant and seed."""
    return root / f"{name.replace(' ', '-')}-{seed}"


def policy_of(folder: Path) -> Checkpoint | None:
    """Return the policy of a completed training, or None."""
    return read_if_there(folder / f"step-{SHORT['learning.total_steps']:09d}")


def train_missing(root: Path, names: Sequence[str], seeds: Sequence[int]) -> None:
    """Train the missing runs, seed by seed."""
    for seed in seeds:
        for name in names:
            folder = folder_of(root, name, seed)
            if policy_of(folder) is None:
                preset = presets.resolve(BASE, presets.nested({**SHORT, **CHANGES[name]}))
                record(preset, seed, folder)


def evaluated(policy: Checkpoint, folder: Path, per_target: int) -> Json:
    """Return rates of outcomes and training cost of the policy in a folder."""
    rates = ReachBench(policy, SEED).on_targets(per_target).rates()
    return {
        "rates": rates,
        "n": rates["n"],
        "cpu_min": lines(folder / "curve.jsonl")[-1]["cpu_s"] / 60.0,
        "updates": policy.manifest["updates"],
    }


def row_of(name: str, runs: Sequence[Json], base: Sequence[Json]) -> Json:
    """Return the row of a variant over its seeds, with the difference to the base."""
    means = {end: [run["rates"][end]["mean"] for run in runs] for end in ENDS}
    successes = means["success"]
    return {
        "name": name,
        "seeds": len(runs),
        "n": sum(run["n"] for run in runs),
        **{end: clustered(each) for end, each in means.items()},
        "worst_seed": min(successes),
        "best_seed": max(successes),
        "against_base": None
        if runs is base
        else welch(successes, [run["rates"]["success"]["mean"] for run in base]),
        "cpu_min": median(run["cpu_min"] for run in runs),
        "updates": runs[0]["updates"],
    }


def welch(values: Sequence[float], others: Sequence[float]) -> dict[str, float]:
    """Return the difference of two means with its 95 % interval (Welch's t).

    Source: Welch, *The generalization of "Student's" problem* (1947).
    """
    interval = stats.ttest_ind(values, others, equal_var=False).confidence_interval(0.95)
    mean = float(np.mean(values) - np.mean(others))
    return {"mean": mean, "low": float(interval.low), "high": float(interval.high)}


def measured(root: Path, seeds: Sequence[int], per_target: int) -> list[Json]:
    """Return the rows of the base and of variants with at least two completed runs.

    Raises:
        InvalidInput: The base has fewer.
    """
    runs = {
        name: [
            evaluated(found, folder, per_target)
            for folder in (folder_of(root, name, seed) for seed in seeds)
            if (found := policy_of(folder)) is not None
        ]
        for name in CHANGES
    }
    if len(runs[BASE]) < 2:
        raise InvalidInput(BASE, len(runs[BASE]), "must be trained with two or more seeds")
    return [row_of(name, found, runs[BASE]) for name, found in runs.items() if len(found) > 1]


def main() -> None:
    """Train missing runs, or evaluate existing ones."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--only", nargs="+", choices=list(CHANGES), default=list(CHANGES))
    parser.add_argument("--measure", action="store_true", help="train nothing")
    parser.add_argument("--episodes", type=int, default=PER_TARGET, help="per target")
    options = parser.parse_args()
    torch.set_num_threads(1)
    if not options.measure:
        train_missing(options.folder, options.only, options.seeds)
        return
    result = {
        "protocol": "reach-ablation",
        "command": "python -m tools.docs.reach.ablation FOLDER --measure",
        "policy": BASE,
        "seed": SEED,
        "episodes": options.episodes,
        "changes": {name: dict(changed) for name, changed in CHANGES.items()},
        "results": measured(options.folder, options.seeds, options.episodes),
    }
    write_result(RESULT, result)


if __name__ == "__main__":
    main()
