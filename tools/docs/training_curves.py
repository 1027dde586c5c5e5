"""Train a preset and store learning curve and policies.

    python -m tools.docs.training_curves sorting-e0-dqn --seed 1 --output runs/e0-1
        [--set FIELD=VALUE]

The folder contains ``curve.jsonl``, one line per point (steps, updates, CPU seconds, success
and return of greedy episodes), and one policy per checkpoint; ``sorting/curves.py`` and
``reach/curves.py`` evaluate them. An interrupted run is resumed.
"""

import argparse
import json
from dataclasses import asdict
from pathlib import Path

import torch

from app.cli.train import cut_curve, parse_overrides
from app.policies.checkpoints import checkpoint as formats
from app.policies.checkpoints.checkpoint import Checkpoint
from app.policies.configs import presets
from app.policies.configs.presets import Preset
from app.policies.training.progress import Progress
from app.policies.training.state import TrainingState
from app.policies.training.state_folder import StateFolder
from app.policies.training.train import train


def main() -> None:
    """Train one preset with one seed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("preset")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--set", action="append", default=[], dest="sets")
    options = parser.parse_args()
    torch.set_num_threads(1)
    preset = presets.resolve(options.preset, presets.nested(parse_overrides(options.sets)))
    record(preset, options.seed, options.output)


def record(preset: Preset, seed: int, folder: Path, *, predicts: bool = True) -> None:
    """Train a preset or resume; store curve and policies in a folder.

    Args:
        preset: Training configuration.
        seed: Seed of the training.
        folder: Where curve, policies and, until the end, states are stored.
        predicts: Whether pick policies get outcome probabilities at the end.
    """
    folder.mkdir(parents=True, exist_ok=True)
    states = StateFolder(folder / "resume")
    resume = states.newest()
    cut_curve(folder / "curve.jsonl", 0 if resume is None else resume.step)

    def on_progress(point: Progress) -> None:
        with (folder / "curve.jsonl").open("a", encoding="utf-8") as file:
            file.write(
                json.dumps({"preset": preset.name, "seed": seed, **asdict(point)}) + "\n"
            )

    stored = 0

    def on_checkpoint(step: int, policy: Checkpoint, state: TrainingState | None) -> None:
        nonlocal stored
        stored = step
        write(policy, folder / f"step-{step:09d}")
        if state is not None:
            states.write(state)

    train(
        preset,
        seed=seed,
        on_progress=on_progress,
        on_checkpoint=on_checkpoint,
        should_stop=lambda: not predicts and stored == preset.learning.total_steps,
        memory=states.memory,
        resume=resume,
    )
    states.remove()


def write(checkpoint: Checkpoint, path: Path) -> None:
    """Write tensors, then the manifest."""
    path.with_suffix(".safetensors").write_bytes(checkpoint.tensors)
    path.with_suffix(".json").write_text(json.dumps(checkpoint.manifest), encoding="utf-8")


def read_if_there(path: Path) -> Checkpoint | None:
    """Return a checkpoint, or None if it does not exist."""
    return read(path) if path.with_suffix(".json").exists() else None


def read(path: Path) -> Checkpoint:
    """Return a checkpoint written by :func:`write`."""
    manifest = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    return formats.load(manifest, path.with_suffix(".safetensors").read_bytes())


if __name__ == "__main__":
    main()
