"""Collect learning curves of trainings and of other learners into a result file.

``training_curves.py`` writes the runs. A curve of the same task, preset and seed replaces the
one in the file; other curves are kept.
"""

import argparse
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import torch

from app.policies.checkpoints.checkpoint import Checkpoint
from tools.docs.results import Json, read_if_measured, write_result
from tools.docs.training_curves import read


def lines(path: Path) -> list[Json]:
    """Return the objects of a JSON Lines file."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line]


def policies(folder: Path) -> Iterator[Checkpoint]:
    """Yield the stored policies of a run in the order of their steps."""
    for path in sorted(folder.glob("step-*.json")):
        yield read(path)


def merged(found: Sequence[Json], new: Sequence[Json]) -> list[Json]:
    """Return curves with those of the same task, name and seed replaced, in order."""
    by_key = {
        (one.get("task", ""), one["name"], one["seed"] or 0): one for one in [*found, *new]
    }
    return [by_key[key] for key in sorted(by_key)]


def add_curves(path: Path, command: str, seed: int, new: Sequence[Json]) -> None:
    """Add curves to a result file.

    Args:
        command: Command stated in the result.
        seed: Seed of the episodes.
    """
    found = (read_if_measured(path) or {"curves": []})["curves"]
    write_result(path, {"command": command, "seed": seed, "curves": merged(found, new)})


def collect(
    title: str,
    results: Path,
    command: str,
    seed: int,
    of_run: Callable[[Path, int | None], Json],
    of_stock: Callable[[str, Path], Json],
) -> None:
    """Evaluate the runs named on the command line and write their curves.

    Args:
        title: Description of the command.
        results: Result file.
        command: Command stated in the result.
        seed: Seed of the episodes.
        of_run: Returns the curve of a run; the number may replace that of the episodes.
        of_stock: Returns the curve of another learner from its name and a JSON Lines file.
    """
    parser = argparse.ArgumentParser(description=title)
    parser.add_argument("runs", nargs="*", type=Path, metavar="RUN")
    parser.add_argument("--stock", action="append", default=[], metavar="NAME=FILE")
    parser.add_argument("--episodes", type=int, help="per target or pair")
    options = parser.parse_args()
    torch.set_num_threads(1)
    new = [of_run(folder, options.episodes) for folder in options.runs]
    for one in options.stock:
        name, _, file = one.partition("=")
        new.append(of_stock(name, Path(file)))
    add_curves(results, command, seed, new)
