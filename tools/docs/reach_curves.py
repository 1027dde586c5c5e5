"""Collect learning curves of the reach scenario, evaluated as in docs/method.md 2.5.

    python -m tools.docs.reach_curves RUN ... [--episodes N] [--stock NAME=FILE.jsonl]

A RUN is a folder with a ``curve.jsonl``, as written by ``training_curves.py``. Each stored
policy is evaluated on 20 episodes (``--episodes``) of each of the 54 targets. ``--stock`` adds
the curve of another learner: one JSON object per line with ``env_steps``, ``cpu_s``,
``success`` and ``collision``. Writes ``docs/results/reach-curves.json`` (drawn by
``reach_plots.py``); a curve of the same preset and seed is replaced, other curves are kept.

A curve has ``played``, the greedy evaluations during training on the goals of the training, and
``tests``, one point per stored policy.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import torch

from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.evaluation.reach.bench import ReachBench
from app.provenance import describe
from tools.docs.training_curves import read

ROOT = Path(__file__).resolve().parents[2]

RESULTS = ROOT / "docs/results/reach-curves.json"
SEED = 77
"""Seed of the episodes; training uses none such."""
PER_TARGET = 20
"""Episodes of each target (METHOD 2.5)."""
ENDS = ("success", "collision", "timeout")
Json = dict[str, Any]


def lines(path: Path) -> list[Json]:
    """Return the objects of a file with one per line."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line]


def point_of(checkpoint: Checkpoint, per_target: int) -> Json:
    """Return the rates of outcomes of a policy over all targets."""
    rates = ReachBench(checkpoint, SEED).on_targets(per_target).rates()
    return {name: rates[name]["mean"] for name in ENDS}


def curve_of_run(folder: Path, per_target: int) -> Json:
    """Return the curve of a training: its points, and its policies on all targets."""
    points = lines(folder / "curve.jsonl")
    spent = {one["step"]: one["cpu_s"] for one in points}
    targets = []
    for path in sorted(folder.glob("step-*.json")):
        checkpoint = read(path)
        point, step = point_of(checkpoint, per_target), checkpoint.manifest["step"]
        targets.append({"step": step, "cpu_s": spent.get(step), **point})
    return {
        "name": points[0]["preset"],
        "seed": points[0]["seed"],
        "episodes_per_target": per_target,
        "played": [_played(one) for one in points if one["collision"] is not None],
        "targets": [one for one in targets if one["cpu_s"] is not None],
    }


def _played(point: Json) -> Json:
    return {"step": point["step"], "cpu_s": point["cpu_s"], **{k: point[k] for k in ENDS}}


def curve_of_stock(name: str, path: Path) -> Json:
    """Return the curve of another learner; its points are its own evaluations."""
    points = [
        {
            "step": one["env_steps"],
            "cpu_s": one["cpu_s"],
            "success": one["success"],
            "collision": one["collision"],
            "timeout": 1.0 - one["success"] - one["collision"],
        }
        for one in lines(path)
    ]
    return {"name": name, "seed": None, "played": points, "targets": []}


def merged(found: list[Json], new: list[Json]) -> list[Json]:
    """Return curves with those of the same name and seed replaced, in order."""
    by_key = {(one["name"], one["seed"] or 0): one for one in [*found, *new]}
    return [by_key[key] for key in sorted(by_key)]


def main() -> None:
    """Evaluate runs and write the curves."""
    parser = argparse.ArgumentParser(description="Collect learning curves of reaching.")
    parser.add_argument("runs", nargs="*", type=Path, metavar="RUN")
    parser.add_argument("--stock", action="append", default=[], metavar="NAME=FILE")
    parser.add_argument("--episodes", type=int, default=PER_TARGET, help="per target")
    options = parser.parse_args()
    torch.set_num_threads(1)
    new = [curve_of_run(folder, options.episodes) for folder in options.runs]
    for one in options.stock:
        name, _, file = one.partition("=")
        new.append(curve_of_stock(name, Path(file)))
    found = (
        json.loads(RESULTS.read_text(encoding="utf-8"))["curves"] if RESULTS.exists() else []
    )
    result = {
        "command": "python -m tools.docs.reach_curves RUN ...",
        "seed": SEED,
        "curves": merged(found, new),
        "machine": describe(),
    }
    RESULTS.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
