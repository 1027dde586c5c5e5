"""Measure what several training seeds of one recipe give, round all targets.

    python docs/reach_seeds.py RUN ... [--seed N] [--episodes N]

A RUN is a folder that ``docs/training_curves.py`` wrote; its last policy plays the row
``clearance`` of ``reach-targets``, alone and looking ahead, with the same people for all.
Beside that stand what the training cost and when its curve was first above the source's
91.76 % (greedy episodes with the training's goals), in CPU minutes, from the run's curve in
``reach_curves.json``: training anew gives the same policy bit for bit, but takes as long as
the machine does. Writes ``docs/results/reach-seeds.json``; rows of other seeds in it stay
where they are of the same episodes.
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
from app.policies.checkpoint import load  # noqa: E402
from app.policies.evaluation.reach_bench import ReachBench, direct_ways, ending  # noqa: E402
from app.policies.evaluation.rows import untold  # noqa: E402
from docs.reach_points import RESULTS as CURVES  # noqa: E402

RESULTS = ROOT / "docs/results/reach-seeds.json"
SOURCE = 0.9176
"""Success of the source's policy on its targets."""
PER_TARGET = 100
Json = dict[str, Any]


def curve_of(preset: str, seed: int) -> list[Json]:
    """Return the points of a training's recorded curve.

    Raises:
        KeyError: There is none of that preset and seed.
    """
    curves = json.loads(CURVES.read_text(encoding="utf-8"))["curves"]
    return {(one["name"], one["seed"]): one["played"] for one in curves}[preset, seed]


def kept(rows: list[Json], seed: int, per_target: int) -> list[Json]:
    """Return the rows that are written already, of the same episodes, but those in ``rows``."""
    if not RESULTS.exists():
        return []
    before = json.loads(RESULTS.read_text(encoding="utf-8"))
    if (before["seed"], before["episodes"]) != (seed, per_target):
        return []
    names = {row["name"] for row in rows}
    return [row for row in before["results"] if row["name"] not in names]


def rows_of(folder: Path, seed: int, per_target: int) -> list[Json]:
    """Return a row for each way of asking a run's policy."""
    last = sorted(folder.glob("step-*.json"))[-1]
    manifest = json.loads(last.read_text(encoding="utf-8"))
    checkpoint = load(manifest, last.with_suffix(".safetensors").read_bytes())
    told = curve_of(manifest["preset"]["name"], manifest["seed"])
    passed = [one["cpu_s"] / 60.0 for one in told if one["success"] >= SOURCE]
    bench = ReachBench(checkpoint, seed, 2, untold)
    goals, rows = bench.target_goals(per_target * len(bench.targets)), []
    for how in direct_ways(bench.actor):
        played = bench.play(bench.usual, goals, how)
        row = played.row(f"seed-{manifest['seed']}{ending(how)}")
        spent = {"cpu_min": told[-1]["cpu_s"] / 60.0, "updates": manifest["updates"]}
        told_by = {"checkpoint": checkpoint.sha256, **spent}
        rows.append({**row, **told_by, "to_source_min": passed[0] if passed else None})
    return rows


def main() -> None:
    """Evaluate runs and write the result."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN")
    parser.add_argument("--seed", type=int, default=11, help="of the episodes")
    parser.add_argument("--episodes", type=int, default=PER_TARGET, help="per target")
    options = parser.parse_args()
    torch.set_num_threads(1)
    rows: list[Json] = []
    for folder in options.runs:
        rows += rows_of(folder, options.seed, options.episodes)
    rows += kept(rows, options.seed, options.episodes)
    result = {
        "protocol": "reach-seeds",
        "command": "python docs/reach_seeds.py RUN ...",
        "policy": "reach-td3",
        "seed": options.seed,
        "episodes": options.episodes,
        "results": sorted(rows, key=lambda row: str(row["name"])),
        "machine": describe(),
    }
    RESULTS.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
