"""Evaluate several training seeds of one preset on all targets.

    python -m tools.docs.reach.seeds RUN ... [--seed N] [--episodes N]

A RUN is a folder written by ``training_curves.py``. Its last policy is evaluated on the row
``clearance`` of ``reach-targets``, with and without rollout, beside the same people. The result
also holds the training time and the time at which the curve first exceeded the 91.76 % of the
thesis (greedy episodes on the goals of the training) [CPU min]. Writes
``docs/results/reach-seeds.json``.
"""

import argparse
from pathlib import Path

import torch

from app.policies.evaluation.reach.bench import ReachBench, suffix_of
from tools.docs.learning_curves import lines
from tools.docs.reach.style import THESIS_SUCCESS
from tools.docs.results import RESULTS, Json, write_result
from tools.docs.training_curves import read

RESULT = RESULTS / "reach-seeds.json"
PER_TARGET = 100


def rows_of(folder: Path, seed: int, per_target: int) -> tuple[str, list[Json]]:
    """Return the checkpoint of a run and one row per inference mode."""
    checkpoint = read(sorted(folder.glob("step-*.json"))[-1])
    manifest = checkpoint.manifest
    points = lines(folder / "curve.jsonl")
    passed = [
        one["cpu_s"] / 60.0 for one in points if (one["success"] or 0.0) >= THESIS_SUCCESS
    ]
    bench = ReachBench(checkpoint, seed)
    rows = []
    for mode in bench.direct_modes:
        row = bench.on_targets(per_target, mode).row(
            f"seed-{manifest['seed']}{suffix_of(mode)}"
        )
        spent = {"cpu_min": points[-1]["cpu_s"] / 60.0, "updates": manifest["updates"]}
        rows.append({**row, **spent, "to_source_min": passed[0] if passed else None})
    return checkpoint.sha256, rows


def main() -> None:
    """Evaluate runs and write the result."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN")
    parser.add_argument("--seed", type=int, default=11, help="of the episodes")
    parser.add_argument("--episodes", type=int, default=PER_TARGET, help="per target")
    options = parser.parse_args()
    torch.set_num_threads(1)
    found = [rows_of(folder, options.seed, options.episodes) for folder in options.runs]
    result = {
        "protocol": "reach-seeds",
        "command": "python -m tools.docs.reach.seeds RUN ...",
        "policy": "reach-td3",
        "checkpoints": [name for name, _ in found],
        "seed": options.seed,
        "episodes": options.episodes,
        "results": [row for _, rows in found for row in rows],
    }
    write_result(RESULT, result)


if __name__ == "__main__":
    main()
