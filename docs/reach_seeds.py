"""Measure what several training seeds of one recipe give, round all targets.

    python docs/reach_seeds.py RUN ... [--seed N] [--episodes N]

A RUN is a folder that ``docs/training_curves.py`` wrote; its last policy plays the row
``clearance`` of ``reach-targets``, alone and looking ahead, with the same people for all.
Beside that stand what the training cost and when its curve was first above the source's
91.76 % (greedy episodes with the training's goals), in CPU minutes. Writes
``docs/results/reach-seeds.json``.
"""

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import torch

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from app.machine import describe  # noqa: E402 - the line above lets it be found
from app.policies.evaluation.reach.bench import ReachBench, direct_ways, ending  # noqa: E402
from docs.reach_points import lines  # noqa: E402
from docs.training_curves import read  # noqa: E402

RESULTS = ROOT / "docs/results/reach-seeds.json"
SOURCE = 0.9176
"""Success of the source's policy on its targets."""
PER_TARGET = 100
Json = dict[str, Any]


def rows_of(folder: Path, seed: int, per_target: int) -> tuple[str, list[Json]]:
    """Return the checkpoint of a run, and a row for each way of asking it."""
    checkpoint = read(sorted(folder.glob("step-*.json"))[-1])
    manifest = checkpoint.manifest
    told = lines(folder / "curve.jsonl")
    passed = [one["cpu_s"] / 60.0 for one in told if (one["success"] or 0.0) >= SOURCE]
    bench = ReachBench(checkpoint, seed)
    goals, rows = bench.target_goals(per_target * len(bench.targets)), []
    for how in direct_ways(bench.actor):
        played = bench.play(bench.usual, goals, how)
        row = played.row(f"seed-{manifest['seed']}{ending(how)}")
        spent = {"cpu_min": manifest["cpu_s"] / 60.0, "updates": manifest["updates"]}
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
        "command": "python docs/reach_seeds.py RUN ...",
        "policy": "reach-td3",
        "checkpoints": [name for name, _ in found],
        "seed": options.seed,
        "episodes": options.episodes,
        "results": [row for _, rows in found for row in rows],
        "machine": describe(),
    }
    RESULTS.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
