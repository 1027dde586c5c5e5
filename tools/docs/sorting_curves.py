"""Collect learning curves of the sorting task, evaluated as in docs/method.md 1.5.

    python -m tools.docs.sorting_curves RUN ... [--stock CELL=FILE.jsonl] [--episodes N]

A RUN is a folder written by ``training_curves.py``. Each stored policy is evaluated greedily
and without planner fallback on each pair (K_E, K_G): 500 episodes per pair on e0, 100 on e1,
or ``--episodes``. ``--stock`` adds the output of ``tests/benchmarks/stock_dqn.py``. Writes
``docs/results/sorting-curves.json`` (drawn by ``sorting_plots.py``); a curve of the same
preset and seed is replaced, other curves are kept.

A curve has ``played``, the greedy evaluations during training, and ``pairs``, one point per
stored policy.
"""

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch

from app.policies.checkpoints.trained_cell import cell_of
from app.policies.configs import presets
from app.policies.evaluation.sorting.curve import curve_episodes, curve_point
from app.policies.inference.sorting_policy import SortingPolicy
from app.provenance import describe
from app.sim.sorting.batch import fail_of
from tools.docs.training_curves import read

ROOT = Path(__file__).resolve().parents[2]

RESULTS = ROOT / "docs/results/sorting-curves.json"
SEED = 77
"""Seed of the episodes; not used in training."""
STOCK = "stock Stable-Baselines3 DQN"
Json = dict[str, Any]


def lines(path: Path) -> list[Json]:
    """Return the objects of a JSON Lines file."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line]


def curve_of_run(folder: Path, episodes: int | None) -> Json:
    """Return the curve of a training: its points, and its policies on all pairs."""
    points = lines(folder / "curve.jsonl")
    spent = {one["step"]: one["cpu_s"] for one in points}
    first = points[0]
    cell = presets.get(first["preset"]).cell
    named = {"task": cell, "name": first["preset"], "seed": first.get("seed", 1)}
    pairs = []
    for path in sorted(folder.glob("step-*.json")):
        checkpoint = read(path)
        manifest = checkpoint.manifest
        policy, fail = SortingPolicy(checkpoint), fail_of(cell_of(manifest))
        n = episodes or curve_episodes(policy.shape)
        point = curve_point(policy.values, policy.shape, fail, n, SEED)
        named = {
            "task": manifest["cell"],
            "name": manifest["preset"]["name"],
            "seed": manifest["seed"],
            "episodes_per_pair": n,
        }
        step = manifest["step"]
        pairs.append({"step": step, "cpu_s": spent.get(step), **asdict(point)})
    return {**named, "played": [_played(one) for one in points], "pairs": pairs}


def _played(point: Json) -> Json:
    return {
        "step": point["step"],
        "cpu_s": point["cpu_s"],
        "success": point["success"],
        "mean_return": point["reward"],
    }


def curve_of_stock(cell: str, path: Path) -> Json:
    """Return the curve of the stock learner; its points are its own evaluations."""
    points = [
        {
            "step": one["env_steps"],
            "cpu_s": one["cpu_s"],
            "success": one["success"],
            "mean_return": one["return"],
        }
        for one in lines(path)
    ]
    return {"task": cell, "name": STOCK, "seed": None, "played": points, "pairs": []}


def merged(found: list[Json], new: list[Json]) -> list[Json]:
    """Return curves with those of the same task, name and seed replaced, in order."""

    def key(one: Json) -> tuple[str, str, int]:
        return one["task"], one["name"], one["seed"] or 0

    by_key = {key(one): one for one in [*found, *new]}
    return [by_key[one] for one in sorted(by_key)]


def main() -> None:
    """Evaluate runs and write the curves."""
    parser = argparse.ArgumentParser(description="Collect learning curves of sorting.")
    parser.add_argument("runs", nargs="*", type=Path, metavar="RUN")
    parser.add_argument("--stock", action="append", default=[], metavar="CELL=FILE")
    parser.add_argument("--episodes", type=int, help="per pair; the source's by default")
    options = parser.parse_args()
    torch.set_num_threads(1)
    new = [curve_of_run(folder, options.episodes) for folder in options.runs]
    for one in options.stock:
        cell, _, file = one.partition("=")
        new.append(curve_of_stock(cell, Path(file)))
    found = (
        json.loads(RESULTS.read_text(encoding="utf-8"))["curves"] if RESULTS.exists() else []
    )
    result = {
        "command": "python -m tools.docs.sorting_curves RUN ...",
        "seed": SEED,
        "curves": merged(found, new),
        "machine": describe(),
    }
    RESULTS.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
