"""Write the curves of trainings as they were recorded to a result file of the report.

    python -m tools.docs.thesis_curves thesis-reach RUN ...

A RUN is a folder with a ``curve.jsonl``, as written by ``training_curves.py``. Its points are
greedy episodes during the training: in the reach recipes 20 for each of 54 targets by default.
A reach curve also has the return of standing still in the same episodes. A curve of the same
preset and seed replaces the one in the file.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import torch

from app.policies.configs import presets
from app.policies.configs.fields import read_config
from app.policies.configs.reach import ReachPreset
from app.policies.training.reach import batch_of
from app.policies.training.td3 import CURVE_SEED, play
from app.provenance import describe
from app.sim.cells.cell import load_cell
from tools.docs.learning_curves import lines, merged
from tools.docs.training_curves import read

RESULTS = Path(__file__).resolve().parents[2] / "docs/results"
KEYS = (
    "step", "updates", "cpu_s", "episodes", "success", "collision", "timeout", "reward",
)  # fmt: skip
"""Content of a point."""
Json = dict[str, Any]


class Still(torch.nn.Module):
    """Actor that commands no motion."""

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return actions of 0, shape (n, 6)."""
        return torch.zeros(len(obs), 6)


def curve_of(folder: Path) -> Json:
    """Return the recorded curve of a training."""
    points = lines(folder / "curve.jsonl")
    curve: Json = {
        "name": points[0]["preset"],
        "seed": points[0]["seed"],
        "played": [{key: one[key] for key in KEYS} for one in points],
    }
    if isinstance(presets.get(curve["name"]), ReachPreset):
        manifest = read(sorted(folder.glob("step-*.json"))[-1].with_suffix("")).manifest
        preset = read_config(ReachPreset, manifest["preset"], "manifest.preset")
        curve["standing_still"] = standing_still(preset)
    return curve


def standing_still(preset: ReachPreset) -> float:
    """Return the mean return of standing still in the episodes of the curve of a preset."""
    n = preset.learning.progress_episodes
    _, returns = play(Still(), batch_of(preset, load_cell(preset.cell), n, CURVE_SEED))
    return float(returns.mean())


def main() -> None:
    """Write the curves of the runs that are named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", help="name of the result file, without .json")
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN")
    options = parser.parse_args()
    path = RESULTS / f"{options.file}.json"
    found = json.loads(path.read_text(encoding="utf-8"))["curves"] if path.exists() else []
    result = {
        "command": f"python -m tools.docs.thesis_curves {options.file} RUN ...",
        "seed": CURVE_SEED,
        "curves": merged(found, [curve_of(folder) for folder in options.runs]),
        "machine": describe(),
    }
    path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
