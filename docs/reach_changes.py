"""Measure what each part of a recipe gives: one change at a time, several training seeds.

    python docs/reach_changes.py FOLDER [--seeds 1 2 3] [--only NAME ...] [--measure]

Trains ``reach-td3`` and every variant of it in CHANGES for 1.28 million steps into
``FOLDER/NAME-SEED``, where it is not done yet; a training that was stopped is begun anew. Then
the last policy of each plays the row ``clearance`` of ``reach-targets``, without looking ahead,
beside the same people. Several processes may train different seeds or changes; ``--measure``
plays what is there, trains nothing, and writes ``docs/results/reach-changes.json``.

All seeds meet the same people, so that intervals count seeds, not episodes: a rate's is
Student's over them, and ``against_base``, the difference of the mean success to the recipe as
it is, has Welch's.
"""

import argparse
import json
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import torch
from scipy import stats

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from app.errors import InvalidInput  # noqa: E402 - the line above lets it be found
from app.machine import describe  # noqa: E402
from app.policies.checkpoints.checkpoint import Checkpoint  # noqa: E402
from app.policies.configs import presets  # noqa: E402
from app.policies.evaluation.reach.bench import ReachBench  # noqa: E402
from docs.augmentation import over_seeds  # noqa: E402
from docs.reach_points import ENDS  # noqa: E402
from docs.training_curves import read_if_there, record  # noqa: E402

RESULTS = ROOT / "docs/results/reach-changes.json"
BASE = "reach-td3"
SHORT = {
    "learning.total_steps": 1_280_000,
    "learning.checkpoint_steps": 1_280_000,
    "learning.progress_steps": 320_000,
}
"""What all trainings share: 9,800 updates."""
CHANGES: Mapping[str, Mapping[str, Any]] = {
    BASE: {},
    "without the straight way": {"networks.actor": "plain"},
    "without forecasts": {"episode.observation": "features"},
    "prioritised replay": {"learning.alpha": 0.6},
    "distributional critics": {"networks.critic": "quantiles"},
    "five critics": {"networks.n_critics": 5},
    "twice the width": {"networks.width": 512},
    "no averaged weights": {"learning.ema": 0.0},
    "an actor's update every other": {"learning.policy_delay": 2},
    "minibatches of 512": {"learning.batch_size": 512},
    "one-step returns": {"learning.n_steps": 1},
    "gamma 0.997": {"learning.gamma": 0.997},
    "people start anywhere": {"episode.start": "uniform"},
    "no normalisation in critics": {"networks.critic_norm": "none"},
}
"""Fields of the preset that each variant changes."""
PER_TARGET = 50
SEED = 77
"""Seed of the episodes; training uses none such, and no result that is claimed does."""
Json = dict[str, Any]


def folder_of(root: Path, name: str, seed: int) -> Path:
    """Return where a variant's training with one seed is kept."""
    return root / f"{name.replace(' ', '-')}-{seed}"


def policy_of(folder: Path) -> Checkpoint | None:
    """Return the policy of a finished training; None where it is not finished."""
    return read_if_there(folder / f"step-{SHORT['learning.total_steps']:09d}")


def train_missing(root: Path, names: Sequence[str], seeds: Sequence[int]) -> None:
    """Train what is not there yet, all variants with the first seed first."""
    for seed in seeds:
        for name in names:
            folder = folder_of(root, name, seed)
            if policy_of(folder) is None:
                shutil.rmtree(folder, ignore_errors=True)
                preset = presets.resolve(BASE, presets.nested({**SHORT, **CHANGES[name]}))
                record(preset, seed, folder)


def played(policy: Checkpoint, per_target: int) -> Json:
    """Return how a policy's episodes ended, and what it cost."""
    bench = ReachBench(policy, SEED)
    goals = bench.target_goals(per_target * len(bench.targets))
    return {
        "rates": bench.play(bench.usual, goals).rates(),
        "n": len(goals),
        "cpu_min": policy.manifest["cpu_s"] / 60.0,
        "updates": policy.manifest["updates"],
    }


def row_of(name: str, runs: Sequence[Json], base: Sequence[Json]) -> Json:
    """Return a variant's row over its seeds, and how far it is from the base."""
    means = {end: [run["rates"][end]["mean"] for run in runs] for end in ENDS}
    successes = means["success"]
    return {
        "name": name,
        "seeds": len(runs),
        "n": sum(run["n"] for run in runs),
        **{end: over_seeds(each) for end, each in means.items()},
        "worst_seed": min(successes),
        "best_seed": max(successes),
        "against_base": None
        if runs is base
        else welch(successes, [run["rates"]["success"]["mean"] for run in base]),
        "cpu_min": median(run["cpu_min"] for run in runs),
        "updates": runs[0]["updates"],
    }


def welch(values: Sequence[float], others: Sequence[float]) -> dict[str, float]:
    """Return the difference of two means, of two or more values each, with its 95 % interval.

    Source: Welch, *The generalization of "Student's" problem* (1947).
    """
    interval = stats.ttest_ind(values, others, equal_var=False).confidence_interval(0.95)
    mean = float(np.mean(values) - np.mean(others))
    return {"mean": mean, "low": float(interval.low), "high": float(interval.high)}


def measured(root: Path, seeds: Sequence[int], per_target: int) -> list[Json]:
    """Return a row for the base and every variant with two or more finished trainings.

    Raises:
        InvalidInput: The base has fewer.
    """
    runs = {
        name: [
            played(found, per_target)
            for seed in seeds
            if (found := policy_of(folder_of(root, name, seed))) is not None
        ]
        for name in CHANGES
    }
    if len(runs[BASE]) < 2:
        raise InvalidInput(BASE, len(runs[BASE]), "must be trained with two or more seeds")
    return [row_of(name, found, runs[BASE]) for name, found in runs.items() if len(found) > 1]


def main() -> None:
    """Train what is missing, or measure what is there."""
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
        "protocol": "reach-changes",
        "command": "python docs/reach_changes.py FOLDER --measure",
        "policy": BASE,
        "seed": SEED,
        "episodes": options.episodes,
        "changes": {name: dict(changed) for name, changed in CHANGES.items()},
        "results": measured(options.folder, options.seeds, options.episodes),
        "machine": describe(),
    }
    RESULTS.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
