"""Write the curves of trainings as they were recorded to a result file of the report.

    python -m tools.docs.thesis_curves thesis-reach RUN ... [--variant TEXT]

A RUN is a folder with a ``curve.jsonl``, as written by ``training_curves.py`` or
``python -m app train``. Its points are greedy episodes during the training: in the reach
recipes 20 for each of 54 targets by default, in the pick recipe 200, in ``pick-td3`` those of
the environments without exploration. The curves of recipes also have the return of standing
still in these episodes.
A curve of the same preset and seed replaces the one in the file. Runs with other fields are
a variant: a text behind the name of the preset, such as "exchanged learning rates". Its
fields are listed in the file.
"""

import argparse
from pathlib import Path

import torch

from app.policies.configs import presets
from app.policies.configs.fields import FieldGroup, read_config
from app.policies.configs.pick import PickPreset
from app.policies.configs.reach import ReachPreset
from app.policies.configs.sorting import SortingPreset
from app.policies.training import pick, reach
from app.policies.training.curve import CURVE_SEED, play
from app.sim.cells.cell import Cell, load_cell
from app.sim.pick.batch import PickBatch
from app.sim.reach.mixed_batch import ReachEnvironments
from tools.docs.learning_curves import add_curves, lines
from tools.docs.results import RESULTS, Json
from tools.docs.training_curves import read

KEYS = tuple("step updates cpu_s episodes success collision timeout reward".split())
"""Content of a point."""


class StandingStill(torch.nn.Module):
    """Actor that commands no motion.

    Args:
        n_act: Length of an action.
    """

    def __init__(self, n_act: int) -> None:
        super().__init__()
        self._n_act = n_act

    def forward(self, obs: torch.Tensor) -> torch.Tensor:
        """Return actions of 0, shape (n, n_act)."""
        return torch.zeros(len(obs), self._n_act)


def curve_of(folder: Path, variant: str | None = None) -> Json:
    """Return the recorded curve of a training.

    Args:
        folder: Folder of the training.
        variant: What distinguishes it from its preset, for its name.
    """
    stored = folder / "policy.json"
    last = stored if stored.exists() else sorted(folder.glob("step-*.json"))[-1]
    manifest = read(last.with_suffix("")).manifest
    points = lines(folder / "curve.jsonl")
    curve: Json = {
        "name": manifest["preset"]["name"],
        "seed": manifest["seed"],
        "commits": manifest["commits"],
        "played": [{key: one[key] for key in KEYS} for one in points],
    }
    usual = presets.get(curve["name"])
    preset = read_config(type(usual), manifest["preset"], "manifest.preset")
    if variant is not None:
        curve["name"] += f", {variant}"
        curve["fields"] = {
            f"{group}.{name}": value
            for group, fields in preset
            if isinstance(fields, FieldGroup)
            for name, value in fields
            if value != getattr(getattr(usual, group), name)
        }
    if not isinstance(preset, SortingPreset):
        if preset.learning.progress_episodes > 0:
            curve["standing_still"] = standing_still(preset)
    return curve


def standing_still(preset: ReachPreset | PickPreset, cell: Cell | None = None) -> float:
    """Return the mean return of standing still in the episodes of the curve of a preset.

    Args:
        preset: Training configuration.
        cell: Cell of the training; None for that of the preset.
    """
    cell = cell or load_cell(preset.cell)
    if isinstance(preset, PickPreset):
        batch: PickBatch | ReachEnvironments = pick.curve_batch(preset, cell)
    else:
        batch = reach.curve_batch(preset, cell)
    _, returns = play(StandingStill(batch.n_act), batch)
    return float(returns.mean())


def main() -> None:
    """Write the curves of the runs that are named on the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", help="name of the result file, without .json")
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN")
    parser.add_argument("--variant", help="what distinguishes the runs from their preset")
    options = parser.parse_args()
    command = f"python -m tools.docs.thesis_curves {options.file} RUN ..."
    curves = [curve_of(run, options.variant) for run in options.runs]
    add_curves(RESULTS / f"{options.file}.json", command, CURVE_SEED, curves)


if __name__ == "__main__":
    main()
